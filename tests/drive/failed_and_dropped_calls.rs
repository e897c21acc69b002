//! Ports that fail and calls that are dropped: the next call continues where this one ended.

use crate::rig::*;

#[test]
fn a_write_that_fails_inside_a_frame_leaves_the_rest_for_the_next_call() {
    for (failure, error) in
        [(Step::Error, DriveError::Port(Unplugged)), (Step::Zero, DriveError::WriteZero)]
    {
        for cut in 1..5 {
            for round in ROUNDS {
                let steps = [Step::Few(cut), failure.clone(), failure.clone()];
                let mut driver = on(Recorder::sending(&[b"12345", b"67"]), Port::writing(steps));
                assert_eq!(round(&mut driver), Some(Err(error)));
                assert_eq!(driver.unsent(), &b"12345"[cut..]);
                assert_eq!(round(&mut driver), Some(Err(error)));
                assert_eq!(driver.unsent(), &b"12345"[cut..]);
                assert_eq!(round(&mut driver), Some(Ok(())));
                assert_eq!(
                    (&driver.port().written[..], driver.port().flushed),
                    (&b"1234567"[..], 4)
                );
            }
        }
    }
}

#[test]
fn unsent_frames_can_be_discarded() {
    for round in ROUNDS {
        let steps = [Step::Few(2), Step::Error];
        let mut driver = on(Recorder::sending(&[b"12345", b"67"]), Port::writing(steps));
        assert_eq!(round(&mut driver), Some(Err(DriveError::Port(Unplugged))));
        assert_eq!((driver.discard(), driver.discard()), (3, 0));
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!(driver.port().written, b"1267");
    }
}

#[test]
fn a_failed_flush_is_retried_by_the_next_call() {
    for round in ROUNDS {
        let port = Port { flushes: [Step::Error].into(), ..Port::default() };
        let mut driver = on(Recorder::sending(&[b"12"]), port);
        assert_eq!(round(&mut driver), Some(Err(DriveError::Port(Unplugged))));
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!((&driver.port().written[..], driver.port().flushed), (&b"12"[..], 1));
    }
}

#[test]
fn a_read_that_fails_or_ends_is_reported_after_earlier_bytes_and_loses_nothing() {
    for (failure, error) in
        [(Step::Error, DriveError::Port(Unplugged)), (Step::Zero, DriveError::Closed)]
    {
        for round in ROUNDS {
            let (head, tail) = (Step::Bytes(b"he".into()), Step::Bytes(b"ad".into()));
            let mut driver = on(Recorder::default(), Port::reading([head, failure.clone(), tail]));
            assert_eq!(round(&mut driver), Some(Err(error)));
            assert_eq!(driver.role().received, b"he");
            assert_eq!(round(&mut driver), Some(Ok(())));
            assert_eq!(driver.role().received, b"head");
        }
    }
}

#[test]
fn an_async_call_dropped_at_any_await_and_repeated_loses_no_byte_and_cuts_no_frame() {
    let incoming: Vec<u8> = (0..40).collect();
    let frames: [&[u8]; 3] = [b"first", b"second", b"third"];
    let whole = frames.concat();
    let mut polls = 1;
    loop {
        // A write that is ready only on the second poll never completes if polled once.
        polls += 1;
        let world = World::default();
        let (mut near, mut far) = Port::pair(&world, 20);
        (near.most, near.stutters) = (1, true);
        embedded_io::Write::write(&mut far, &incoming).unwrap();
        let mut role = Recorder::sending(&frames);
        role.repeats = true;
        let mut driver = on(role, near);
        let mut events = vec![];
        let mut dropped = 0;
        // Every call is dropped after this many polls, again and again.
        for _ in 0..1000 {
            let within = at_ms(1000) - driver.now();
            match world.poll_times(polls, driver.asynch().next_event(within)) {
                Some(event) => events.extend(event.unwrap()),
                None => dropped += 1,
            }
            world.step(20);
        }
        assert_eq!(events, incoming, "dropped after {polls} polls");
        let sent: Vec<u8> =
            driver.port().outboxes[0].borrow().iter().map(|&(_, byte)| byte).collect();
        assert_eq!(sent, whole, "dropped after {polls} polls");
        if dropped == 0 {
            break;
        }
    }
    assert!(polls > 10, "{polls}");
}

#[test]
fn a_dropped_write_or_flush_that_stalled_is_completed_by_the_next_call() {
    let port = Port {
        writes: [Step::Few(3), Step::Stall, Step::Few(1), Step::Stall].into(),
        flushes: [Step::Stall, Step::Stall].into(),
        ..Port::default()
    };
    let mut driver = on(Recorder::sending(&[b"12345"]), port);
    assert_eq!(ASYNC(&mut driver), None);
    assert_eq!(driver.unsent(), b"45");
    assert_eq!(ASYNC(&mut driver), None);
    assert_eq!(driver.unsent(), b"5");
    for _ in 0..2 {
        assert_eq!(ASYNC(&mut driver), None);
        assert_eq!((driver.unsent(), driver.port().flushed), (&b""[..], 0));
    }
    assert_eq!(ASYNC(&mut driver), Some(Ok(())));
    assert_eq!((&driver.port().written[..], driver.port().flushed), (&b"12345"[..], 1));
}
