//! How a station is driven: DMA, a USB adapter, a slow loop, and endpoints that break the contract.

use crate::talker::*;

#[test]
fn a_pause_or_a_full_buffer_ends_a_piece_of_dma() {
    let mut line = one_way(500_000, 0, &[0; 10]);
    line.head_mut().say(at(1000), &[1; 3]);
    line.timing_mut(Who::Tail(0)).input = Input::AfterPause { pause: us(40), at_most: 8 };
    line.run_for(us(2000)).unwrap();
    let pieces: Vec<_> = line.tail(0).heard.iter().map(|(at, it)| (*at, it.len())).collect();
    assert_eq!(pieces, [(160, 8), (240, 2), (1100, 3)]);
}

#[test]
fn a_usb_adapter_delivers_after_its_latency_timer_or_when_it_is_full() {
    let mut line = one_way(500_000, 0, &[0; 70]);
    line.timing_mut(Who::Tail(0)).input = Input::usb_adapter();
    line.run_for(Duration::from_millis(50)).unwrap();
    let pieces: Vec<_> = line.tail(0).heard.iter().map(|(at, it)| (*at, it.len())).collect();
    assert_eq!(pieces, [(62 * 20, 62), (63 * 20 + 16_000, 8)]);
}

#[test]
fn a_slow_loop_sees_bytes_and_deadlines_later() {
    let mut line = one_way(500_000, 0, &[1, 2, 3]);
    line.head_mut().say(at(500), &[4]);
    line.timing_mut(Who::Head).latency = us(7);
    line.timing_mut(Who::Tail(0)).latency = us(50);
    line.run_for(us(2000)).unwrap();
    assert_eq!(line.tail(0).times(), [77, 97, 117, 577]);
}

/// An endpoint that breaks the contract.
#[derive(Debug)]
enum Bad {
    Impatient,
    Babbling,
    Insatiable,
}

impl Endpoint for Bad {
    type Event = ();
    fn handle_input(&mut self, _: &[u8], _: impl Into<Arrival>) {}
    fn handle_timeout(&mut self, _: Instant) {}

    fn poll_transmit(&mut self, _: Instant) -> Option<&[u8]> {
        matches!(self, Self::Babbling).then_some(b"x")
    }

    fn poll_event(&mut self) -> Option<()> {
        matches!(self, Self::Insatiable).then_some(())
    }

    fn poll_timeout(&self) -> Option<Instant> {
        matches!(self, Self::Impatient).then_some(at(100))
    }
}

#[test]
fn an_endpoint_that_would_make_a_driver_spin_is_an_error() {
    let run = |bad| {
        let mut line: Line<Talker, Bad> = Line::new(500_000, 0, Talker::default());
        line.add(bad);
        line.run_for(at(1000) - line.now())
    };
    let who = Who::Tail(0);
    assert_eq!(run(Bad::Impatient), Err(Stuck::BusyLoop { who, at: at(100) }));
    assert_eq!(run(Bad::Babbling), Err(Stuck::Endless { who, at: at(0) }));
    assert_eq!(run(Bad::Insatiable), Err(Stuck::Endless { who, at: at(0) }));
    let said = Stuck::BusyLoop { who, at: at(100) }.to_string();
    assert_eq!(said, "tail 0 makes its driver spin at 100 µs: its poll_timeout stays in the past");
    let said = Stuck::Endless { who: Who::Head, at: at(7) }.to_string();
    assert_eq!(
        said,
        "the head makes its driver spin at 7 µs: it sends or tells events without end"
    );
}
