//! Frames for a bus and for a rover on a line within the process.

mod bus;
mod model;
mod rover;

use axlewire::{
    ikeya::{Mode, NodeId, ReadRequest, Rps, WriteRequest},
    time::wire_time,
};

use super::*;
use crate::{
    args::PortArgs,
    bus::MasterArgs,
    clock,
    played::{self, Played},
};

type Frames<'a> = [(u64, &'a [u8])];

/// A run with these frames, at these times in milliseconds.
struct Run {
    protocol: Protocol,
    side: Side,
    meant: Option<Mode>,
    baud: Option<u32>,
    linger_ms: u64,
    reads_back: bool,
}

const BUS: Run = Run {
    protocol: Protocol::Ikeya,
    side: Side::Commander,
    meant: None,
    baud: None,
    linger_ms: 0,
    reads_back: false,
};

impl Run {
    fn on<T>(
        &self,
        line: &Played<T>,
        frames: &Frames<'_>,
        signals: &Signals,
    ) -> Result<(), String> {
        self.on_line(&line.line, frames, signals)
    }

    fn on_line(&self, line: &Line, frames: &Frames<'_>, signals: &Signals) -> Result<(), String> {
        let bus = MasterArgs::new(PortArgs::new(self.baud), None);
        let due = |(after_ms, bytes): &(u64, &[u8])| {
            let (_, effect) = effect_of(self.protocol, bytes).unwrap();
            Due { after_us: after_ms * 1000, bytes: (*bytes).into(), meant: self.meant, effect }
        };
        let plan = Plan {
            bus: &bus,
            protocol: self.protocol,
            side: self.side,
            frames: frames.iter().map(due).collect(),
            reads_back: self.reads_back,
            linger_us: self.linger_ms * 1000,
            limits: Limits { max_rps: Rps::new(20.0).unwrap(), max_turns: 100.0 },
            is_json: true,
            notes: Vec::new(),
            modes: crate::listing::Modes::default(),
            summary: None,
        };
        play_on(plan, line.clone(), Teller::to_memory().0, signals)
            .map_err(|failure| failure.to_string())
    }
}

fn read(node: NodeId) -> [u8; 4] {
    *ReadRequest::new(node).as_bytes()
}

fn speed(node: NodeId, rps: f32) -> [u8; 8] {
    *WriteRequest::velocity(node, Rps::new(rps).unwrap()).as_bytes()
}

#[test]
fn a_question_leaves_at_its_time_once_the_line_has_carried_the_answer_to_the_one_before() {
    let line = played::bus(&[], |_, _| {});
    let read = read(NodeId::N1);
    let frames: [(u64, &[u8]); 4] = [(0, &read), (0, &read), (50, &read), (51, &read)];
    let run = Run { baud: Some(9600), linger_ms: 300, ..BUS };
    let begin = clock::now();
    run.on(&line, &frames, &Signals::none()).unwrap();
    let said = &line.state.borrow().said;
    let at: Vec<_> = said.iter().map(|(_, at)| (*at - begin).as_micros()).collect();
    // 4 bytes, 8 of the answer and the pause in between.
    let busy = u128::from(wire_time(12, 9600).as_micros()) + 200;
    let late = |at: u128, due: u128| (due..due + 1000).contains(&at);
    let [a, b, c, d] = at[..] else { panic!("{at:?}") };
    assert!(late(a, 0) && late(b, busy) && late(c, 50_000) && late(d, c + busy), "{at:?}");
    let took = clock::since(begin).as_micros();
    assert!(late(took, d + 300_000), "{took}");
}

#[test]
fn an_answer_moves_nobody_and_is_sent_without_a_question() {
    let line = played::played(Vec::new(), |heard: &mut Vec<u8>, bytes| {
        heard.extend(bytes);
        Vec::new()
    });
    let answer = axlewire::ikeya::VelocityResponse::new(NodeId::N1, Rps::ZERO);
    let run = Run { side: Side::Device, ..BUS };
    run.on(&line, &[(0, answer.as_bytes())], &Signals::none()).unwrap();
    assert_eq!(*line.state.borrow(), answer.as_bytes());
}

#[test]
fn a_line_that_is_lost_is_told_with_what_it_means() {
    for protocol in [Protocol::Ikeya, Protocol::Ucp] {
        let line = played::rover(|_| {});
        let ping = axlewire::ucp::Body::frame(axlewire::ucp::message::Ping {}, 0);
        let (read, ping) = (read(NodeId::N1), ping.as_bytes().to_vec());
        line.is_gone.set(true);
        let frame = if protocol == Protocol::Ucp { &ping[..] } else { &read };
        let error = Run { protocol, ..BUS }.on(&line, &[(0, frame)], &Signals::none());
        assert_eq!(error.unwrap_err(), "port \"played\" failed: unplugged; nothing moves");
    }
}
