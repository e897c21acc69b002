//! Stories of a motor bus: nodes 1 and 2 turn, node 3 goes to positions. Each with boards of one
//! motor and of three.

use axlewire::{
    endpoint::{Arrival, Endpoint, LineRules, Transmit, Unsent},
    ikeya::{
        Master, Mode, NodeId, Position, Rps, Slave, Target,
        master::{Health, MasterConfig, MasterEvent, Polling, StopProgress},
        slave::{SlaveConfig, SlaveEvent},
    },
    sim::{Direction, Faults, Input, Line, Motor, Who},
    time::{Duration, Instant},
};
use axlewire_c::*;

use crate::{
    bus_roles::{Kind, master_config, slave_config},
    twin::{Port, Twin, same},
};

const N1: NodeId = NodeId::N1;
const N2: NodeId = NodeId::N2;
const N3: NodeId = NodeId::N3;

/// A slave in C and in Rust that drives motors.
pub(crate) struct Node<B: Kind> {
    slave: Twin<Slave<B>>,
    motors: [Motor; 3],
    now: Instant,
    /// Somebody turns the motors.
    pushed: bool,
}

impl<B: Kind> Node<B> {
    fn run(&mut self, now: Instant) {
        let dt = now - self.now;
        self.now = now;
        self.motors.iter_mut().for_each(|motor| motor.step(dt));
        let velocity = self.motors.each_ref().map(Motor::velocity);
        self.slave.measure(velocity, self.motors.each_ref().map(Motor::position));
    }

    fn obey(&mut self, now: Instant) {
        let one = |index: usize| index.min(B::MOTORS - 1);
        let slave = self.slave.rust();
        let command = slave.command(now);
        let mode = slave.mode();
        for (index, motor) in self.motors.iter_mut().enumerate() {
            match command {
                _ if self.pushed => motor.turn(Rps::new(2.0).unwrap()),
                Some(Target::Velocity(velocity)) => {
                    motor.turn(Rps::new(B::rps(velocity)[one(index)]).unwrap());
                }
                Some(Target::Position(to)) => motor.go_to(B::positions(to)[one(index)]),
                None if mode == Mode::Velocity => motor.turn(Rps::ZERO),
                None => motor.hold(),
            }
        }
    }
}

impl<B: Kind> Endpoint for Node<B> {
    type Event = SlaveEvent<B>;

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let arrived = arrived.into();
        self.run(arrived.now());
        self.slave.handle_input(bytes, arrived);
        self.obey(arrived.now());
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
    fn handle_transmit(&mut self, outcome: impl Into<Transmit>, now: Instant) {
        self.slave.tell(outcome.into(), now);
    }
    fn is_outdated(&self) -> bool {
        self.slave.is_outdated()
    }
    fn line_rules(&self) -> LineRules {
        self.slave.line_rules()
    }
    fn poll_event(&mut self) -> Option<SlaveEvent<B>> {
        self.slave.poll_event()
    }
    fn poll_timeout(&self) -> Option<Instant> {
        self.slave.poll_timeout()
    }
}

/// The whole bus.
pub(crate) struct Bus<B: Kind> {
    line: Line<Twin<Master<B>>, Node<B>>,
    events: Vec<MasterEvent<B>>,
    told: Vec<(usize, SlaveEvent<B>)>,
}

impl<B: Kind> Bus<B> {
    fn with(change: impl FnOnce(&mut MasterConfig), tail: impl Fn(&mut SlaveConfig)) -> Self {
        let start = Instant::from_micros(0);
        let (mut config, mut slave) = (MasterConfig::direct(), SlaveConfig::direct());
        config.nodes = [N1, N2, N3].into();
        config.polling = Polling::Every(Duration::from_millis(5));
        change(&mut config);
        tail(&mut slave);
        let mut line = Line::new(500_000, 7, Twin::master(config, start));
        for (node, mode) in [(N1, Mode::Velocity), (N2, Mode::Velocity), (N3, Mode::Position)] {
            let slave = Twin::slave(node, mode, slave, start);
            let motors = [Motor::new(), Motor::new(), Motor::new()];
            line.add(Node { slave, motors, now: start, pushed: false });
        }
        line.record();
        Self { line, events: Vec::new(), told: Vec::new() }
    }

