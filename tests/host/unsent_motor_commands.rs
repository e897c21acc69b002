//! Motor commands and stops that did not reach the line: due again at once, twice after a cut-off
//! frame or a failed flush, and never too late (U16).

use crate::rig::*;

#[test]
fn a_failed_write_or_a_discarded_stop_makes_the_stop_due_again() {
    for unsent in EVERY {
        let mut host = driven(begun(), 40, 30);
        assert_eq!(sent(&mut host, ms(30)).len(), 1);
        host.stop(ms(31));
        assert_eq!(host.poll_transmit(ms(31)).and_then(speed), Some(0));
        host.handle_transmit(unsent, ms(40));
        let frames = sent(&mut host, ms(40));
        assert_eq!(frames.len(), copies(unsent), "{unsent:?}");
        assert!(frames.iter().all(|frame| speed(frame) == Some(0)));
        assert_eq!(host.poll_timeout(), Some(ms(140)), "and then every 100 ms");
    }
}

#[test]
fn an_old_command_is_never_sent_late() {
    for unsent in EVERY {
        let mut host = driven(begun(), 40, 30);
        assert_eq!(host.poll_transmit(ms(30)).and_then(speed), Some(40));
        host.stop(ms(35));
        host.handle_transmit(unsent, ms(36));
        assert!(sent(&mut host, ms(36)).iter().all(|frame| speed(frame) == Some(0)), "{unsent:?}");

        let mut host = driven(begun(), 40, 30);
        assert_eq!(host.poll_transmit(ms(30)).and_then(speed), Some(40));
        host.handle_transmit(unsent, ms(5000));
        host.handle_timeout(ms(5000));
        let frames = sent(&mut host, ms(5000));
        assert!(!frames.is_empty());
        assert!(frames.iter().all(|frame| speed(frame) == Some(0)), "the dead-man has fired");
    }
}

#[test]
fn behind_a_frame_that_was_cut_off_every_motor_command_goes_twice() {
    let mut host = driven(begun(), 40, 30);
    sent(&mut host, ms(30));
    host.handle_transmit(Unsent::CutOff, ms(32));
    let frames = sent(&mut host, ms(32));
    assert_eq!(frames.iter().filter_map(|frame| speed(frame)).collect::<Vec<_>>(), [40, 40]);
}

#[test]
fn both_frames_after_a_cut_off_one_are_sent_at_once_even_if_the_command_changes_in_between() {
    let mut host = driven(begun(), 10, 20);
    sent(&mut host, ms(20));
    host.handle_transmit(Unsent::CutOff, ms(30));
    assert_eq!(host.poll_transmit(ms(30)).and_then(speed), Some(10));
    host.drive(go(40), ms(30)).unwrap();
    assert_eq!(host.poll_transmit(ms(30)).and_then(speed), Some(40));
    assert_eq!(host.poll_transmit(ms(30)), None);
}

#[test]
fn a_stop_that_was_taken_back_is_not_sent_until_it_is_handed_out_again() {
    for unsent in EVERY {
        let mut host = begun();
        host.stop(ms(10));
        assert!(!host.is_stop_sent());
        sent(&mut host, ms(20));
        assert!(host.is_stop_sent());
        host.handle_transmit(unsent, ms(20));
        assert!(!host.is_stop_sent(), "{unsent:?}");
        for copy in 1..=copies(unsent) {
            assert_eq!(host.poll_transmit(ms(20)).and_then(speed), Some(0));
            assert_eq!(host.is_stop_sent(), copy == copies(unsent), "{unsent:?}");
        }
        assert_eq!(host.poll_transmit(ms(20)), None);
    }
}

#[test]
fn a_stop_requested_after_the_failure_is_sent_at_once_and_alone() {
    for unsent in EVERY {
        let mut host = driven(begun(), 40, 30);
        sent(&mut host, ms(30));
        host.handle_transmit(unsent, ms(35));
        host.stop(ms(36));
        let frames = sent(&mut host, ms(36));
        assert_eq!(frames.len(), copies(unsent));
        assert!(frames.iter().all(|frame| speed(frame) == Some(0)), "{unsent:?}");
        assert!(host.is_stop_sent());
    }
}

#[test]
fn the_first_frame_is_zero_however_often_it_does_not_reach_the_line() {
    for unsent in EVERY {
        let mut host = fresh_host();
        host.drive(go(40), ms(0)).unwrap();
        for at in 0..10 {
            assert_eq!(host.poll_transmit(ms(at)).and_then(speed), Some(0), "{unsent:?}");
            host.handle_transmit(unsent, ms(at));
        }
        let speeds: Vec<_> = sent(&mut host, ms(10)).iter().filter_map(|it| speed(it)).collect();
        assert_eq!(speeds, [&vec![0; copies(unsent)][..], &[40]].concat(), "{unsent:?}");
    }
}

