//! A motor, and a bus node that drives it.

use super::lag::{Lag, seconds};
use crate::{
    endpoint::{Endpoint, Unsent},
    ikeya::{
        Mode, NodeId, Position, Rps,
        board::Target,
        slave::{Slave, SlaveConfig, SlaveEvent},
    },
    time::{Duration, Instant},
};

/// A motor that approaches a speed with a time constant, or moves to a position at a limited speed.
/// Steps of any length give the same motion.
///
/// ```
/// use axlewire::{ikeya::{Position, Rps}, sim::Motor, time::Duration};
///
/// let mut motor = Motor::new().with_time_constant(Duration::from_millis(50));
/// motor.turn(Rps::new(2.0)?);
/// motor.step(Duration::from_millis(50));
/// assert!((motor.velocity().get() - 2.0 * 0.632).abs() < 0.001);
///
/// let mut motor = Motor::new().with_speed_limit(Rps::new(5.0)?);
/// motor.go_to(Position::from_revolutions(-1.0)?);
/// motor.step(Duration::from_millis(100));
/// assert_eq!(motor.position().revolutions(), -0.5);
/// assert_eq!(motor.velocity().get(), -5.0);
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Motor {
    /// Speed, revolutions per second.
    speed: Lag,
    speed_limit: f64,
    revolutions: f64,
    /// Target position, revolutions; `None` in velocity mode.
    goal: Option<f64>,
}

impl Motor {
    /// A motor at standstill at position 0: 50 ms to 63 % of a new speed, 5 rps to a position.
    #[must_use]
    pub const fn new() -> Self {
        let time_constant = Duration::from_millis(50);
        let speed = Lag { value: 0.0, target: 0.0, time_constant };
        Self { speed, speed_limit: 5.0, revolutions: 0.0, goal: None }
    }

    /// The same motor with this time to 63 % of a new speed; zero reaches the speed at once.
    #[must_use]
    pub const fn with_time_constant(mut self, time_constant: Duration) -> Self {
        self.speed.time_constant = time_constant;
        self
    }

    /// The same motor with this speed on its way to a position; the sign is ignored.
    #[must_use]
    pub const fn with_speed_limit(mut self, limit: Rps) -> Self {
        self.speed_limit = limit.get().abs() as f64;
        self
    }

    /// The same motor, with its shaft at `position`.
    #[must_use]
    pub const fn at(mut self, position: Position) -> Self {
        self.revolutions = position.revolutions();
        self
    }

    /// Turns at this speed from now on.
    pub fn turn(&mut self, target: Rps) {
        (self.goal, self.speed.target) = (None, target.get().into());
    }

    /// Moves to this position, and holds it.
    pub fn go_to(&mut self, target: Position) {
        self.goal = Some(target.revolutions());
    }

    /// Holds the present position of the shaft.
    pub fn hold(&mut self) {
        self.goal = Some(self.revolutions);
    }

    /// Advances by `dt`.
    pub fn step(&mut self, dt: Duration) {
        let Some(goal) = self.goal else {
            self.revolutions += self.speed.step(dt);
            return;
        };
        let (way, reach) = (goal - self.revolutions, self.speed_limit * seconds(dt));
        if way.abs() <= reach || way == 0.0 {
            (self.revolutions, self.speed.value) = (goal, 0.0);
        } else {
            self.speed.value = self.speed_limit.copysign(way);
            self.revolutions += reach.copysign(way);
        }
    }

    /// The speed of the shaft.
    #[must_use]
    pub fn velocity(&self) -> Rps {
        // Finite: it lies between two finite speeds.
        Rps::new(self.speed.value as f32).unwrap_or(Rps::ZERO)
    }

    /// The position of the shaft, to the nearest count. Beyond the range of the wire it stays at
    /// the last position in range.
    #[must_use]
    pub fn position(&self) -> Position {
        Position::from_revolutions(self.revolutions)
            .unwrap_or(Self::END[usize::from(self.revolutions > 0.0)])
    }

