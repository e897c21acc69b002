//! The end of a session of a link, when nothing is faulty any more: a stop stops, a command is
//! obeyed until the application falls silent or the plug falls out, and nothing stays unanswered.

use axlewire::{
    time::Duration,
    ucp::{host::Link as State, message::CalibrationKind},
};

use super::Link;

const MS: fn(u32) -> Duration = Duration::from_millis;

pub(super) fn check(link: &mut Link) {
    link.heal();
    link.run_for(MS(30));
    link.stop();
    // The frame that was cut off ends, and the stop is repeated once.
    link.run_for(MS(150));
    if link.is_over {
        return;
    }
    assert_eq!(motion(link), (0, 0), "a stop does not stop");
    assert_eq!(link.host.link(), State::Up, "a robot that reports is not heard");

    for _ in 0..3 {
        link.drive(40, -7);
        link.run_for(MS(60));
    }
    if link.is_over {
        return;
    }
    assert_eq!(motion(link), (40, -7), "a command is not obeyed");
    // U10: an application that is silent for 500 ms stops the robot.
    link.run_for(MS(530));
    if link.is_over {
        return;
    }
    assert_eq!(motion(link), (0, 0), "it drives without an application");

    link.drive(-30, 0);
    link.run_for(MS(100));
    link.unplug();
    // What was on its way is lost.
    link.run_for(MS(520));
    if link.is_over {
        return;
    }
    assert_eq!(motion(link), (0, 0), "it drives without a host");
    assert_eq!(link.host.link(), State::Down, "a link that is cut is up");
    let is_open = link.host.start_calibration(CalibrationKind::Imu, link.now).is_err();
    link.run_for(link.host.config().calibration_bound() + MS(5));
    assert!(link.is_over || link.host.calibration_outcome().is_some(), "{is_open}: no outcome");
}

fn motion(link: &Link) -> (i16, i16) {
    let doing = link.robot.command(link.now);
    (doing.speed(), doing.angular())
}
