//! A rover's drive: it boots, drives out, loses its plug for most of a second, and drives home.

use std::error::Error;

use axlewire::{
    sim::{Faults, Line, Rover, RoverNode, Who},
    time::{Duration, Instant},
    ucp::{
        BAUD, Host, MotorControl, Robot, Ucp,
        host::{HostConfig, HostEvent, MemoryStore},
        message::{ImuBias, MagBias, NetworkState},
        robot::RobotConfig,
    },
};

use crate::capture::{self, Described};

type Link = Line<Host<MemoryStore>, RoverNode>;

/// The application gives its command this often.
const STEP_MS: u32 = 50;
const STEPS: u32 = 18_000 / STEP_MS;

/// The rover is the only station at the tail.
const ROVER: Who = Who::Tail(0);

/// After the link has come back, the application waits this long before it drives again.
const PATIENCE: Duration = Duration::from_millis(700);

/// Runs the story; returns the capture.
pub(crate) fn story() -> Result<Vec<u8>, Box<dyn Error>> {
    let mut link = link();
    let mut may_drive_at = Some(Instant::from_micros(0));
    for step in 0..STEPS {
        let millis = step * STEP_MS;
        *link.stub_mut(ROVER) = plug(millis);
        let now = link.now();
        for (at, event) in link.take_head_events() {
            match event {
                HostEvent::LinkDown => may_drive_at = None,
                HostEvent::LinkUp => may_drive_at = Some(at + PATIENCE),
                _ => {}
            }
        }
        let host = link.head_mut();
        if let Some(state) = network(millis) {
            host.set_network_state(state, now)?;
        }
        match plan(millis)? {
            Some(command) if may_drive_at.is_some_and(|at| now >= at) => {
                host.drive(command, now)?
            }
            _ => host.stop(now),
        }
        link.run_for(Duration::from_millis(STEP_MS))?;
    }
    let described =
        Described { link_type: 150, protocol: "ucp", name: "simulated rover", baud: BAUD };
    Ok(capture::file::<Ucp>(&described, link.trace()))
}

/// A host that has the biases of its rover, and a rover whose battery is about to fall below 60 %.
fn link() -> Link {
    let begin = Instant::from_micros(0);
    let store = MemoryStore {
        imu: Some(ImuBias::new([12, -7, 90], [3, 1, -2])),
        mag: Some(MagBias::new([-31, 18, 44])),
    };
    let host = Host::with_store(HostConfig::direct(), store, begin);
    let mut link = Link::new(BAUD, 2026, host);
    let robot = Robot::new(RobotConfig::direct(), begin);
    link.add(RoverNode::from_parts(robot, Rover::new().with_battery(60.09), begin));
    link.timing_mut(ROVER).latency = Duration::from_micros(300);
    link.record();
    link
}

/// The drive; `None` is a stop.
fn plan(millis: u32) -> Result<Option<MotorControl>, Box<dyn Error>> {
    Ok(Some(match millis {
        1000..3000 => MotorControl::turn_right(60, 0)?,
        3000..5000 => MotorControl::turn_right(50, 60)?.with_front_led(true),
        5000..6500 => MotorControl::turn_right(90, 0)?.with_front_led(true),
        6500..8000 => MotorControl::turn_left(60, 30)?.with_front_led(true),
        8000..12_500 => MotorControl::turn_right(70, 0)?.with_front_led(true),
        12_500..14_000 => MotorControl::turn_left(45, 60)?,
        14_000..15_200 => MotorControl::turn_right(-40, 0)?,
        15_200..16_500 => MotorControl::turn_right(0, 75)?,
        _ => return Ok(None),
    }))
}

/// The state of the network that the host reports from this moment on.
const fn network(millis: u32) -> Option<NetworkState> {
    match millis {
        400 => Some(NetworkState::Disconnected),
        1500 => Some(NetworkState::Connected),
        _ => None,
    }
}

/// The rover's plug: it works loose, has no contact for 850 ms, and is pushed in again. The length
/// of a step is the shortest state.
fn plug(millis: u32) -> Faults {
    let mut faults = Faults::CLEAN;
    match millis {
        8500..8700 | 9550..9700 => {
            (faults.bit_errors, faults.lost) = (0.0015, 0.002);
        }
        8700..9550 => faults.unplugged = true,
        _ => {}
    }
    faults
}
