//! The worlds of a host, and their initial states.

use super::{
    host::{Act, Call::*, Hear, HostSide, Site},
    names::*,
    site,
};

type Menu = site::Menu<HostSide>;

const IMU: CalibrationKind = CalibrationKind::Imu;
const MAG: CalibrationKind = CalibrationKind::Magnetometer;
const START: CalibrationStep = CalibrationStep::Start;
const END: CalibrationStep = CalibrationStep::End;

const DONE: Act = Act::DONE;

/// Everything that moves the robot, and every fate of the frames.
const MOTION: Menu = &[
    Act::FATES,
    &Act::calls([Go(1), Go(2), Go(3), Stop]),
    &[Act::Fail(Unsent::CutOff), Act::Wait(1_000), Act::Wait(500_000), Act::Wait(10_000_000)],
    &[Act::ToDeadline(0), Act::ToDeadline(1), Act::Run(450), Act::Run(1_100)],
];

/// A firmware update, among commands and answers.
const UPDATE: Menu = &[
    Act::FATES,
    &Act::calls([Go(1), Stop, Update, EndUpdate, Calibrate(START, IMU), Show(3)]),
    &Act::hears([
        Hear::UpdateAnswer(OtaStatus::Accepted),
        Hear::UpdateAnswer(OtaStatus::Forbidden),
    ]),
    &Act::hears([Hear::BiasRequest, Hear::Report, Hear::Imu(1)]),
    &[Act::Fail(Unsent::CutOff), Act::ToDeadline(0), Act::Run(600), Act::Run(3_000)],
];

/// Calibrations, results and biases, with all kinds of answers.
const CALIBRATION: Menu = &[
    Act::FATES,
    &Act::calls([Go(2), Calibrate(START, IMU), Calibrate(START, MAG), Calibrate(END, IMU)]),
    &Act::hears([
        Hear::StartAck(IMU, ErrorCode::Fine),
        Hear::StartAck(IMU, ErrorCode::Damaged),
        Hear::StartAck(MAG, ErrorCode::Fine),
        Hear::EndAck(IMU),
    ]),
    &Act::hears([Hear::Imu(1), Hear::Imu(2), Hear::Mag(1), Hear::BiasRequest, Hear::Pong]),
    &Act::hears([Hear::Unknown, Hear::Damaged, Hear::Echo]),
    &Act::calls([Show(3), Show(1), SetStore(true), SetStore(false)]),
    &[Act::TakeEvent, Act::Wait(500_000), Act::ToDeadline(0), Act::ToDeadline(1), Act::Run(700)],
];

/// Frames in halves, among whole ones.
const HALVES: Menu = &[
    &Act::hears([Hear::Front, Hear::Rest, Hear::Imu(2), Hear::Pong, Hear::Damaged]),
    &Act::hears([Hear::StartAck(IMU, ErrorCode::Fine)]),
    &Act::calls([Go(1), Calibrate(START, IMU)]),
    &[DONE, Act::ToDeadline(0), Act::Wait(1_000)],
];

fn site(menu: Menu) -> Site {
    Site::new(HostConfig::default(), false, menu)
}

/// A host that only listens until it is called.
fn listening(menu: Menu) -> Site {
    let mut config = HostConfig::default();
    config.sends_first_stop = false;
    Site::new(config, false, menu)
}

fn low_ids_only(menu: Menu) -> Site {
    let mut config = HostConfig::default();
    config.low_ids_only = true;
    Site::new(config, false, menu)
}

/// A queue with room for `room` rare events, and a store that keeps nothing.
fn full(room: usize) -> Site {
    let mut site = Site::new(HostConfig::default(), true, CALIBRATION).undrained();
    // The first of them is reported along with the new link.
    for value in 0..15 - room {
        site = site.after(&[Act::Hear(Hear::Mag(100 + value as i16)), DONE]);
    }
    site
}

