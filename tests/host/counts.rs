//! Counts: each event changes its own count by one and no other.

use crate::rig::*;

/// A host that has heard a robot, with nothing due but what a test asks for.
fn linked() -> Host<MemoryStore> {
    let mut host = Host::with_store(quiet_config(), MemoryStore::default(), ms(0));
    host.handle_input(&bytes(BiasRequest {}), ms(0));
    sent(&mut host, ms(0));
    events(&mut host);
    host
}

fn ack(kind: CalibrationKind, err: ErrorCode) -> Vec<u8> {
    bytes(CalibrationStartAck::new(kind, err))
}

#[test]
fn every_event_of_a_host_is_counted_once_and_in_one_place() {
    type Act = fn(&mut Host<MemoryStore>);
    type Count = fn(&mut HostStatistics) -> &mut u32;
    let table: [(&str, Act, &[Count]); 14] = [
        (
            "a command",
            |host| {
                host.drive(go(1), ms(1)).unwrap();
                sent(host, ms(1));
            },
            &[|it| &mut it.commands],
        ),
        (
            "the dead-man",
            |host| {
                host.drive(go(1), ms(1)).unwrap();
                host.handle_input(&bytes(BiasRequest {}), ms(300));
                host.handle_timeout(ms(501));
                host.handle_timeout(ms(502));
            },
            &[|it| &mut it.dead_man, |it| &mut it.bias_requests],
        ),
        ("a lost link", |host| host.handle_timeout(ms(500)), &[|it| &mut it.links_lost]),
        (
            "a pong that was not asked for",
            |host| host.handle_input(&bytes(Pong::new(ErrorCode::Damaged)), ms(1)),
            &[|it| &mut it.pongs_unasked],
        ),
        ("a report", |host| host.handle_input(&report(7), ms(1)), &[|it| &mut it.reports]),
        (
            "the same report again",
            |host| {
                host.handle_input(&report(7), ms(1));
                host.handle_input(&report(7), ms(2));
            },
            &[|it| &mut it.reports, |it| &mut it.reports, |it| &mut it.reports_repeated],
        ),
        (
            "a report after a lost one, over the wrap",
            |host| {
                host.handle_input(&report(255), ms(1));
                host.handle_input(&report(1), ms(2));
            },
            &[|it| &mut it.reports, |it| &mut it.reports, |it| &mut it.reports_lost],
        ),
        (
            "an acknowledgement that was not asked for",
            |host| host.handle_input(&ack(IMU, ErrorCode::Damaged), ms(1)),
            &[|it| &mut it.acks_unasked],
        ),
        (
            "a request that is sent again and then fails",
            |host| {
                host.start_calibration(IMU, ms(1)).unwrap();
                for at in 2..5 {
                    sent(host, ms(at));
                    host.handle_input(&ack(IMU, ErrorCode::Damaged), ms(at));
                }
                sent(host, ms(9));
            },
            &[
                |it| &mut it.calibration_retries,
                |it| &mut it.calibration_retries,
                |it| &mut it.calibration_failures,
            ],
        ),
        (
            "a result of each kind, and both again",
            |host| {
                for at in 1..3 {
                    host.handle_input(&bytes(imu_bias()), ms(at));
                    host.handle_input(&bytes(mag_bias()), ms(at));
                }
            },
            &[|it| &mut it.results_repeated, |it| &mut it.results_repeated],
        ),
        (
            "biases that are missing",
            |host| {
                host.handle_input(&bytes(BiasRequest {}), ms(1));
                sent(host, ms(1));
            },
            &[|it| &mut it.bias_requests],
        ),
        (
            "biases that are stored, sent the second time only",
            |host| {
                *host.store_mut() = MemoryStore { imu: Some(imu_bias()), mag: Some(mag_bias()) };
                host.handle_input(&bytes(BiasRequest {}), ms(1));
                host.poll_transmit(ms(1)).unwrap();
                host.handle_unsent(Unsent::Untouched, ms(1));
                sent(host, ms(1));
            },
            &[|it| &mut it.bias_requests, |it| &mut it.biases],
        ),
        (
            "an unknown frame",
            |host| {
                let mut buffer = [0; 64];
                let frame = RawFrame { id: 0x20, index: 0, body: &[1] };
                host.handle_input(frame.encode(&mut buffer).unwrap(), ms(1));
            },
            &[|it| &mut it.unknown],
        ),
        (
            "a frame of a host",
            |host| host.handle_input(&bytes(MotorControl::STOP), ms(1)),
            &[|it| &mut it.misdirected],
        ),
    ];
    for (name, act, counts) in table {
        let mut host = linked();
        let mut expected = *host.statistics();
        act(&mut host);
        counts.iter().for_each(|count| *count(&mut expected) += 1);
        assert_eq!(*host.statistics(), expected, "{name}");
    }
}

#[test]
fn every_ping_of_a_host_is_counted_as_sent_and_as_answered_damaged_or_lost() {
    let mut config = quiet_config();
    config.ping_period = Some(Duration::from_millis(200));
    let mut host = Host::new(config, ms(0));
    let mut expected = HostStatistics::default();
    assert!(is_ping(&sent(&mut host, ms(0))[0]));
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(9));
    assert!(is_ping(&wait(&mut host, ms(200))[0].1));
    host.handle_input(&bytes(Pong::new(ErrorCode::Damaged)), ms(203));
    assert!(is_ping(&wait(&mut host, ms(400))[0].1));
    let trips = host.statistics().round_trip;
    assert_eq!((trips.count(), trips.last()), (2, Some(Duration::from_millis(3))));
    assert_eq!((trips.min(), trips.max()), (trips.last(), Some(Duration::from_millis(9))));
    assert_eq!(trips.mean(), Some(Duration::from_millis(6)));
    (expected.pings, expected.pings_damaged, expected.round_trip) = (3, 1, trips);
    assert_eq!(*host.statistics(), expected);
    host.handle_input(&bytes(BiasRequest {}), ms(700));
    host.handle_timeout(us(899_999));
    expected.bias_requests = 1;
    assert_eq!(*host.statistics(), expected);
    host.handle_timeout(ms(900));
    expected.pings_lost = 1;
    assert_eq!(*host.statistics(), expected);
    // A ping that was due during the wait is due now, and not counted if it did not leave.
    host.poll_transmit(ms(900)).unwrap();
    host.handle_unsent(Unsent::CutOff, ms(900));
    assert_eq!(*host.statistics(), expected);
}