    fn new() -> Self {
        Self::with(|_| {}, |_| {})
    }

    /// With all nodes found.
    fn found() -> Self {
        Self::new().discovered()
    }

    fn discovered(mut self) -> Self {
        self.with_master(|master, now| master.discover(now));
        self.run(100);
        let done = MasterEvent::DiscoveryDone { online: 3 };
        assert!(self.events.contains(&done), "{:?}", self.events);
        self
    }

    fn with_master<T>(&mut self, call: impl FnOnce(&mut Twin<Master<B>>, Instant) -> T) -> T {
        let now = self.line.now();
        call(self.line.head_mut(), now)
    }

    fn turn(&mut self, node: NodeId, rps: f32) -> axle_result {
        self.with_master(|master, now| master.turn(node, rps, now))
    }

    fn go_to(&mut self, node: NodeId, counts: i32) -> axle_result {
        self.with_master(|master, now| master.go_to(node, counts, now))
    }

    fn stop(&mut self, node: NodeId) {
        self.with_master(|master, now| master.stop(node, now));
    }

    fn run(&mut self, millis: u32) {
        self.line.run_for(Duration::from_millis(millis)).unwrap();
        self.events.extend(self.line.take_head_events().into_iter().map(|(_, event)| event));
        let told = self.line.take_tail_events().into_iter();
        self.told.extend(told.map(|(_, tail, event)| (tail, event)));
    }

    fn unplug(&mut self, tail: usize, unplugged: bool) {
        self.line.stub_mut(Who::Tail(tail)).unplugged = unplugged;
    }

    fn faults(&mut self, faults: Faults) {
        *self.line.pair_mut(Direction::ToTails) = faults;
        *self.line.pair_mut(Direction::ToHead) = faults;
    }

    fn master(&self) -> &Master<B> {
        self.line.head().rust()
    }

    #[track_caller]
    fn has(&self, event: &MasterEvent<B>) {
        assert!(self.events.contains(event), "no {event:?} in {:?}", self.events);
    }

    fn speed(&self, tail: usize) -> f32 {
        self.line.tail(tail).motors[0].velocity().get()
    }

    fn at(&self, tail: usize) -> i32 {
        self.line.tail(tail).motors[0].position().counts()
    }

    /// Turns nodes 1 and 2 and moves node 3.
    fn moving(mut self) -> Self {
        assert_eq!([self.turn(N1, 2.0), self.turn(N2, -1.0), self.go_to(N3, 60_000)], [AXLE_OK; 3]);
        self.run(300);
        assert!(self.speed(0) > 1.9 && self.speed(1) < -0.9 && self.at(2) > 5000);
        self
    }

    #[track_caller]
    fn stands_still(&self, nodes: &[NodeId]) {
        for &node in nodes {
            self.has(&MasterEvent::Stopped { node });
            self.has(&MasterEvent::StandingStill { node });
            assert_eq!(self.master().stop_progress(node), StopProgress::StandingStill);
        }
    }
}

/// Each story for both boards.
macro_rules! stories {
    ($($name:ident $body:block)*) => {
        $(mod $name {
            use super::*;

            fn story<B: Kind>() $body

            #[test]
            fn one_motor() {
                story::<axlewire::ikeya::board::OneMotor>();
            }

            #[test]
            fn three_motors() {
                story::<axlewire::ikeya::board::ThreeMotors>();
            }
        })*
    };
}

