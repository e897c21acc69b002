//! A round of a driver, over any role: what is done in which order, and that it ends.

use axlewire::{
    drive::{DriveError, Driver},
    time::Instant,
};

use crate::{
    port::{Script, Step, Unplugged},
    recorder::{Call, ROUNDS, Recorder, at_ms, bytes, scripted},
    virtual_time::{End, VirtualClock, World},
};

#[test]
fn a_round_takes_in_then_lets_time_pass_then_sends_and_flushes_once() {
    for round in ROUNDS {
        let mut role = Recorder::sending(&[b"one", b"two"]);
        role.timeout = Some(at_ms(0));
        let mut driver = scripted(role, Script::reading([Step::Bytes(b"in".into())]));
        assert_eq!(round(&mut driver), Some(Ok(())));
        let expected = [
            Call::Input(b"in".into()),
            Call::Timeout,
            Call::Transmit(Some(b"one".into())),
            Call::Transmit(Some(b"two".into())),
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
    for is_async in [false, true] {
        let world = World::default();
        let mut port = End::new(&world, 20);
        // Only the write of the last part takes the frame.
        (port.stalls_us, port.most) = ([3000, 4000], 2);
        let role = Recorder::sending(&[b"123", b"45"]);
        let mut driver = Driver::new(role, port, VirtualClock(world.clone()));
        let sent = if is_async { world.block_on(driver.service_async()) } else { driver.service() };
        assert_eq!(sent, Ok(()));
        assert_eq!(driver.role().taken_at, [3, 3].map(at_ms), "async {is_async}");
        assert_eq!(driver.role().flushed_at, [7].map(at_ms), "async {is_async}");
    }
}

#[test]
fn timeouts_are_handled_only_when_the_role_has_requested_them() {
    for round in ROUNDS {
        let mut role = Recorder::default();
        role.timeout = Some(at_ms(1));
        let world = World::default();
        let mut driver = Driver::new(role, Script::default(), VirtualClock(world.clone()));
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
    for is_async in [false, true] {
        let world = World::default();
        let (mut near, mut far) = End::pair(&world, 20);
        (near.most, near.stutters) = (1, true);
        let (inbox, time) = (near.inbox.clone(), world.clone());
        let mut role = Recorder::sending(&[b"first", b"second", b"third"]);
        role.nothing_waits = Some(std::rc::Rc::new(move || {
            let arrived = |&(at, _): &(u64, u8)| Instant::from_micros(at) <= time.now();
            !inbox.borrow().front().is_some_and(arrived)
        }));
        // The other end sends continuously.
        let mut count = 0_u8;
        world.add(move || {
            embedded_io::Write::write(&mut far, &[count]).unwrap();
            count = count.wrapping_add(1);
        });
        let mut driver = Driver::new(role, near, VirtualClock(world.clone()));
        if is_async {
            world.block_on(driver.service_async()).unwrap();
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
    /// Sends and receives one byte at a time, and loses a byte not taken before the next one: a
    /// model of a UART without a buffer. The scripted port keeps its bytes as long as necessary.
    #[derive(Default)]
    struct Bufferless {
        held: Option<u8>,
        count: u8,
        overruns: usize,
    }
    impl embedded_io::ErrorType for Bufferless {
        type Error = Unplugged;
    }
    impl embedded_io::ReadReady for Bufferless {
        fn read_ready(&mut self) -> Result<bool, Unplugged> {
            Ok(self.held.is_some())
        }
    }
    impl embedded_io::Read for Bufferless {
        fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
            buffer[0] = self.held.take().unwrap();
            Ok(1)
        }
    }
    impl embedded_io::Write for Bufferless {
        fn write(&mut self, _: &[u8]) -> Result<usize, Unplugged> {
            self.overruns += usize::from(self.held.replace(self.count).is_some());
            self.count += 1;
            Ok(1)
        }
        fn flush(&mut self) -> Result<(), Unplugged> {
            Ok(())
        }
    }
    let role = Recorder::sending(&[b"12345", b"678"]);
    let mut driver = Driver::new(role, Bufferless::default(), VirtualClock(World::default()));
    driver.service().unwrap();
    assert_eq!((driver.port().overruns, driver.port().count), (0, 8));
    assert_eq!(driver.role().received, [0, 1, 2, 3, 4, 5, 6, 7]);
}

#[test]
fn reads_and_writes_of_every_size_move_every_byte_once() {
    let (incoming, outgoing): (Vec<u8>, Vec<u8>) = ((0..200).collect(), (0..60).rev().collect());
    for size in 1..=60 {
        for round in ROUNDS {
            let port = Script {
                reads: incoming.chunks(size).map(|chunk| Step::Bytes(chunk.into())).collect(),
                writes: (0..200).map(|_| bytes(size)).collect(),
                ..Script::default()
            };
            let mut driver = scripted(Recorder::sending(&[&outgoing, &outgoing]), port);
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
        let mut driver = scripted(Recorder::sending(&frames), Script::reading(flood));
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
        let mut driver = scripted(Recorder::sending(&[&[7; 65], &[8; 64]]), Script::default());
        let error = DriveError::FrameTooLong { length: 65, limit: 64 };
        assert_eq!(round(&mut driver), Some(Err(error)));
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!(driver.port().written, [8; 64]);
    }
}
