//! Whatever happens, the command is zero 500 ms after the last sign of life of either end (U16).

use proptest::{collection::vec, prelude::*};

use crate::{calls::start, rig::*};

/// The fate of a frame that is handed out.
#[derive(Clone, Copy, Debug)]
enum Fate {
    Sent,
    Unsent(Unsent, usize),
}

fn fate() -> impl Strategy<Value = Fate> {
    prop_oneof![
        4 => Just(Fate::Sent),
        1 => Just(Fate::Unsent(Unsent::Untouched, 0)),
        1 => (1..27_usize).prop_map(|cut| Fate::Unsent(Unsent::CutOff, cut)),
        // All of it, or nothing, has left.
        1 => prop_oneof![Just(0), Just(64)]
            .prop_map(|cut| Fate::Unsent(Unsent::Unflushed, cut)),
    ]
}

#[derive(Clone, Debug)]
enum Act {
    Drive(i16, i16),
    Stop,
    Sleep(u32),
    /// One round of a driver, with the fates of its frames.
    Round(Vec<Fate>),
    /// The robot sends something.
    Hear(u8),
}

fn act() -> impl Strategy<Value = Act> {
    let percent = || prop_oneof![Just(0), -100..=100_i16];
    prop_oneof![
        2 => (percent(), percent()).prop_map(|(speed, angular)| Act::Drive(speed, angular)),
        1 => Just(Act::Stop),
        3 => prop_oneof![0..30_000_u32, 0..700_000_u32].prop_map(Act::Sleep),
        4 => vec(fate(), 0..6).prop_map(Act::Round),
        1 => (0..5_u8).prop_map(Act::Hear),
    ]
}

fn said(which: u8) -> Vec<u8> {
    match which {
        0 => bytes(Pong::new(ErrorCode::Fine)),
        1 => bytes(imu_bias()),
        2 => bytes(BiasRequest {}),
        3 => bytes(CalibrationStartAck::new(IMU, ErrorCode::Fine)),
        _ => bytes(FirmwareReport::new(&Telemetry::default(), 38)),
    }
}

/// Speed and turn of a motor command.
fn motion(frame: &[u8]) -> Option<(i16, i16)> {
    match message(frame) {
        Message::MotorControl(command) => Some((command.speed(), command.angular())),
        _ => None,
    }
}

const TIMEOUT: Duration = Duration::from_millis(500);

proptest! {
    /// Every frame handed out is zero, or the application's last command if less than 500 ms old,
    /// from a host that has heard the robot in the last 500 ms; and after every round on a working
    /// line, so is the command that the robot has.
    #[test]
    fn a_hosts_command_is_zero_500_ms_after_the_applications_last_call_or_the_robots_last_frame(
        acts in vec(act(), 1..80),
        start in start(),
        pings in any::<bool>(),
    ) {
        let mut now = us(start);
        let mut config = HostConfig::default();
        config.ping_period = config.ping_period.filter(|_| pings);
        let mut host = Host::new(config, now);
        let mut wanted = ((0, 0), now);
        let (mut heard, mut is_lost, mut is_first) = (now, false, true);
        for act in acts {
            match act {
                Act::Drive(speed, angular) => {
                    let driven = host.drive(MotorControl::new(speed, angular).unwrap(), now);
                    prop_assert_eq!(driven.is_err(), is_lost && (speed, angular) != (0, 0));
                    if driven.is_ok() {
                        wanted = ((speed, angular), now);
                    }
                }
                Act::Stop => {
                    host.stop(now);
                    wanted = ((0, 0), now);
                }
                Act::Sleep(micros) => now += Duration::from_micros(micros),
                Act::Hear(which) => {
                    host.handle_input(&said(which), now);
                    (heard, is_lost) = (now, false);
                }
                Act::Round(fates) => {
                    host.handle_timeout(now);
                    if now - heard >= TIMEOUT {
                        (wanted.0, is_lost) = ((0, 0), true);
                    }
                    let mut fates = fates.into_iter();
                    let (mut told, mut failed) = (None, false);
                    while let Some(frame) = host.poll_transmit(now).map(<[u8]>::to_vec) {
                        let is_old = now - wanted.1 >= TIMEOUT;
                        if is_first {
                            prop_assert_eq!(motion(&frame), Some((0, 0)), "the first frame");
                        }
                        if let Some(motion) = motion(&frame) {
                            prop_assert!(motion == (0, 0) || (motion == wanted.0 && !is_old));
                            told = Some(motion);
                        }
                        match fates.next().unwrap_or(Fate::Sent) {
                            Fate::Sent => is_first = false,
                            Fate::Unsent(unsent, left) => {
                                host.handle_unsent(unsent, now);
                                is_first &= !(unsent == Unsent::Unflushed && left > 0);
                                failed = true;
                            }
                        }
                    }
                    // Once everything is out, the robot has the newest stop.
                    let is_old = now - wanted.1 >= TIMEOUT;
                    if wanted.0 == (0, 0) || is_old {
                        prop_assert!(host.is_stop_sent());
                        prop_assert!(!failed || told == Some((0, 0)));
                    } else {
                        prop_assert!(!host.is_stop_sent() || told.is_none_or(|it| it == (0, 0)));
                    }
                }
            }
            // Never waits past an owed frame.
            if now - wanted.1 >= TIMEOUT && wanted.0 != (0, 0) {
                prop_assert!(
                    host.is_stop_sent() || host.poll_timeout().is_some_and(|at| at <= now)
                );
            }
        }
    }

    /// A robot receives the rest of the frames. Once the line works again and the application has
    /// requested a stop, one round and the time on the wire are enough.
    #[test]
    fn after_any_failures_a_stop_reaches_the_robot_in_one_round(
        acts in vec(act(), 1..60),
        start in start(),
        wait in 0..100_000_u32,
    ) {
        let mut now = us(start);
        let mut host = Host::new(HostConfig::default(), now);
        let mut robot = quiet_robot_at(now);
        for act in acts {
            match act {
                Act::Drive(speed, angular) => {
                    // Refused while the robot is not heard.
                    let _ = host.drive(MotorControl::new(speed, angular).unwrap(), now);
                }
                Act::Stop => host.stop(now),
                Act::Sleep(micros) => now += Duration::from_micros(micros),
                Act::Hear(which) => host.handle_input(&said(which), now),
                Act::Round(fates) => {
                    host.handle_timeout(now);
                    let mut fates = fates.into_iter();
                    while let Some(frame) = host.poll_transmit(now).map(<[u8]>::to_vec) {
                        match fates.next().unwrap_or(Fate::Sent) {
                            Fate::Sent => robot.handle_input(&frame, now),
                            Fate::Unsent(unsent, left) => {
                                robot.handle_input(&frame[..left.min(frame.len())], now);
                                host.handle_unsent(unsent, now);
                            }
                        }
                    }
                }
            }
        }
        host.stop(now);
        now += Duration::from_micros(wait);
        host.handle_timeout(now);
        while let Some(frame) = host.poll_transmit(now).map(<[u8]>::to_vec) {
            robot.handle_input(&frame, now);
        }
        prop_assert!(host.is_stop_sent());
        // A cut-off frame delays the following ones no longer than the quiet margin.
        now += Duration::from_millis(6);
        robot.handle_timeout(now);
        let command = robot.command(now);
        prop_assert_eq!((command.speed(), command.angular()), (0, 0));
    }
}
