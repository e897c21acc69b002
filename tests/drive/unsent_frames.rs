//! Ports that fail: what is still sent, and what goes back to its role (I12, U16).

use crate::rig::*;

fn frames_of(driver: &On<Recorder>) -> usize {
    let is_frame = |call: &&Call| matches!(call, Call::Transmit(Some(_)));
    driver.role().calls.iter().filter(is_frame).count()
}

#[test]
fn a_receive_error_is_returned_after_due_frames_have_been_sent_and_flushed() {
    for (failure, error) in [(Step::Error, GONE), (Step::Zero, DriveError::Closed)] {
        for round in ROUNDS {
            let mut role = Recorder::sending(&[b"stop", b"stop again"]);
            role.timeout = Some(at_ms(0));
            let mut driver = on(role, Port::reading([failure.clone()]));
            assert_eq!(round(&mut driver), Some(Err(error)));
            assert_eq!(driver.port().written, b"stopstop again");
            assert_eq!(driver.port().flushed, 1);
            assert!(driver.role().calls.contains(&Call::Timeout), "time passes as well");
            assert_eq!(round(&mut driver), Some(Ok(())));
        }
    }
}

#[test]
fn a_receiver_that_fails_while_a_frame_is_sent_does_not_cut_it() {
    for round in ROUNDS {
        let port = Port {
            reads: [Step::Bytes(b"x".into()), Step::Error, Step::Error, Step::Error].into(),
            ..Port::writing([Step::Few(1), Step::Few(1), Step::Few(1)])
        };
        let mut driver = on(Recorder::sending(&[b"frame"]), port);
        assert_eq!(round(&mut driver), Some(Err(GONE)));
        assert_eq!((&driver.port().written[..], driver.port().flushed), (&b"frame"[..], 1));
        assert!(driver.unsent().is_empty());
        assert_eq!(driver.role().unsent(), []);
    }
}

#[test]
fn of_several_errors_the_first_is_returned() {
    for round in ROUNDS {
        let port = Port {
            reads: [Step::Zero].into(),
            flushes: [Step::Error].into(),
            ..Port::writing([Step::Error])
        };
        let mut driver = on(Recorder::sending(&[b"frame"]), port);
        assert_eq!(round(&mut driver), Some(Err(DriveError::Closed)));
        let unsent = [Unsent::Untouched, Unsent::Unflushed];
        assert_eq!(driver.role().unsent(), unsent, "all three were tried");
    }
}

#[test]
fn a_frame_of_which_no_byte_has_left_goes_back_to_its_role() {
    for (failure, error) in [(Step::Error, GONE), (Step::Zero, DriveError::WriteZero)] {
        for round in ROUNDS {
            let role = Recorder::sending(&[b"old"]);
            let mut driver = on(role, Port::writing([failure.clone()]));
            assert_eq!(round(&mut driver), Some(Err(error)));
            assert_eq!(driver.role().unsent(), [Unsent::Untouched]);
            assert!(driver.unsent().is_empty());
            // It decides again.
            driver.role_mut().frames.push_back(b"new".into());
            assert_eq!(round(&mut driver), Some(Ok(())));
            assert_eq!(driver.port().written, b"new");
            assert_eq!(driver.role().unsent().len(), 1);
        }
    }
}

#[test]
fn a_cut_off_frame_continues_within_20_ms_and_is_dropped_after() {
    for (late_us, goes_on) in [(0, true), (20_000, true), (20_001, false), (1_000_000, false)] {
        for round in ROUNDS {
            let port = Port::writing([Step::Few(2), Step::Error]);
            let world = port.world.clone();
            let role = Recorder::sending(&[b"12345"]);
            let mut driver = on(role, port);
            assert_eq!(round(&mut driver), Some(Err(GONE)));
            assert_eq!((driver.unsent(), driver.role().unsent().len()), (&b"345"[..], 0));
            world.step(late_us);
            driver.role_mut().frames.push_back(b"next".into());
            assert_eq!(round(&mut driver), Some(Ok(())));
            let (written, unsent) = match goes_on {
                true => (&b"12345next"[..], vec![]),
                false => (&b"12next"[..], vec![Unsent::CutOff]),
            };
            assert_eq!((&driver.port().written[..], driver.role().unsent()), (written, unsent));
        }
    }
}

#[test]
fn the_time_limit_of_a_cut_off_frame_restarts_with_each_byte_that_leaves() {
    for round in ROUNDS {
        let port = Port::writing((0..4).flat_map(|_| [Step::Few(1), Step::Error]));
        let world = port.world.clone();
        let mut driver = on(Recorder::sending(&[b"12345"]), port);
        for _ in 0..4 {
            assert_eq!(round(&mut driver), Some(Err(GONE)));
            world.step(15_000);
        }
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!((&driver.port().written[..], frames_of(&driver)), (&b"12345"[..], 1));
    }
}

