//! A rover with its robot.

use super::rover::Rover;
use crate::{
    endpoint::{Arrival, Endpoint, LineRules, Transmit},
    time::{Duration, Instant},
    ucp::{
        Robot,
        robot::{RobotConfig, RobotEvent},
    },
};

/// The far end of a rover's link: a [`Robot`] whose commands drive a [`Rover`], and whose reports
/// are the rover's telemetry of that moment.
///
/// ```
/// use axlewire::ucp::{robot::RobotConfig, Body, MotorControl};
/// use axlewire::{endpoint::Endpoint, sim::RoverNode, time::Instant};
///
/// let mut node = RoverNode::new(RobotConfig::default(), Instant::from_millis(0));
/// let drive = MotorControl::new(50, 0)?.frame(0);
/// node.handle_input(drive.as_bytes(), Instant::from_millis(0));
/// node.handle_input(&[], Instant::from_millis(400));
/// assert!(node.rover().distance_m() > 0.05);
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
#[derive(Clone, Debug)]
pub struct RoverNode {
    robot: Robot,
    rover: Rover,
    /// The time up to which the rover has run.
    now: Instant,
}

impl RoverNode {
    /// A rover that has just booted and stands still.
    #[must_use]
    pub fn new(config: RobotConfig, now: Instant) -> Self {
        Self::from_parts(Robot::new(config, now), Rover::new(), now)
    }

    /// Combines this robot and this rover.
    #[must_use]
    pub fn from_parts(robot: Robot, rover: Rover, now: Instant) -> Self {
        let mut node = Self { robot, rover, now };
        node.robot.set_telemetry(&node.rover.telemetry(), now);
        node
    }

    /// The robot.
    #[must_use]
    pub const fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The robot, to respond to its events.
    pub const fn robot_mut(&mut self) -> &mut Robot {
        &mut self.robot
    }

    /// The rover, as it was when the node was last called.
    #[must_use]
    pub const fn rover(&self) -> &Rover {
        &self.rover
    }

    /// Runs the rover up to `now`, and lets the robot report its telemetry.
    fn run(&mut self, now: Instant) {
        self.rover.command(&self.robot.command(now));
        let dt = now - self.now;
        if dt != Duration::ZERO {
            self.now = now;
            self.rover.step(dt);
        }
        self.robot.set_telemetry(&self.rover.telemetry(), now);
    }
}

impl Endpoint for RoverNode {
    type Event = RobotEvent;

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let arrived = arrived.into();
        let now = arrived.now();
        self.run(now);
        self.robot.handle_input(bytes, arrived);
        self.rover.command(&self.robot.command(now));
    }

    fn line_rules(&self) -> LineRules {
        self.robot.line_rules()
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.run(now);
        self.robot.handle_timeout(now);
        self.rover.command(&self.robot.command(now));
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        self.run(now);
        self.robot.poll_transmit(now)
    }

    fn is_outdated(&self) -> bool {
        self.robot.is_outdated()
    }

    fn handle_transmit(&mut self, outcome: impl Into<Transmit>, now: Instant) {
        self.robot.handle_transmit(outcome, now);
    }

    fn poll_event(&mut self) -> Option<RobotEvent> {
        self.robot.poll_event()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.robot.poll_timeout()
    }
}
