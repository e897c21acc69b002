//! A round of a driver, over any role: what is done in which order, and that it ends.

use std::{cell::Cell, rc::Rc};

use crate::rig::*;

#[test]
fn a_round_takes_in_then_lets_time_pass_then_sends_and_flushes_once() {
    for round in ROUNDS {
        let mut role = Recorder::sending(&[b"one", b"two"]);
        role.timeout = Some(at_ms(0));
        let mut driver = on(role, Port::reading([Step::Bytes(b"in".into())]));
        assert_eq!(round(&mut driver), Some(Ok(())));
        // The time is told again right before each write.
        let expected = [
            Call::Input(b"in".into()),
            Call::Timeout,
            Call::Transmit(Some(b"one".into())),
            Call::Input(vec![]),
            Call::Transmit(Some(b"two".into())),
            Call::Input(vec![]),
            Call::Transmit(None),
        ];
        assert_eq!(driver.role().calls, expected);
        assert_eq!((&driver.port().written[..], driver.port().flushed), (&b"onetwo"[..], 1));
        // With nothing sent there is nothing to flush.
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!(driver.port().flushed, 1);
    }
}

#[test]
fn a_role_is_told_when_its_frame_was_taken_and_when_it_was_flushed() {
    for is_async in BOTH {
        // Only the write of the last part takes the frame, which is flushed at once.
        let mut port = Port { most: 2, ..Port::writing([Step::Late(3000)]) };
        port.flushes.push_back(Step::Late(4000));
        let role = Recorder::sending(&[b"123", b"45"]);
        let mut driver = on(role, port);
        let sent = call!(is_async, driver, service());
        assert_eq!(sent, Ok(()));
        assert_eq!(driver.role().taken_at, [3, 7].map(at_ms), "async {is_async}");
        assert_eq!(driver.role().flushed_at, [7, 7].map(at_ms), "async {is_async}");
    }
}

#[test]
fn timeouts_are_handled_only_when_the_role_has_requested_them() {
    for round in ROUNDS {
        let mut role = Recorder::default();
        role.timeout = Some(at_ms(1));
        let mut driver = on(role, Port::default());
        let world = driver.port().world.clone();
        world.step(999);
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!(driver.role().calls, [Call::Transmit(None)]);
        world.step(1);
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!(driver.role().calls[1..], [Call::Timeout, Call::Transmit(None)]);
    }
}

#[test]
fn bytes_arriving_while_a_frame_is_sent_are_taken_in_before_the_next_one() {
    for is_async in BOTH {
        let world = World::default();
        let (mut near, mut far) = Port::pair(&world, 20);
        (near.most, near.stutters) = (1, true);
        let (inbox, time) = (near.inbox.clone(), world.clone());
        let mut role = Recorder::sending(&[b"first", b"second", b"third"]);
        role.nothing_waits = Some(Rc::new(move || {
            let arrived = |&(at, _): &(u64, u8)| Instant::from_micros(at) <= time.now();
            !inbox.borrow().front().is_some_and(arrived)
        }));
        // The other end sends continuously.
        let mut count = 0_u8;
        world.add(move || {
            embedded_io::Write::write(&mut far, &[count]).unwrap();
            count = count.wrapping_add(1);
        });
        let mut driver = on(role, near);
        if is_async {
            world.block_on(driver.asynch().service()).unwrap();
        } else {
            world.step(20);
            world.step(20);
            driver.service().unwrap();
        }
        let received = &driver.role().received;
        assert!(!received.is_empty());
        assert!(received.iter().zip(0..).all(|(&byte, count)| byte == count), "{received:?}");
    }
}

#[test]
fn a_receiver_without_a_buffer_loses_nothing_while_the_sender_sends_byte_by_byte() {
    // Each byte sent makes one arrive, which is lost if it is not taken before the next one.
    let mut port = Port { most: 1, ..Port::default() };
    let (inbox, overruns) = (port.inbox.clone(), Rc::new(Cell::new(0)));
    let (lost, mut count) = (overruns.clone(), 0);
    port.peer = Some(Box::new(move |_, at_us| {
        lost.set(lost.get() + inbox.borrow().len());
        count += 1;
        vec![(at_us, count)]
    }));
    let mut driver = on(Recorder::sending(&[b"12345", b"678"]), port);
    driver.service().unwrap();
    assert_eq!((overruns.get(), &driver.port().written[..]), (0, &b"12345678"[..]));
    assert_eq!(driver.role().received, [1, 2, 3, 4, 5, 6, 7, 8]);
}

#[test]
fn reads_and_writes_of_every_size_move_every_byte_once() {
    let (incoming, outgoing): (Vec<u8>, Vec<u8>) = ((0..200).collect(), (0..60).rev().collect());
    for size in 1..=60 {
        for round in ROUNDS {
            let port = Port {
                reads: incoming.chunks(size).map(|chunk| Step::Bytes(chunk.into())).collect(),
                writes: vec![Step::Few(size); 200].into(),
                ..Port::default()
            };
            let mut driver = on(Recorder::sending(&[&outgoing, &outgoing]), port);
            // One round takes in 64 reads.
            for _ in 0..4 {
                assert_eq!(round(&mut driver), Some(Ok(())));
            }
            assert_eq!(driver.role().received, incoming, "reads of {size}");
            assert_eq!(driver.port().written, outgoing.repeat(2), "writes of {size}");
            assert!(driver.unsent().is_empty());
        }
    }
}

#[test]
fn a_round_is_bounded_whatever_the_port_and_the_role_do() {
    for round in ROUNDS {
        let flood = (0..2000).map(|_| bytes(64));
        let frames = vec![&b"frame"[..]; 1000];
        let mut driver = on(Recorder::sending(&frames), Port::reading(flood));
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!(driver.port().written.len(), 8 * 5);
        // 64 before each frame, plus those that arrive while it is sent.
        let reads = 2000 - driver.port().reads.len();
        assert!((8 * 64..=9 * 64).contains(&reads), "{reads}");
    }
}

#[test]
fn a_frame_too_large_for_a_driver_is_refused() {
    for round in ROUNDS {
        let mut driver = on(Recorder::sending(&[&[7; 65], &[8; 64]]), Port::default());
        let error = DriveError::FrameTooLong { length: 65, limit: 64 };
        assert_eq!(round(&mut driver), Some(Err(error)));
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!(driver.port().written, [8; 64]);
    }
}