#[test]
fn a_first_frame_that_may_not_have_been_flushed_comes_first_again() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    let ids: Vec<_> = sent(&mut host, ms(0)).iter().map(|frame| frame[4]).collect();
    assert_eq!(ids, [2, 1]);
    host.drive(go(40), ms(1)).unwrap();
    host.handle_transmit(Unsent::Unflushed, ms(2));
    let speeds = |host: &mut Host, now| -> Vec<_> {
        sent(host, now).iter().filter_map(|frame| speed(frame)).collect()
    };
    assert_eq!(speeds(&mut host, ms(2)), [0, 0, 40]);
    // The flush may fail repeatedly.
    host.handle_transmit(Unsent::Unflushed, ms(3));
    assert_eq!(speeds(&mut host, ms(3)), [0, 0, 40]);
    // The next round shows that it was flushed.
    assert_eq!(speeds(&mut host, ms(103)), [40]);
    host.handle_transmit(Unsent::Unflushed, ms(104));
    assert_eq!(speeds(&mut host, ms(104)), [40, 40]);
}

#[test]
fn the_first_frame_is_zero_even_when_its_flush_and_that_of_a_command_fail() {
    let mut host = fresh_host();
    host.drive(go(60), ms(0)).unwrap();
    for at in 0..5 {
        for _ in 0..if at == 0 { 1 } else { 2 } {
            assert_eq!(host.poll_transmit(ms(at)).and_then(speed), Some(0));
        }
        assert_eq!(host.poll_transmit(ms(at)).and_then(speed), Some(60));
        // Nothing of either has left, or the robot has received both.
        host.handle_transmit(Unsent::Unflushed, ms(at));
    }
    // A command refused by the port is not the first frame, which the port did take.
    assert_eq!(host.poll_transmit(ms(5)).and_then(speed), Some(0));
    assert_eq!(host.poll_transmit(ms(5)).and_then(speed), Some(0));
    assert_eq!(host.poll_transmit(ms(5)).and_then(speed), Some(60));
    host.handle_transmit(Unsent::Untouched, ms(5));
    assert_eq!(host.poll_transmit(ms(5)).and_then(speed), Some(60));
}

#[test]
fn the_first_frame_is_due_again_if_its_flush_was_dropped_and_its_port_replaced() {
    for is_flushed in [false, true] {
        let mut host = fresh_host();
        assert_eq!(host.poll_transmit(ms(0)).and_then(speed), Some(0));
        host.handle_transmit(Transmit::Taken, ms(0));
        assert_eq!(host.poll_transmit(ms(0)), None);
        if is_flushed {
            host.handle_transmit(Transmit::Flushed, ms(1));
        }
        host.drive(go(60), ms(30)).unwrap();
        assert_eq!(host.poll_transmit(ms(30)).and_then(speed), Some(60));
        host.handle_transmit(Transmit::Taken, ms(30));
        host.handle_transmit(Unsent::Unflushed, ms(31));
        let first = host.poll_transmit(ms(31)).and_then(speed);
        assert_eq!(first, Some(if is_flushed { 60 } else { 0 }));
    }
}

#[test]
fn a_spurious_unsent_only_repeats_the_motor_command() {
    let mut host = begun();
    host.handle_transmit(Unsent::Untouched, ms(1));
    host.handle_transmit(Unsent::Untouched, ms(1));
    let frames = sent(&mut host, ms(1));
    assert_eq!((frames.len(), frames[0][4], frames[0][5]), (1, 2, 0));
    let mut robot = quiet_robot();
    robot.handle_transmit(Unsent::CutOff, ms(1));
    assert_eq!((sent(&mut robot, ms(1)), robot.poll_timeout()), (vec![], None));
}

/// A receiver that takes the following bytes for the rest of a cut-off frame, as shipped robots do.
/// It does not search rejected bytes.
fn heard_by_a_simple_receiver(line: &[u8]) -> Vec<Vec<u8>> {
    let (mut at, mut frames) = (0, Vec::new());
    while let Some(start) = line.get(at..).and_then(|rest| rest.first_chunk::<5>()) {
        if start[..2] != [0xFD, 0xFF] {
            at += 1;
            continue;
        }
        if start[2] > 60 || start[3] > 0 || !(1..=10).contains(&start[4]) {
            at += start.len();
            continue;
        }
        let Some(frame) = line.get(at..at + usize::from(start[2]) + 4) else { break };
        if Frame::parse(frame).is_ok() {
            frames.push(frame.to_vec());
        }
        at += frame.len();
    }
    frames
}