    /// The first and the last position in the range of the wire.
    const END: [Position; 2] = [Position::new(-8191, i16::MIN), Position::new(8191, i16::MAX)];
}

impl Default for Motor {
    fn default() -> Self {
        Self::new()
    }
}

/// A node of a motor bus: a [`Slave`] whose commands move a [`Motor`], and whose answers are the
/// motor's state at that moment.
///
/// Without a command, and after the slave's watchdog has fired, a velocity node stands still and a
/// position node holds.
///
/// ```
/// use axlewire::{
///     endpoint::Endpoint,
///     ikeya::{Mode, NodeId, Rps, WriteRequest},
///     sim::MotorNode,
///     time::Instant,
/// };
///
/// let mut node = MotorNode::new(NodeId::N1, Mode::Velocity);
/// let turn = WriteRequest::velocity(NodeId::N1, Rps::new(-1.0)?);
/// node.handle_input(turn.as_bytes(), Instant::from_millis(0));
/// node.handle_input(&[], Instant::from_millis(1000));
/// assert!((node.motor().velocity().get() + 1.0).abs() < 1e-6);
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
#[derive(Debug)]
pub struct MotorNode {
    slave: Slave,
    motor: Motor,
    /// The time up to which the motor has run.
    now: Option<Instant>,
}

impl MotorNode {
    /// A node with a [`Motor::new`] and a [`SlaveConfig::direct`].
    #[must_use]
    pub fn new(node: NodeId, mode: Mode) -> Self {
        let slave = Slave::new(node, mode, SlaveConfig::direct(), Instant::from_micros(0));
        Self::from_parts(slave, Motor::new())
    }

    /// Combines this slave and this motor.
    #[must_use]
    pub fn from_parts(slave: Slave, motor: Motor) -> Self {
        let mut node = Self { slave, motor, now: None };
        node.show();
        node
    }

    /// The slave.
    #[must_use]
    pub const fn slave(&self) -> &Slave {
        &self.slave
    }

    /// The motor, as it was when the node was last called.
    #[must_use]
    pub const fn motor(&self) -> &Motor {
        &self.motor
    }

    /// The motor, to block or to turn it by hand.
    pub const fn motor_mut(&mut self) -> &mut Motor {
        &mut self.motor
    }

    /// Moves the mode switch. The command is forgotten.
    pub fn set_mode(&mut self, mode: Mode) {
        self.slave.set_mode(mode);
        self.obey(self.now.unwrap_or_default());
    }

    /// Runs the motor up to `now`.
    fn run(&mut self, now: Instant) {
        let dt = self.now.replace(now).map_or(Duration::ZERO, |last| now - last);
        if dt != Duration::ZERO {
            self.motor.step(dt);
        }
        self.show();
    }

    /// Gives the state of the motor to the slave.
    fn show(&mut self) {
        self.slave.set_velocity(self.motor.velocity());
        self.slave.set_position(self.motor.position());
    }

    /// Lets the motor carry out the slave's command.
    fn obey(&mut self, now: Instant) {
        match (self.slave.command(now), self.slave.mode()) {
            (Some(Target::Velocity(target)), _) => self.motor.turn(target),
            (Some(Target::Position(target)), _) => self.motor.go_to(target),
            (None, Mode::Velocity) => self.motor.turn(Rps::ZERO),
            (None, Mode::Position) => self.motor.hold(),
        }
    }
}

impl Endpoint for MotorNode {
    type Event = SlaveEvent;

    fn handle_input(&mut self, bytes: &[u8], now: Instant) {
        self.run(now);
        self.slave.handle_input(bytes, now);
        self.obey(now);
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.run(now);
        self.slave.handle_timeout(now);
        self.obey(now);
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        self.run(now);
        self.slave.poll_transmit(now)
    }

    fn is_outdated(&self) -> bool {
        self.slave.is_outdated()
    }

    fn handle_unsent(&mut self, unsent: Unsent, now: Instant) {
        self.slave.handle_unsent(unsent, now);
    }

    fn poll_event(&mut self) -> Option<SlaveEvent> {
        self.slave.poll_event()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.slave.poll_timeout()
    }
}