pub(crate) fn motion(run: &mut Run) {
    run.world("fresh", Depth(3, 6), site(MOTION));
    run.world("driving", Depth(3, 6), site(MOTION).after(&[DONE, Act::Call(Go(1)), DONE]));
    let owed = [DONE, Act::Call(Go(2)), DONE, Act::Wait(5_000), Act::Call(Stop), Act::CUT];
    run.world("a stop is owed", Depth(3, 6), site(MOTION).after(&owed));
    run.world("listening", Depth(2, 6), listening(MOTION));
}

pub(crate) fn updates(run: &mut Run) {
    run.world("standing", Depth(2, 5), site(UPDATE).after(&[DONE]));
    let reports = [Act::Hear(Hear::Report), Act::Run(200)].repeat(8);
    let seen = site(UPDATE).after(&[DONE]).after(&reports);
    let requested = seen.clone().after(&[Act::Call(Update)]);
    run.world("seen to stand still", Depth(2, 5), seen);
    run.world("requested", Depth(2, 5), requested.clone());
    run.world("updating", Depth(2, 5), requested.clone().after(&[DONE]));
    let asking = requested.after(&[Act::One, Act::One]);
    run.world("stopped while requesting", Depth(2, 5), asking.clone().after(&[Act::Call(Stop)]));
    run.world("requesting", Depth(2, 5), asking);
    run.world("listening", Depth(2, 5), listening(UPDATE));
    run.world("low ids only", Depth(2, 5), low_ids_only(UPDATE));
}

pub(crate) fn calibrations(run: &mut Run) {
    let asked = [DONE, Act::Call(Calibrate(START, IMU)), DONE];
    run.world("requested", Depth(2, 4), site(CALIBRATION).after(&asked));
    let started = Act::Hear(Hear::StartAck(IMU, ErrorCode::Fine));
    let running = site(CALIBRATION).after(&asked).after(&[started, DONE]);
    run.world("running", Depth(2, 4), running.clone());
    let results = [Act::Hear(Hear::Imu(1)), Act::Hear(Hear::Mag(1)), DONE];
    let stored = running.after(&results);
    let requested = [Act::Hear(Hear::BiasRequest)];
    run.world("biases requested", Depth(2, 4), stored.clone().after(&requested));
    run.world("both stored", Depth(2, 4), stored);
    let low_ids_only = low_ids_only(CALIBRATION).after(&[DONE]).after(&results);
    run.world("low ids only", Depth(2, 4), low_ids_only);
    run.world("a silent robot", Depth(2, 4), site(CALIBRATION).after(&[Act::Run(3_000)]));
}

pub(crate) fn queues(run: &mut Run) {
    run.world("full", Depth(2, 4), full(0));
    run.world("room for one", Depth(2, 4), full(1));
    let last_room = full(1).after(&[Act::Hear(Hear::Imu(1))]);
    run.world("an acknowledgement is due", Depth(2, 4), last_room);
    let asked = [Act::Call(Calibrate(START, IMU)), DONE];
    run.world("full, with a request", Depth(2, 4), full(0).after(&asked));
    let reports = [Act::Hear(Hear::Report)].repeat(8);
    let busy = site(CALIBRATION).undrained().after(&[DONE]).after(&reports);
    run.world("reports are left", Depth(2, 4), busy);
    run.world("halves", Depth(3, 6), site(HALVES).after(&[DONE]));
}

#[test]
fn hosts_that_differ_in_time_and_counters_alone_have_the_same_fingerprint() {
    let silent = site(MOTION).after(&[Act::Run(3_000)]);
    // Two motor commands and two pings later, a common multiple of their periods.
    let later = silent.clone().after(&[Act::Run(1_000)]);
    assert_ne!(format!("{:?}", silent.role), format!("{:?}", later.role));
    assert_eq!(silent.fingerprint(), later.fingerprint());
    for act in [Act::Call(Stop), Act::Call(Show(1)), Act::One, Act::Wait(1_000)] {
        let other = silent.clone().after(&[act]);
        let is_new = other.fingerprint() != silent.fingerprint();
        // A poll without a result changes nothing.
        assert_eq!(is_new, !matches!(act, Act::One), "{act:?}");
    }
}