stories! {
    a_master_finds_its_nodes_and_their_modes {
        let bus = Bus::<B>::found();
        for (node, mode) in [(N1, Mode::Velocity), (N2, Mode::Velocity), (N3, Mode::Position)] {
            bus.has(&MasterEvent::Discovered { node, mode });
        }
        assert!(bus.line.trace().len() > 100);
    }

    motors_turn_and_go_where_they_are_told {
        let fastest = |config: &mut MasterConfig| config.polling = Polling::Fastest;
        let mut bus = Bus::<B>::with(fastest, |_| {}).discovered().moving();
        bus.run(1500);
        assert_eq!(bus.at(2), 60_000);
        assert!(bus.told.iter().any(|(_, event)| matches!(event, SlaveEvent::Command(_))));
    }

    a_set_point_is_confirmed {
        let mut bus = Bus::<B>::found();
        assert_eq!(bus.with_master(|it, now| it.confirm(N1, now)), AXLE_ERROR_NO_SET_POINT);
        assert_eq!(bus.turn(N1, 1.0), AXLE_OK);
        assert_eq!(bus.with_master(|it, now| it.confirm(N1, now)), AXLE_OK);
        bus.run(50);
        bus.has(&MasterEvent::Confirmed { node: N1 });
    }

    a_set_point_is_not_confirmed_by_a_lost_node {
        let mut bus = Bus::<B>::found();
        assert_eq!(bus.turn(N1, 1.0), AXLE_OK);
        bus.run(10);
        bus.unplug(0, true);
        assert_eq!(bus.with_master(|it, now| it.confirm(N1, now)), AXLE_OK);
        bus.run(100);
        let not = |event: &_| matches!(event, MasterEvent::NotConfirmed { node: N1, .. });
        assert!(bus.events.iter().any(not));
    }

    a_stop_is_repeated_until_the_motor_is_at_rest {
        let mut bus = Bus::<B>::found().moving();
        bus.stop(N1);
        bus.run(1000);
        bus.stands_still(&[N1]);
        assert!(bus.speed(0).abs() < 0.05 && bus.speed(1) < -0.9);
    }

    a_stop_of_all_stops_all {
        let mut bus = Bus::<B>::found().moving();
        bus.with_master(|master, now| master.stop_all(now));
        bus.run(1000);
        bus.stands_still(&[N1, N2, N3]);
    }

    a_position_node_stops_where_it_is {
        let mut bus = Bus::<B>::found().moving();
        bus.stop(N3);
        bus.run(500);
        bus.stands_still(&[N3]);
        assert!((5_000..50_000).contains(&bus.at(2)), "{}", bus.at(2));
    }

    set_points_are_refused_while_a_stop_is_owed {
        let mut bus = Bus::<B>::found().moving();
        bus.stop(N1);
        assert_eq!(bus.turn(N1, 1.0), AXLE_ERROR_STOP_OWED);
        assert_eq!(bus.turn(N2, 1.0), AXLE_OK);
        bus.run(1000);
        assert_eq!(bus.turn(N1, 1.0), AXLE_OK);
        bus.run(300);
        assert!(bus.speed(0) > 0.9);
    }

    the_other_mode_and_numbers_that_are_none_are_refused {
        let mut bus = Bus::<B>::found();
        assert_eq!(bus.turn(N3, 1.0), AXLE_ERROR_WRONG_MODE);
        assert_eq!(bus.go_to(N1, 1), AXLE_ERROR_WRONG_MODE);
        for none in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(bus.turn(N1, none), AXLE_ERROR_NOT_FINITE);
        }
        bus.run(50);
    }

    a_node_that_was_never_heard_gets_no_command {
        let mut bus = Bus::<B>::new();
        assert_eq!(bus.turn(N1, 1.0), AXLE_ERROR_NOT_ONLINE);
        assert_eq!(bus.go_to(N3, 1), AXLE_ERROR_NOT_ONLINE);
        assert_eq!(bus.with_master(|it, now| it.read(N2, now)), AXLE_ERROR_NOT_ONLINE);
        assert_eq!(bus.with_master(|it, now| it.confirm(N2, now)), AXLE_ERROR_NOT_ONLINE);
        bus.stop(N1);
        bus.run(500);
        bus.has(&MasterEvent::Stopped { node: N1 });
    }

    the_dead_man_stops_every_node {
        let dead = |config: &mut MasterConfig| config.dead_man = Some(Duration::from_millis(400));
        let mut bus = Bus::<B>::with(dead, |_| {}).discovered().moving();
        bus.run(1500);
        bus.has(&MasterEvent::DeadMan);
        bus.stands_still(&[N1, N2, N3]);
    }

    a_sign_of_life_holds_off_the_dead_man {
        let dead = |config: &mut MasterConfig| config.dead_man = Some(Duration::from_millis(400));
        let mut bus = Bus::<B>::with(dead, |_| {}).discovered().moving();
        for _ in 0..10 {
            bus.with_master(|master, now| master.keep_alive(now));
            bus.run(200);
        }
        assert!(!bus.events.contains(&MasterEvent::DeadMan) && bus.speed(0) > 1.9);
    }

    the_watchdog_of_a_slave_fires_when_its_cable_is_lost {
        let watch = |config: &mut SlaveConfig| config.watchdog = Some(Duration::from_millis(200));
        let mut bus = Bus::<B>::with(|_| {}, watch).discovered().moving();
        bus.unplug(0, true);
        bus.run(1000);
        assert!(bus.told.contains(&(0, SlaveEvent::Watchdog)));
        // Nothing wakes a node without a command: a look at it lets its motor run.
        let _ = bus.line.tail_mut(0);
        bus.run(1);
        assert!(bus.speed(0).abs() < 0.05, "{}", bus.speed(0));
        assert!(!bus.told.contains(&(1, SlaveEvent::Watchdog)));
    }

    a_lost_node_is_stopped_when_its_cable_is_back {
        let mut bus = Bus::<B>::found().moving();
        bus.unplug(0, true);
        bus.run(500);
        bus.has(&MasterEvent::Health { node: N1, health: Health::Abnormal });
        bus.has(&MasterEvent::Health { node: N1, health: Health::Suspect(1) });
        assert!(bus.speed(0) > 1.9, "it keeps its last command");
        assert_eq!(bus.turn(N1, 1.0), AXLE_ERROR_NOT_ONLINE);
        bus.unplug(0, false);
        bus.run(2500);
        bus.has(&MasterEvent::Health { node: N1, health: Health::Online });
        bus.stands_still(&[N1]);
    }

    a_stop_of_a_lost_node_waits_for_its_cable {
        let keep = |config: &mut MasterConfig| config.stops_abnormal = false;
        let mut bus = Bus::<B>::with(keep, |_| {}).discovered().moving();
        bus.unplug(2, true);
        bus.run(200);
        bus.stop(N3);
        bus.run(200);
        assert_eq!(bus.master().stop_progress(N3), StopProgress::Owed);
        bus.unplug(2, false);
        bus.run(2500);
        bus.stands_still(&[N3]);
    }

    a_line_that_is_cut_for_all_is_found_again {
        let mut bus = Bus::<B>::found().moving();
        bus.line.pair_mut(Direction::ToHead).unplugged = true;
        bus.run(300);
        assert!(bus.master().stops_owed().len() == 3);
        bus.line.pair_mut(Direction::ToHead).unplugged = false;
        bus.run(3000);
        bus.stands_still(&[N1, N2, N3]);
    }

    stops_get_through_noise {
        let mut bus = Bus::<B>::found().moving();
        bus.faults(Faults::noise(2e-3));
        bus.run(500);
        bus.with_master(|master, now| master.stop_all(now));
        bus.run(4000);
        assert!(bus.speed(0).abs() < 0.05 && bus.speed(1).abs() < 0.05);
        assert!(bus.line.statistics(Direction::ToHead).bit_errors > 20);
    }

    bytes_are_lost_doubled_and_made_up {
        let mut bus = Bus::<B>::found();
        let mut faults = Faults::noise(1e-4);
        (faults.lost, faults.duplicated, faults.inserted) = (0.002, 0.002, 0.002);
        (faults.stray, faults.jitter) = (Some(0xBB), Duration::from_micros(40));
        bus.faults(faults);
        for _ in 0..20 {
            let _ = bus.turn(N1, 1.0);
            let _ = bus.go_to(N3, 5_000);
            bus.run(100);
        }
        bus.stop(N1);
        bus.run(1000);
        assert!(bus.master().node_statistics(N1).replies > 100);
    }

    a_moved_mode_switch_ends_the_set_point_and_owes_a_stop {
        let mut bus = Bus::<B>::found().moving();
        bus.line.tail_mut(0).slave.set_mode(Mode::Position);
        bus.run(500);
        bus.has(&MasterEvent::ModeChanged { node: N1, mode: Mode::Position });
        assert_eq!(bus.turn(N1, 1.0), AXLE_ERROR_WRONG_MODE);
    }

    a_mode_in_doubt_refuses_commands_and_stops {
        let mut bus = Bus::<B>::found().moving();
        let mut refused = 0;
        for turn in 0..1000 {
            let mode = if turn / 8 % 2 == 0 { Mode::Position } else { Mode::Velocity };
            bus.line.tail_mut(0).slave.set_mode(mode);
            refused += u32::from(bus.turn(N1, 1.0) == AXLE_ERROR_MODE_IN_DOUBT);
            if turn == 700 {
                bus.stop(N1);
            }
            bus.line.run_for(Duration::from_micros(137)).unwrap();
        }
        assert!(refused > 0);
        bus.run(300);
    }

    slaves_that_hear_each_other_stay_in_step {
        let two_wire = |config: &mut SlaveConfig| config.two_wire = true;
        let mut bus = Bus::<B>::with(|_| {}, two_wire);
        let mut faults = Faults::CLEAN;
        faults.echo = true;
        bus.faults(faults);
        let mut bus = bus.discovered().moving();
        bus.stop(N1);
        bus.run(500);
        assert!(bus.line.tail(0).slave.rust().statistics().answers > 0);
    }

    a_master_that_is_polled_by_hand_reads_on_request {
        let manual = |config: &mut MasterConfig| config.polling = Polling::Manual;
        let mut bus = Bus::<B>::with(manual, |_| {}).discovered();
        bus.events.clear();
        bus.run(100);
        assert_eq!(bus.events, []);
        assert_eq!(bus.with_master(|it, now| it.read(N1, now)), AXLE_OK);
        bus.run(20);
        assert!(matches!(bus.events[..], [MasterEvent::Status { node: N1, .. }]));
        bus.unplug(0, true);
        assert_eq!(bus.with_master(|it, now| it.read(N1, now)), AXLE_OK);
        bus.run(50);
        let failed = |event: &_| matches!(event, MasterEvent::ReadFailed { node: N1, .. });
        assert!(bus.events.iter().any(failed));
    }

    nodes_are_read_once_in_a_period {
        let every = Polling::Every(Duration::from_millis(20));
        let mut bus = Bus::<B>::with(|config| config.polling = every, |_| {}).discovered();
        bus.events.clear();
        assert_eq!(bus.turn(N2, 1.5), AXLE_OK);
        bus.run(1000);
        let answers = |node| {
            let of = |event: &&_| match event {
                MasterEvent::Status { node: it, .. } => *it == node,
                _ => false,
            };
            bus.events.iter().filter(of).count()
        };
        assert!((45..=110).contains(&answers(N1)), "{}", answers(N1));
    }

    a_released_node_keeps_its_last_command {
        let mut bus = Bus::<B>::found().moving();
        bus.with_master(|master, _| master.release(N1));
        bus.run(300);
        assert_eq!(bus.master().set_point(N1), None);
        assert!(bus.speed(0) > 1.9);
    }

    a_motor_that_is_pushed_is_told_to_be_still_moving {
        let short = |config: &mut MasterConfig| config.coast = Duration::from_millis(300);
        let mut bus = Bus::<B>::with(short, |_| {}).discovered().moving();
        bus.line.tail_mut(0).pushed = true;
        bus.stop(N1);
        bus.run(1000);
        let moving = |event: &_| matches!(event, MasterEvent::StillMoving { node: N1, .. });
        assert!(bus.events.iter().any(moving));
        bus.line.tail_mut(0).pushed = false;
        bus.run(1000);
        bus.stands_still(&[N1]);
    }

    late_bytes_of_a_usb_adapter_are_waited_for {
        let usb = |config: &mut MasterConfig| {
            let nodes = config.nodes;
            *config = MasterConfig::usb_adapter();
            config.nodes = nodes;
        };
        let mut bus = Bus::<B>::with(usb, |config| *config = SlaveConfig::usb_adapter());
        bus.line.timing_mut(Who::Head).input = Input::usb_adapter();
        bus.with_master(|master, now| master.discover(now));
        bus.run(1000);
        bus.has(&MasterEvent::DiscoveryDone { online: 3 });
        let mut bus = bus.moving();
        bus.stop(N1);
        bus.run(2000);
        bus.stands_still(&[N1]);
    }

    a_port_that_holds_requests_back_tells_when_they_have_left {
        let mut bus = Bus::<B>::new();
        bus.line.head_mut().port = Port::Holds;
        bus.line.tail_mut(0).slave.port = Port::Holds;
        let mut bus = bus.discovered().moving();
        bus.with_master(|master, now| master.stop_all(now));
        bus.run(1000);
        bus.stands_still(&[N1, N2, N3]);
    }

    requests_that_do_not_leave_are_decided_anew {
        for unsent in [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed] {
            let mut bus = Bus::<B>::found().moving();
            bus.line.head_mut().port = Port::Fails(40, unsent);
            bus.line.tail_mut(1).slave.port = Port::Fails(5, unsent);
            bus.stop(N1);
            bus.run(1500);
            assert_eq!(bus.line.head().failed, 40);
            bus.stands_still(&[N1]);
        }
    }

    old_bytes_are_no_answers_and_no_fresh_commands {
        let watch = |config: &mut SlaveConfig| config.watchdog = Some(Duration::from_millis(200));
        let mut bus = Bus::<B>::with(|_| {}, watch).discovered().moving();
        let now = bus.line.now();
        let (since, later) = (now, now + Duration::from_millis(500));
        let frame = bus.line.trace().iter().rev().take(600).map(|it| it.byte);
        let bytes: Vec<u8> = frame.collect::<Vec<_>>().into_iter().rev().collect();
        let master = bus.line.head_mut();
        master.handle_input(&bytes, Arrival::Between { since, now: later });
        master.handle_timeout(later);
        while master.poll_event().is_some() {}
        let slave = &mut bus.line.tail_mut(0).slave;
        slave.handle_input(&bytes, Arrival::Between { since, now: later });
        slave.handle_timeout(later);
        while slave.poll_event().is_some() {}
        while slave.poll_transmit(later).is_some() {}
        slave.check();
        assert_eq!(slave.rust().command(later), None);
    }
}

