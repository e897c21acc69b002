//! Part four: a host drives a simulated rover.

use std::error::Error;

use axlewire::{
    sim::{Direction, Faults, Line, RoverNode},
    time::{Duration, Instant},
    ucp::{
        BAUD, Host, MotorControl,
        host::{HostConfig, HostEvent, MemoryStore},
        message::{CalibrationKind, ImuBias, NetworkState},
        robot::{RobotConfig, RobotEvent},
    },
};

use crate::title;

type Link = Line<Host<MemoryStore>, RoverNode>;

pub(crate) fn run() -> Result<(), Box<dyn Error>> {
    title("UCP: driving a rover over a noisy link (six seconds in virtual time)");
    let begin = Instant::from_millis(0);
    let host = Host::with_store(HostConfig::default(), MemoryStore::default(), begin);
    let mut link: Link = Line::new(BAUD, 2026, host);
    link.add(RoverNode::new(RobotConfig::default(), begin));
    *link.pair_mut(Direction::ToTails) = Faults::noise(1e-4);
    *link.pair_mut(Direction::ToHead) = Faults::noise(1e-4);

    let mut booted = false;
    for tenth in 0..60 {
        let now = link.now();
        let host = link.head_mut();
        match tenth {
            0 => host.set_network_state(NetworkState::Connected, now)?,
            5..20 => host.drive(MotorControl::turn_right(60, 0)?.with_front_led(true), now)?,
            20..30 => host.drive(MotorControl::turn_right(30, 30)?, now)?,
            // From 3.0 s on, the application sends no commands, as if it had crashed.
            45 => host.start_calibration(CalibrationKind::Imu, now)?,
            50 => host.end_calibration(CalibrationKind::Imu, now)?,
            _ => {}
        }
        link.run_for(Duration::from_millis(100))?;
        tell(&mut link, &mut booted);
        if tenth % 10 == 9 {
            report(&link);
        }
    }
    account(&link);
    Ok(())
}

/// Prints the events that matter; events that the robot repeats after boot, only once.
fn tell(link: &mut Link, booted: &mut bool) {
    let line = |at: Instant, who: &str, what: &str| {
        println!("{:9.3} s  {who:<5}  {what}", at.as_micros() as f64 / 1e6);
    };
    for (at, event) in link.take_head_events() {
        match event {
            HostEvent::LinkUp => line(at, "host", "link up"),
            HostEvent::LinkDown => line(at, "host", "link down"),
            HostEvent::DeadMan => line(at, "host", "no command for 500 ms: stopping the robot"),
            HostEvent::BiasesMissing { .. } if !*booted => {
                line(at, "host", "the robot requests biases, but none are stored")
            }
            HostEvent::CalibrationStarted(kind) => {
                line(at, "host", &format!("calibrating: {kind}"))
            }
            HostEvent::ImuBias(bias) => {
                line(at, "host", &format!("stored the result: {:?}", bias.acc()))
            }
            _ => {}
        }
    }
    let now = link.now();
    for (at, _, event) in link.take_tail_events() {
        match event {
            RobotEvent::NetworkState(state) if !*booted => {
                line(at, "robot", &format!("network lamp: {state}"))
            }
            RobotEvent::Watchdog => line(at, "robot", "no valid command for 500 ms: stopping"),
            RobotEvent::CalibrationEnd(_) => {
                line(
                    at,
                    "robot",
                    "calibration ended, sending the result until the host acknowledges it",
                );
                let result = ImuBias::new([12, -7, 90], [3, 1, -2]);
                link.tail_mut(0).robot_mut().calibration_result_imu(result, now);
            }
            _ => {}
        }
    }
    *booted = true;
}

/// Prints the host's latest report.
fn report(link: &Link) {
    let Some(report) = link.head().last_report() else { return };
    let values = report.telemetry;
    println!(
        "{:9.3} s         report {:3}: rpm {:?}, heading {} deg, {:.1} V, {} W",
        link.now().as_micros() as f64 / 1e6,
        report.index,
        values.rpm,
        values.heading_deg,
        values.volts(),
        values.power_w,
    );
}

fn account(link: &Link) {
    let line = link.head().counters();
    println!(
        "\nThe rover travelled {:.2} m. The host received {} bytes: {} in {} frames, {} skipped.",
        link.tail(0).rover().distance_m(),
        line.received,
        line.framed,
        line.frames,
        line.skipped(),
    );
}