#[test]
fn behind_any_frame_that_was_cut_off_or_not_flushed_a_stop_reaches_a_simple_receiver() {
    // The longest frame of a host, a motor command and the shortest frame, cut at every byte.
    for frame in [
        bytes(Biases::new(imu_bias(), mag_bias())),
        go(90).frame(0xFD).as_bytes().to_vec(),
        bytes(Ping {}),
    ] {
        for (cut, unsent) in
            (2..frame.len()).flat_map(|cut| [(cut, Unsent::CutOff), (cut, Unsent::Unflushed)])
        {
            let mut host = begun();
            host.stop(ms(1));
            host.handle_transmit(unsent, ms(1));
            let stops = sent(&mut host, ms(1)).concat();
            let heard = heard_by_a_simple_receiver(&[&frame[..cut], &stops].concat());
            let last = heard.last().unwrap_or_else(|| panic!("{cut}: nothing"));
            assert_eq!(speed(last), Some(0), "cut off after {cut} bytes");
        }
    }
}

#[test]
fn the_two_copies_behind_a_frame_that_was_cut_off_count_once_they_are_flushed() {
    let cut = || {
        let mut host = driven(begun(), 40, 30);
        assert_eq!(host.poll_transmit(ms(30)).and_then(speed), Some(40));
        host.handle_transmit(Unsent::CutOff, ms(31));
        host.stop(ms(31));
        assert_eq!(host.poll_transmit(ms(31)).and_then(speed), Some(0), "the first copy");
        host
    };
    let copies = |host: &mut Host, at| {
        assert!(!host.is_stop_sent());
        sent(host, at).iter().filter(|frame| speed(frame) == Some(0)).count()
    };
    // The port refuses the second, and may have lost the first.
    let mut host = cut();
    assert_eq!(host.poll_transmit(ms(31)).and_then(speed), Some(0));
    host.handle_transmit(Unsent::Untouched, ms(32));
    host.handle_transmit(Unsent::Unflushed, ms(32));
    assert_eq!(copies(&mut host, ms(33)), 2);
    // It may have lost both, along with the frames after them.
    let mut host = cut();
    assert_eq!(host.poll_transmit(ms(31)).and_then(speed), Some(0));
    host.set_network_state(NetworkState::Connected, ms(32)).unwrap();
    sent(&mut host, ms(32));
    host.handle_transmit(Unsent::Unflushed, ms(33));
    assert_eq!(copies(&mut host, ms(33)), 2);
    // Both have left; the port has only refused a later frame.
    let mut host = cut();
    sent(&mut host, ms(31));
    sent(&mut host, ms(40));
    host.stop(ms(50));
    sent(&mut host, ms(50));
    host.handle_transmit(Unsent::Untouched, ms(50));
    assert_eq!(copies(&mut host, ms(51)), 1);
}

#[test]
fn the_rest_of_a_command_is_outdated_by_a_stop_although_a_flush_has_failed_meanwhile() {
    let mut host = driven(begun(), 60, 30);
    assert_eq!(host.poll_transmit(ms(30)).and_then(speed), Some(60));
    // Of its bytes the port has taken some, and has not flushed them.
    host.handle_transmit(Unsent::Unflushed, ms(31));
    assert!(!host.is_outdated());
    host.stop(ms(32));
    assert!(host.is_outdated(), "so a driver gives it up");
    host.handle_transmit(Unsent::CutOff, ms(32));
    let frames = sent(&mut host, ms(32));
    assert_eq!(frames.iter().map(|frame| speed(frame)).collect::<Vec<_>>(), [Some(0); 2]);
    let indices: Vec<_> = frames.iter().map(|frame| frame[5]).collect();
    assert_eq!(indices, [1, 2], "the index of the command is used again");
}

#[test]
fn the_first_of_two_copies_that_the_port_did_not_touch_goes_twice_again() {
    for unsent in EVERY {
        let mut host = driven(begun(), 40, 30);
        sent(&mut host, ms(30));
        host.stop(ms(31));
        host.handle_transmit(Unsent::CutOff, ms(32));
        assert_eq!(speed(host.poll_transmit(ms(32)).unwrap()), Some(0));
        assert!(!host.is_stop_sent(), "one of two");
        host.handle_transmit(unsent, ms(33));
        let frames = sent(&mut host, ms(33));
        assert_eq!(frames.iter().filter_map(|it| speed(it)).collect::<Vec<_>>(), [0, 0]);
        assert!(host.is_stop_sent());
    }
}
