//! Ports that take a packet in parts: whether the pauses in between have ended it (I12, U16).

use std::pin::pin;

use crate::{
    motor_line::{ALL, Wire, owe_stop, run},
    rig::*,
};

/// A motor at 10 rps behind a port that from now on handles successive parts of each WRITE like
/// this. The node drops a packet after five byte times of silence.
fn turning(parts: impl Fn(usize) -> Step + 'static) -> (Wire, Bus) {
    let (wire, mut bus) =
        Wire::one_motor(Mode::Velocity, |config| config.polling = Polling::Manual);
    bus.set_velocity(NodeId::N1, Rps::new(10.0).unwrap()).unwrap();
    wire.world.step(300_000);
    let _ = bus.service();
    let (mut part, mut left) = (0, 0);
    wire.write_with(move |bytes| {
        if bytes.len() == WriteRequest::LEN {
            (part, left) = (0, WriteRequest::LEN);
        } else if bytes.len() == left {
            part += 1;
        } else {
            return ALL;
        }
        let write = parts(part);
        if let Step::Few(count) | Step::Lags(_, count) | Step::Drains(count, _) = write {
            left = bytes.len().saturating_sub(count);
        }
        write
    });
    (wire, bus)
}

/// The stop counts as paid only if the motor has received it; once the port works again, it is
/// stopped. Returns whether it is paid by the blocking call and by the async one.
fn is_paid(parts: impl Fn(usize) -> Step + Copy + 'static) -> [bool; 2] {
    [false, true].map(|is_async| {
        let (wire, mut bus) = turning(parts);
        let stopped = call!(is_async, bus, stop(NodeId::N1));
        assert!(
            stopped.is_err() || wire.rps() == 0.0,
            "reported as stopped, but turns at {}",
            wire.rps()
        );
        wire.write_all();
        run(&mut bus, 100);
        assert_eq!((wire.rps(), bus.role().stops_owed()), (0.0, NodeSet::NONE));
        stopped.is_ok()
    })
}

#[test]
fn a_stop_whose_write_comes_back_late_in_the_middle_of_the_packet_pays_nothing() {
    for (count, late_us) in [(1, 130), (4, 130), (4, 300), (7, 130), (7, 1000)] {
        let late = move |part| if part == 0 { Step::Drains(count, late_us) } else { ALL };
        assert_eq!(is_paid(late), [false; 2], "a pause of {late_us} us after {count} bytes");
        let late = move |part| match part {
            0 => Step::Few(count),
            _ => Step::Lags(20 * count as u64 + late_us, 8),
        };
        assert_eq!(is_paid(late), [false; 2], "{late_us} us before the rest of {count} bytes");
    }
}

#[test]
fn whatever_a_port_does_with_the_parts_of_a_stop_it_is_paid_only_if_it_was_heard() {
    for count in [1, 2, 4, 7] {
        for late_us in (0..=400).step_by(13) {
            is_paid(move |_| Step::Lags(late_us, count));
            is_paid(move |_| Step::Drains(count, late_us));
            is_paid(move |part| if part == 0 { Step::Drains(count, late_us) } else { ALL });
            is_paid(move |part| match part {
                0 => Step::Few(count),
                _ => Step::Lags(late_us, count),
            });
        }
    }
}

#[test]
fn a_stop_leaves_through_a_port_that_takes_a_few_bytes_and_waits_until_they_are_out() {
    for count in 1..=8 {
        assert_eq!(is_paid(move |_| Step::Drains(count, 0)), [true; 2], "{count} bytes at a time");
    }
    for late_us in [10, 30] {
        assert_eq!(
            is_paid(move |_| Step::Drains(4, late_us)),
            [true; 2],
            "with pauses of {late_us} us"
        );
    }
}

#[test]
fn a_stop_leaves_through_a_port_that_takes_a_few_bytes_into_a_buffer() {
    for count in 1..=8 {
        assert_eq!(is_paid(move |_| Step::Few(count)), [true; 2], "{count} bytes at a time");
    }
}

/// The rest comes late, but perhaps not too late: only the flush can tell.
const IN_DOUBT: fn(usize) -> Step =
    |part| if part == 0 { Step::Few(4) } else { Step::Lags(170, 8) };

#[test]
fn a_packet_in_doubt_is_flushed_before_the_next_one_is_sent() {
    let (wire, mut bus) = turning(IN_DOUBT);
    let before = wire.sent().len();
    owe_stop(&mut bus);
    bus.service().unwrap();
    let packet = before + WriteRequest::LEN;
    assert_eq!(wire.sent().len(), packet, "a READ follows a cut-off WRITE");
    wire.world.step(50);
    bus.service().unwrap();
    assert_eq!(wire.sent().len(), packet, "no silence after a cut-off WRITE");
}

#[test]
fn a_packet_in_doubt_whose_flush_is_cancelled_or_stalls_counts_as_cut_off() {
    for is_cancelled in [false, true] {
        let (wire, mut bus) = turning(IN_DOUBT);
        let writes = bus.role().statistics().writes;
        bus.port_mut().flushes.extend(vec![Step::Stall; 9]);
        owe_stop(&mut bus);
        if is_cancelled {
            assert!(poll(pin!(bus.asynch().service())).is_pending());
            assert_eq!(bus.role().statistics().writes, writes + 1);
            bus.port_mut().flushes.clear();
            wire.write_with(|_| Step::Error);
            let _ = bus.service();
        } else {
            assert_eq!(wire.world.block_on(bus.asynch().service()), Err(DriveError::Stalled));
        }
        assert_eq!(bus.role().statistics().writes, writes, "the stop was not written");
        bus.port_mut().flushes.clear();
        wire.write_all();
        run(&mut bus, 100);
        assert_eq!((wire.rps(), bus.role().stops_owed()), (0.0, NodeSet::NONE));
    }
}
