//! Under any calls, bytes and times a role keeps its contract.

use proptest::{collection::vec, prelude::*};

use crate::{
    calls::{call, perform, start},
    rig::*,
};

/// What a robot hears; or its driver calls it.
#[derive(Clone, Debug)]
enum Heard {
    /// Speed, turn, version.
    Command(i16, i16, u16),
    Ping,
    /// For this long, microseconds.
    Nothing(u32),
    Call,
}

fn heard() -> impl Strategy<Value = Heard> {
    let percent = || prop_oneof![2 => Just(0), 4 => -100..=100_i16, 1 => any::<i16>()];
    let version = prop_oneof![3 => Just(0), 1 => 0..60_u16];
    prop_oneof![
        4 => (percent(), percent(), version).prop_map(|(s, a, v)| Heard::Command(s, a, v)),
        1 => Just(Heard::Ping),
        3 => prop_oneof![0..30_000_u32, 0..700_000_u32].prop_map(Heard::Nothing),
        4 => Just(Heard::Call),
    ]
}

proptest! {
    #[test]
    fn a_robot_survives_any_calls_bytes_and_times(
        calls in vec(call(), 0..60),
        start in start(),
    ) {
        let mut now = us(start);
        let mut robot = Robot::new(RobotConfig::default(), now);
        for call in &calls {
            perform(&mut robot, call, &mut now, |robot, which, value, now| {
                match which % 4 {
                    0 => robot.set_telemetry(&Telemetry::default(), now),
                    1 => robot.calibration_result_imu(ImuBias::new([value; 3], [0; 3]), now),
                    2 => robot.calibration_result_mag(MagBias::new([value; 3]), now),
                    _ => { robot.answer_update(OtaStatus::Accepted, now); }
                }
            });
            let command = robot.command(now);
            prop_assert!(command.speed().abs() <= 100 && command.angular().abs() <= 100);
            prop_assert!(matches!(command.front_led(), 0 | 100));
            prop_assert_eq!(RawMotorControl::from(command).version(), 0);
        }
    }

    #[test]
    fn the_robot_stops_within_500_ms_of_the_last_valid_command(
        pauses in vec(0..900_u32, 1..40),
        noise in vec(any::<u8>(), 0..64),
        start in start(),
    ) {
        let mut now = us(start);
        let mut robot = quiet_robot_at(now);
        for (turn, pause) in pauses.into_iter().enumerate() {
            if turn % 3 == 0 {
                robot.handle_input(&noise, now);
                // A pause ends any frame that the noise has begun.
                now += Duration::from_millis(20);
                robot.handle_timeout(now);
                events(&mut robot);
            }
            robot.handle_input(&bytes(go(50)), now);
            let last = now;
            let end = now + Duration::from_millis(pause);
            while let Some(at) = robot.poll_timeout().filter(|&at| at <= end) {
                robot.handle_timeout(at);
                sent(&mut robot, at);
            }
            now = end;
            let moves = now < last + Duration::from_millis(500);
            prop_assert_eq!(robot.command(now).speed(), if moves { 50 } else { 0 });
            let stops = events(&mut robot).into_iter().filter(|e| *e == RobotEvent::Watchdog);
            prop_assert_eq!(stops.count(), usize::from(!moves));
        }
    }

    /// An out-of-range command counts, clamped; one that would start an update does not.
    #[test]
    fn a_robots_command_is_zero_500_ms_after_the_last_valid_one(
        acts in vec(heard(), 1..80),
        start in start(),
    ) {
        let mut now = us(start);
        let mut robot = quiet_robot_at(now);
        let mut last: Option<((i16, i16), Instant)> = None;
        for act in acts {
            match act {
                Heard::Command(speed, angular, version) => {
                    robot.handle_input(&careless(speed, angular, 0, version), now);
                    if version <= 38 {
                        last = Some(((speed.clamp(-100, 100), angular.clamp(-100, 100)), now));
                    }
                }
                Heard::Ping => robot.handle_input(&bytes(Ping {}), now),
                Heard::Nothing(micros) => now += Duration::from_micros(micros),
                Heard::Call => {
                    robot.handle_timeout(now);
                    sent(&mut robot, now);
                }
            }
            let valid = last.filter(|(_, at)| now - *at < Duration::from_millis(500));
            let expected = valid.map_or((0, 0), |it| it.0);
            let command = robot.command(now);
            prop_assert_eq!((command.speed(), command.angular()), expected);
        }
    }
}
