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
    assert_counted! {
        linked();
        "a command": commands => |host| {
            host.drive(go(1), ms(1)).unwrap();
            sent(host, ms(1));
        }
        "the dead-man": dead_man, bias_requests => |host| {
            host.drive(go(1), ms(1)).unwrap();
            host.handle_input(&bytes(BiasRequest {}), ms(300));
            host.handle_timeout(ms(501));
            host.handle_timeout(ms(502));
        }
        "a lost link": links_lost => |host| {
            host.handle_timeout(ms(500));
        }
        "a pong that was not asked for": pongs_unasked => |host| {
            host.handle_input(&bytes(Pong::new(ErrorCode::Damaged)), ms(1));
        }
        "a report": reports => |host| {
            host.handle_input(&report(7), ms(1));
        }
        "the same report again": reports, reports, reports_repeated => |host| {
            host.handle_input(&report(7), ms(1));
            host.handle_input(&report(7), ms(2));
        }
        "a report after a lost one, over the wrap": reports, reports, reports_lost => |host| {
            host.handle_input(&report(255), ms(1));
            host.handle_input(&report(1), ms(2));
        }
        "an acknowledgement that was not asked for": acks_unasked => |host| {
            host.handle_input(&ack(IMU, ErrorCode::Damaged), ms(1));
        }
        "a request that is sent again and then fails":
            calibration_retries, calibration_retries, calibration_failures
        => |host| {
            host.start_calibration(IMU, ms(1)).unwrap();
            for at in 2..5 {
                sent(host, ms(at));
                host.handle_input(&ack(IMU, ErrorCode::Damaged), ms(at));
            }
            sent(host, ms(9));
        }
        "a result of each kind, and both again": results_repeated, results_repeated => |host| {
            for at in 1..3 {
                host.handle_input(&bytes(imu_bias()), ms(at));
                host.handle_input(&bytes(mag_bias()), ms(at));
            }
        }
        "biases that are missing": bias_requests => |host| {
            host.handle_input(&bytes(BiasRequest {}), ms(1));
            sent(host, ms(1));
        }
        "biases that are stored, sent the second time only": bias_requests, biases => |host| {
            *host.store_mut() = MemoryStore { imu: Some(imu_bias()), mag: Some(mag_bias()) };
            host.handle_input(&bytes(BiasRequest {}), ms(1));
            host.poll_transmit(ms(1)).unwrap();
            host.handle_transmit(Unsent::Untouched, ms(1));
            sent(host, ms(1));
        }
        "an unknown frame": unknown => |host| {
            let mut buffer = [0; 64];
            let frame = RawFrame { id: 0x20, index: 0, body: &[1] };
            host.handle_input(frame.encode(&mut buffer).unwrap(), ms(1));
        }
        "a frame of a host": misdirected => |host| {
            host.handle_input(&bytes(MotorControl::STOP), ms(1));
        }
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
    host.handle_transmit(Unsent::CutOff, ms(900));
    assert_eq!(*host.statistics(), expected);
}
