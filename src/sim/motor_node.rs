//! A bus node that drives a motor, or three.

use core::fmt;

use super::motor::Motor;
use crate::{
    endpoint::{Arrival, Endpoint, LineRules, Transmit},
    ikeya::{
        Mode, NodeId, Position, Rps, Slave,
        board::{Board, OneMotor, Target, ThreeMotors, Units},
        slave::{SlaveConfig, SlaveEvent},
    },
    time::{Duration, Instant},
};

/// A kind of board whose motors can be simulated: both kinds.
#[expect(private_bounds, reason = "only this crate implements it, and calls what it is made of")]
pub trait MotorBoard: Board {
    /// What its commands move: a [`Motor`], or `[Motor; 3]`.
    type Motor: Motion<Self> + Clone + fmt::Debug;
}

impl MotorBoard for OneMotor {
    type Motor = Motor;
}

impl MotorBoard for ThreeMotors {
    type Motor = [Motor; 3];
}

/// The motors of a board, in its units.
trait Motion<B: Units> {
    fn step(&mut self, dt: Duration);
    fn turn(&mut self, target: B::Velocity);
    fn go_to(&mut self, target: B::Position);
    fn hold(&mut self);
    fn velocity(&self) -> B::Velocity;
    fn position(&self) -> B::Position;
}

impl Motion<OneMotor> for Motor {
    fn step(&mut self, dt: Duration) {
        Self::step(self, dt);
    }

    fn turn(&mut self, target: Rps) {
        Self::turn(self, target);
    }

    fn go_to(&mut self, target: Position) {
        Self::go_to(self, target);
    }

    fn hold(&mut self) {
        Self::hold(self);
    }

    fn velocity(&self) -> Rps {
        Self::velocity(self)
    }

    fn position(&self) -> Position {
        Self::position(self)
    }
}

impl Motion<ThreeMotors> for [Motor; 3] {
    fn step(&mut self, dt: Duration) {
        self.iter_mut().for_each(|motor| motor.step(dt));
    }

    fn turn(&mut self, targets: [Rps; 3]) {
        self.iter_mut().zip(targets).for_each(|(motor, target)| motor.turn(target));
    }

    fn go_to(&mut self, targets: [Position; 3]) {
        self.iter_mut().zip(targets).for_each(|(motor, target)| motor.go_to(target));
    }

    fn hold(&mut self) {
        self.iter_mut().for_each(Motor::hold);
    }

    fn velocity(&self) -> [Rps; 3] {
        self.each_ref().map(Motor::velocity)
    }

    fn position(&self) -> [Position; 3] {
        self.each_ref().map(Motor::position)
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
///
/// With three motors per board (ruling I10):
///
/// ```
/// # use axlewire::{endpoint::Endpoint, ikeya::{Mode, NodeId, Rps, three}, sim::MotorNode};
/// # use axlewire::time::Instant;
/// let mut node = MotorNode::three_motors(NodeId::N1, Mode::Velocity);
/// let speeds = [Rps::new(1.0)?, Rps::ZERO, Rps::new(-2.0)?];
/// let turn = three::WriteRequest::velocity(NodeId::N1, speeds);
/// node.handle_input(turn.as_bytes(), Instant::from_millis(0));
/// node.handle_input(&[], Instant::from_millis(1000));
/// let [first, second, third] = node.motor();
/// assert!(first.velocity().get() > 0.99 && third.velocity().get() < -1.99);
/// assert_eq!(second.velocity(), Rps::ZERO);
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
#[derive(Clone, Debug)]
pub struct MotorNode<B: MotorBoard = OneMotor> {
    slave: Slave<B>,
    motor: B::Motor,
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
}

impl MotorNode<ThreeMotors> {
    /// The same with three motors on the board.
    #[must_use]
    pub fn three_motors(node: NodeId, mode: Mode) -> Self {
        let slave = Slave::for_board(node, mode, SlaveConfig::direct(), Instant::from_micros(0));
        Self::from_parts(slave, [Motor::new(), Motor::new(), Motor::new()])
    }
}

impl<B: MotorBoard> MotorNode<B> {
    /// Combines this slave and this motor, or these three.
    #[must_use]
    pub fn from_parts(slave: Slave<B>, motor: B::Motor) -> Self {
        let mut node = Self { slave, motor, now: None };
        node.show();
        node
    }

    /// The slave.
    #[must_use]
    pub const fn slave(&self) -> &Slave<B> {
        &self.slave
    }

    /// The motor, or the three, as it was when the node was last called.
    #[must_use]
    pub const fn motor(&self) -> &B::Motor {
        &self.motor
    }

    /// The motor, or the three, to block or to turn it by hand.
    pub const fn motor_mut(&mut self) -> &mut B::Motor {
        &mut self.motor
    }

    /// Moves the mode switch. The command is forgotten.
    pub fn set_mode(&mut self, mode: Mode) {
        self.slave.set_mode(mode);
        self.show();
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
            (None, Mode::Velocity) => self.motor.turn(B::ZERO),
            (None, Mode::Position) => self.motor.hold(),
        }
    }
}

impl<B: MotorBoard> Endpoint for MotorNode<B> {
    type Event = SlaveEvent<B>;

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let arrived = arrived.into();
        let now = arrived.now();
        self.run(now);
        self.slave.handle_input(bytes, arrived);
        self.obey(now);
    }

    fn line_rules(&self) -> LineRules {
        self.slave.line_rules()
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

    fn handle_transmit(&mut self, outcome: impl Into<Transmit>, now: Instant) {
        self.slave.handle_transmit(outcome, now);
    }

    fn poll_event(&mut self) -> Option<SlaveEvent<B>> {
        self.slave.poll_event()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.slave.poll_timeout()
    }
}