#[test]
fn settings_are_those_of_the_crate_in_both_directions() {
    let mut master = master_config(&MasterConfig::usb_adapter());
    let expected = master;
    master.baud = 1;
    assert_eq!(axle_ikeya_master_config_usb_adapter(&mut master), AXLE_OK);
    same(master, expected);
    assert_eq!(axle_ikeya_master_config_direct(&mut master), AXLE_OK);
    same(master, master_config(&MasterConfig::direct()));

    let mut slave = slave_config(&SlaveConfig::usb_adapter());
    let expected = slave;
    slave.baud = 1;
    assert_eq!(axle_ikeya_slave_config_usb_adapter(&mut slave), AXLE_OK);
    same(slave, expected);
    assert_eq!(axle_ikeya_slave_config_direct(&mut slave), AXLE_OK);
    same(slave, slave_config(&SlaveConfig::direct()));
}

#[test]
fn positions_are_split_and_added_up_as_in_the_crate() {
    for counts in [0, 1, -1, 8191, 8192, -8192, 12_288, -12_288, 268_435_455, -268_443_647] {
        let position = Position::from_counts(counts).unwrap();
        let expected =
            axle_ikeya_position { rotation: position.rotation(), count: position.count() };
        let mut split = axle_ikeya_position::default();
        assert_eq!(axle_ikeya_position_from_counts(counts, &mut split), AXLE_OK);
        assert_eq!((split, axle_ikeya_position_counts(split)), (expected, counts));
    }
    let mut split = axle_ikeya_position::default();
    for counts in [268_435_456, -268_443_648, i32::MAX, i32::MIN] {
        assert_eq!(axle_ikeya_position_from_counts(counts, &mut split), AXLE_ERROR_POSITION);
    }
}
