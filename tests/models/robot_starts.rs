//! The worlds of a robot, and their initial states.

use super::{
    names::*,
    robot::{Act, Call::*, Hear, RobotSide, Rover},
    site,
};

type Menu = site::Menu<RobotSide>;

const IMU: CalibrationKind = CalibrationKind::Imu;
const MAG: CalibrationKind = CalibrationKind::Magnetometer;

const DONE: Act = Act::DONE;

/// Motor commands of all kinds, damaged, old and in halves, and frames that must not count as one.
const MOTION: Menu = &[
    &Act::hears([Hear::Motor(1), Hear::Motor(2), Hear::Motor(3), Hear::Motor(4)]),
    &Act::hears([Hear::MotorUpdate, Hear::DamagedMotor, Hear::Ping, Hear::Unknown, Hear::Echo]),
    &Act::hears([Hear::Front, Hear::Rest, Hear::LongFront]),
    &Act::calls([HearOld(Hear::Motor(1)), TakeCommand, TakeEvents]),
    &[Act::Wait(1_000), Act::Wait(300_000), Act::Wait(500_000), Act::Wait(10_000_000)],
    &[DONE, Act::ToDeadline(0), Act::ToDeadline(1), Act::Run(499), Act::Run(600)],
];

/// Everything that a host can request, and every fate of the answers.
const ANSWERS: Menu = &[
    Act::FATES,
    &Act::hears([Hear::Motor(2), Hear::MotorUpdate, Hear::Ping, Hear::Start(IMU)]),
    &Act::hears([Hear::Start(MAG), Hear::End(IMU), Hear::End(MAG), Hear::MagAck]),
    &Act::hears([Hear::ImuAck(ErrorCode::Fine), Hear::ImuAck(ErrorCode::Damaged)]),
    &Act::hears([Hear::Biases, Hear::Update, Hear::Show(3)]),
    &Act::calls([Telemetry(50), Telemetry(49), Imu(1), Imu(2), Mag(1), Abort]),
    &Act::calls([AnswerUpdate(OtaStatus::Forbidden)]),
    &[Act::TakeEvent, Act::Fail(Unsent::CutOff), Act::Wait(45_000)],
    &[Act::ToDeadline(0), Act::ToDeadline(1), Act::Run(1_100)],
];

fn rover(menu: Menu) -> Rover {
    Rover::new(RobotConfig::default(), menu)
}

/// A robot that requests nothing.
fn quiet(menu: Menu) -> Rover {
    let mut config = RobotConfig::default();
    config.bias_request_period = None;
    Rover::new(config, menu)
}

/// A queue with room for this many more events.
fn full(room: usize) -> Rover {
    let mut rover = rover(ANSWERS).undrained();
    for number in 0..16 - room {
        let kind = if number % 2 == 0 { IMU } else { MAG };
        rover = rover.after(&[Act::Hear(Hear::Start(kind)), DONE]);
    }
    rover
}

pub(crate) fn motion(run: &mut Run) {
    run.world("fresh", Depth(2, 5), quiet(MOTION));
    let driving = [Act::Hear(Hear::Motor(1)), Act::Call(TakeCommand), DONE];
    run.world("driving", Depth(3, 5), quiet(MOTION).after(&driving));
    let changes = [Act::Hear(Hear::Motor(1)), Act::Hear(Hear::Motor(2))].repeat(6);
    let left = quiet(MOTION).undrained().after(&changes);
    run.world("events are left", Depth(2, 5), left);
}

pub(crate) fn answers(run: &mut Run) {
    run.world("fresh", Depth(2, 4), rover(ANSWERS));
    let reporting = [Act::Call(Telemetry(50)), Act::Hear(Hear::Start(IMU)), DONE];
    run.world("calibrating", Depth(2, 4), rover(ANSWERS).after(&reporting));
    let results = [Act::Call(Imu(1)), Act::Call(Mag(1)), DONE];
    run.world("results", Depth(2, 4), rover(ANSWERS).after(&reporting).after(&results));
    let due = [Hear::Ping, Hear::Start(IMU), Hear::End(IMU), Hear::End(MAG)].map(Act::Hear);
    run.world("answers are due", Depth(2, 4), rover(ANSWERS).after(&[DONE]).after(&due));
    let asked = [Act::Hear(Hear::Update), DONE];
    run.world("an update is requested", Depth(2, 4), rover(ANSWERS).after(&asked));
}

pub(crate) fn queues(run: &mut Run) {
    run.world("full", Depth(2, 4), full(0));
    run.world("room for one", Depth(2, 4), full(1));
    run.world(
        "full, with results",
        Depth(2, 4),
        full(0).after(&[Act::Call(Imu(1)), Act::Call(Mag(1)), DONE]),
    );
}