#[test]
fn a_role_is_told_of_a_failed_flush_once_for_everything_written_since_the_last() {
    for round in ROUNDS {
        let flushes = [Step::Error, Step::Error, Step::Error];
        let port = Port { flushes: flushes.into(), ..Port::default() };
        let mut driver = on(Recorder::sending(&[b"12"]), port);
        assert_eq!(round(&mut driver), Some(Err(GONE)));
        assert_eq!(driver.role().unsent(), [Unsent::Unflushed]);
        assert_eq!(round(&mut driver), Some(Err(GONE)), "retried");
        assert_eq!(driver.role().unsent().len(), 1);
        driver.role_mut().frames.push_back(b"34".into());
        assert_eq!(round(&mut driver), Some(Err(GONE)));
        assert_eq!(driver.role().unsent(), [Unsent::Unflushed; 2]);
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!(driver.port().flushed, 1);
    }
}

#[test]
fn a_role_is_told_again_of_a_failed_flush_if_its_port_has_been_asked_to_take_more_since() {
    for (step, round) in [
        (Step::Error, ROUNDS[0]),
        (Step::Error, ROUNDS[1]),
        (Step::Zero, ASYNC),
        (Step::Stall, ASYNC),
    ] {
        let flushes = [Step::Error, Step::Error].into();
        let port = Port { flushes, ..Port::writing([Step::Few(2), step.clone()]) };
        let mut driver = on(Recorder::sending(&[b"12"]), port);
        assert_eq!(round(&mut driver), Some(Err(GONE)));
        assert_eq!(driver.role().unsent(), [Unsent::Unflushed]);
        driver.role_mut().frames.push_back(b"34".into());
        // It fails, or is dropped while it waits; the next flush fails again.
        let is_dropped = matches!(step, Step::Stall);
        assert_eq!(round(&mut driver).is_none(), is_dropped);
        if is_dropped {
            assert_eq!(driver.role().unsent(), [Unsent::Unflushed], "there is nothing to tell yet");
            assert_eq!(round(&mut driver), Some(Err(GONE)));
        }
        let told = [Unsent::Unflushed, Unsent::Untouched, Unsent::Unflushed];
        assert_eq!(driver.role().unsent(), told, "{step:?}");
    }
}

#[test]
fn a_role_is_told_of_discarded_frames() {
    for round in ROUNDS {
        let flushes = [Step::Error].into();
        let port = Port { flushes, ..Port::writing([Step::Few(2), Step::Error]) };
        let mut driver = on(Recorder::sending(&[b"12345"]), port);
        assert_eq!(round(&mut driver), Some(Err(GONE)));
        assert_eq!(driver.role().unsent(), [Unsent::CutOff, Unsent::Unflushed]);
        assert_eq!((driver.discard(), driver.role().unsent()[2]), (0, Unsent::Unflushed));
    }
    // A frame that an async call could not send, and a flush that it did not make.
    let mut driver = on(Recorder::sending(&[b"12345"]), Port::writing([Step::Stall]));
    assert_eq!(ASYNC(&mut driver), None);
    assert_eq!(driver.discard(), 5);
    assert_eq!(driver.role().unsent(), [Unsent::Untouched, Unsent::Unflushed]);
}

#[test]
fn a_dropped_write_of_which_no_byte_has_left_goes_back_to_its_role() {
    let port = Port::writing([Step::Stall]);
    let mut driver = on(Recorder::sending(&[b"old"]), port);
    assert_eq!(ASYNC(&mut driver), None);
    driver.role_mut().frames.push_back(b"new".into());
    assert_eq!(ASYNC(&mut driver), Some(Ok(())));
    assert_eq!(driver.role().unsent(), [Unsent::Untouched]);
    assert_eq!(driver.port().written, b"new");
}

#[test]
fn the_rest_of_a_set_point_is_not_sent_behind_a_stop_also_after_a_failed_flush() {
    let mut story = Story::new(manual()).discovered();
    let packet = WriteRequest::velocity(NodeId::N2, rps(5.0));
    let (now, before) = (story.bus.now(), story.bus.port().written.len());
    story.bus.role_mut().set_velocity(NodeId::N2, rps(5.0), now).unwrap();
    let port = story.bus.port_mut();
    port.writes.extend([Step::Few(3), Step::Error]);
    port.flushes.push_back(Step::Error);
    assert!(story.bus.service().is_err());
    assert_eq!(story.bus.port().written[before..], packet.as_bytes()[..3]);
    story.bus.role_mut().stop(NodeId::N2, now);
    story.bus.service().unwrap();
    let behind = &story.bus.port().written[before + 3..];
    assert!(!behind.starts_with(&packet.as_bytes()[3..]), "{behind:02x?}");
}
