//! A master, a slave and a host behind drivers whose ports fail: what still stops.

use std::{
    pin::pin,
    sync::Arc,
    task::{Context, Waker},
};

use axlewire::sim::MotorNode;

use crate::{port::Wakes, rig::*};

// The calls under test.

fn set_velocity(bus: &mut Bus, value: f32) -> Result<(), DriveError<Unplugged>> {
    bus.set_velocity(NodeId::N1, Rps::new(value).unwrap())
}

fn stop(story: &mut Story, is_async: bool) -> Result<(), DriveError<Unplugged>> {
    call!(is_async, story.bus, stop(NodeId::N1))
}

// The bus.

/// A master and node 1 with its motor, which runs whenever virtual time passes.
struct Story {
    world: World,
    bus: Bus,
    node: Running<MotorNode>,
}

impl Story {
    fn new(config: MasterConfig, mode: Mode) -> Self {
        let world = World::default();
        let (near, far) = Port::pair(&world, 20);
        let node = run(MotorNode::new(NodeId::N1, mode), far);
        Self { bus: on(Master::new(config, world.now()), near), world, node }
    }

    /// A story whose velocity node has been found and turns at 10 rps.
    fn at_10_rps(config: MasterConfig) -> Self {
        let mut story = Self::new(config, Mode::Velocity);
        story.bus.discover().unwrap();
        set_velocity(&mut story.bus, 10.0).unwrap();
        story.pass(500);
        assert!(story.rps() > 9.9);
        story
    }

    /// Lets the motor run without calling the driver.
    fn pass(&self, millis: u32) {
        (0..millis).for_each(|_| self.world.step(1000));
    }

    /// Runs the driver, ignoring its errors.
    fn run(&mut self, millis: u32) {
        let end = self.world.now() + ms(millis);
        while self.world.now() < end {
            let span = end - self.bus.now();
            let _ = self.bus.run_for(span, |_, _, _| ());
            self.world.step(20);
        }
    }

    /// The node no longer takes part in anything; it continues its last command.
    fn unplug_node(&self) {
        self.node.borrow().port().unplugged.set(true);
    }

    fn rps(&self) -> f32 {
        self.node.borrow().role().motor().velocity().get()
    }

    fn revolutions(&self) -> f64 {
        self.node.borrow().role().motor().position().revolutions()
    }
}

// Stops that are reported as done

#[test]
fn a_stop_after_a_pause_of_the_driver_leaves_a_position_node_where_it_is() {
    let mut story = Story::new(MasterConfig::usb_adapter(), Mode::Position);
    story.bus.discover().unwrap();
    story.bus.set_position(NodeId::N1, Position::new(0, 50)).unwrap();
    story.pass(2000);
    let before = story.revolutions();
    assert!(before > 9.0, "it is not moving");
    stop(&mut story, false).unwrap();
    story.run(3000);
    let way = story.revolutions() - before;
    assert!(way.abs() < 1.0, "the shaft returned to an old position: {way} turns");
}

/// Turns by which a position node is wrong after a stop that was reported as done. Before it, the
/// driver paused with an answer on its way, and then this happened to its port.
fn turns_off(config: MasterConfig, is_async: bool, spoil: &dyn Fn(&mut Port)) -> f64 {
    let mut story = Story::new(config, Mode::Position);
    story.bus.discover().unwrap();
    story.bus.set_position(NodeId::N1, Position::new(0, 50)).unwrap();
    let written = story.bus.port().written.len();
    while story.bus.port().written.len() < written + ReadRequest::LEN {
        story.bus.service().unwrap();
        story.world.step(10);
    }
    story.pass(2000);
    spoil(story.bus.port_mut());
    let before = story.revolutions();
    assert!(before > 9.0, "it is not moving");
    stop(&mut story, is_async).unwrap();
    story.run(500);
    (story.revolutions() - before).abs()
}

#[test]
fn an_answer_behind_a_failing_receiver_is_not_taken_for_a_later_one() {
    for config in [MasterConfig::direct(), MasterConfig::usb_adapter()] {
        for (reads, is_async) in (0..9).flat_map(|reads| [(reads, false), (reads, true)]) {
            let turns =
                turns_off(config, is_async, &|port| port.reads = vec![Step::Error; reads].into());
            assert!(turns < 1.0, "{reads} failing reads, async {is_async}: {turns} turns");
        }
    }
}

#[test]
fn an_answer_behind_more_bytes_than_a_round_reads_is_not_taken_for_a_later_one() {
    for config in [MasterConfig::direct(), MasterConfig::usb_adapter()] {
        for (count, is_async) in
            [0, 4000, 50_000, 60_000].map(|n| [(n, false), (n, true)]).as_flattened()
        {
            let turns = turns_off(config, *is_async, &|port| {
                (0..*count).for_each(|_| port.inbox.borrow_mut().push_front((0, 0x55)));
            });
            assert!(turns < 1.0, "{count} bytes of noise, async {is_async}: {turns} turns");
        }
    }
}

#[test]
fn an_answer_that_another_driver_finds_in_its_port_is_not_taken_for_a_later_one() {
    let mut story = Story::new(MasterConfig::usb_adapter(), Mode::Position);
    story.bus.discover().unwrap();
    story.bus.set_position(NodeId::N1, Position::new(0, 50)).unwrap();
    story.bus.port_mut().is_deaf = true;
    // The answer to the first READ is not read, and the second READ is sent past it.
    for pause_us in [2_000_000, 500] {
        let reads = story.bus.role().statistics().reads;
        while story.bus.role().statistics().reads == reads {
            let _ = story.bus.service();
            story.world.step(10);
        }
        story.world.step(pause_us);
    }
    story.bus.port_mut().is_deaf = false;
    story.bus = in_another_driver(story.bus);
    let now = story.bus.now();
    story.bus.service().unwrap();
    let (_, heard_at) = story.bus.role().status(NodeId::N1).unwrap();
    assert!(heard_at < now, "the old answer counts as the new one");
    story.run(30);
    let (_, heard_at) = story.bus.role().status(NodeId::N1).unwrap();
    assert!(heard_at > now, "the next answer does not count");
}

#[test]
fn an_answer_that_a_driver_finds_in_another_port_is_not_taken_for_a_later_one() {
    let mut story = Story::new(MasterConfig::usb_adapter(), Mode::Position);
    story.bus.discover().unwrap();
    story.bus.role_mut().read(NodeId::N1, story.world.now()).unwrap();
    let reads = story.bus.role().statistics().reads;
    while story.bus.role().statistics().reads == reads {
        story.bus.service().unwrap();
        story.world.step(10);
    }
    story.world.step(500);
    let now = story.bus.now();
    // The other one has been listening to the line for long.
    story.bus.port().inbox.borrow_mut().clear();
    let old = PositionResponse::new(NodeId::N1, Position::new(0, 3));
    story.bus.port().receive(old.as_bytes());
    story.world.step(200);
    story.bus.discard();
    story.bus.service().unwrap();
    let (_, heard_at) = story.bus.role().status(NodeId::N1).unwrap();
    assert!(heard_at < now, "the old answer counts as the new one");
}

#[test]
fn a_stop_in_another_driver_does_not_wait_for_a_flush_that_was_not_made() {
    let mut story = Story::at_10_rps(MasterConfig::direct());
    story.bus.port_mut().flushes = vec![Step::Stall].into();
    while !story.bus.port().flushes.is_empty() {
        let _ = story.world.run(Some(2), story.bus.asynch().service());
        story.world.step(20);
    }
    story.world.step(500);
    story.bus.port().inbox.borrow_mut().clear();
    let (mut role, port, clock) = story.bus.into_parts();
    // Nor does a role that is driven by hand from then on.
    let (now, mut alone) = (story.world.now(), role.clone());
    alone.stop(NodeId::N1, now);
    let stop = WriteRequest::velocity(NodeId::N1, Rps::ZERO);
    let is_sent = (0..5000).step_by(20).any(|us| {
        let now = now + Duration::from_micros(us);
        alone.handle_timeout(now);
        alone.poll_transmit(now) == Some(stop.as_bytes())
    });
    assert!(is_sent, "the stop is late");
    role.stop(NodeId::N1, now);
    story.bus = On::new(role, port, clock);
    story.run(5);
    let command = story.node.borrow().role().slave().command(now);
    assert_eq!(command, Some(Target::Velocity(Rps::ZERO)), "the stop is late");
}

#[test]
fn a_stop_of_an_abnormal_node_is_no_success() {
    for is_async in BOTH {
        let mut story = Story::at_10_rps(MasterConfig::direct());
        story.unplug_node();
        story.run(200);
        assert_eq!(story.bus.role().health(NodeId::N1), Some(Health::Abnormal));
        let stopped = stop(&mut story, is_async);
        assert!(stopped.is_err(), "an abnormal node is reported as stopped");
    }
}

#[test]
fn a_stop_of_all_on_a_fresh_master_is_no_success() {
    let mut story = Story::new(MasterConfig::direct(), Mode::Velocity);
    let stopped = story.bus.stop_all();
    assert!(stopped.is_err(), "no node was asked, but all are reported as stopped");
}

// Failing receivers

#[test]
fn a_receiver_that_fails_does_not_hold_up_the_stop_of_a_motor() {
    for is_async in BOTH {
        let mut story = Story::at_10_rps(MasterConfig::direct());
        story.bus.port_mut().is_deaf = true;
        for _ in 0..20 {
            assert!(stop(&mut story, is_async).is_err(), "nothing can be received");
            story.world.step(500);
        }
        story.pass(1000);
        assert!(story.rps().abs() < 0.05, "twenty stops, but the motor keeps running");
    }
}

#[test]
#[cfg(feature = "ucp")]
fn a_receiver_that_fails_does_not_hold_up_the_stop_of_a_rover() {
    for is_async in BOTH {
        let mut rover = host();
        rover.port_mut().is_deaf = true;
        let world = rover.port().world.clone();
        for _ in 0..1000 {
            let stopped = call!(is_async, rover, stop());
            assert_eq!(stopped, Ok(()), "nothing can be received, but the stop has left");
            world.step(100);
        }
        // The first frame is a motor command.
        let id = rover.port().written.get(4);
        assert_eq!(id, Some(&2), "a thousand stops, but not a byte");
        // A call that needs an answer fails.
        let report = call!(is_async, rover, next_report(ms(50)));
        assert_eq!(report, Err(GONE));
    }
}

#[test]
fn a_receiver_that_fails_does_not_leave_the_driver_enable_pin_on() {
    for is_async in BOTH {
        let (world, pin) = (World::default(), Pin::default());
        let (mut port, mut far) = Port::pair(&world, 20);
        port.is_deafened = true;
        let slave = Slave::new(NodeId::N2, Mode::Velocity, SlaveConfig::direct(), at_ms(0));
        let port = Rs485::new(port, pin.clone()).unwrap();
        let mut node = On::new(slave, port, world.clone());
        let read = ReadRequest::new(NodeId::N2);
        embedded_io::Write::write(&mut far, read.as_bytes()).unwrap();
        world.step(100);
        for _ in 0..1000 {
            let _ = match is_async {
                true => world.block_on(node.asynch().service()),
                false => node.service(),
            };
            world.step(10);
        }
        assert_eq!(node.role().statistics().replies, 1);
        assert!(!is_on(&pin.log), "the driver stays enabled and blocks the bus");
    }
}

#[test]
fn an_async_call_on_a_port_that_fails_at_once_lets_other_tasks_run() {
    let port = Port { is_deaf: true, is_mute: true, ..Port::default() };
    let world = port.world.clone();
    let mut bus: Bus = on(Master::new(MasterConfig::direct(), at_ms(0)), port);
    let now = bus.now();
    bus.role_mut().stop(NodeId::N1, now);
    let mut careless = pin!(async {
        for _ in 0..100 {
            let within = at_ms(60_000) - bus.now();
            let _ = bus.asynch().next_event(within).await;
        }
    });
    let wakes = Arc::new(Wakes::default());
    let waker = Waker::from(wakes.clone());
    let (mut pauses, mut woken) = (0, 0);
    while careless.as_mut().poll(&mut Context::from_waker(&waker)).is_pending() {
        pauses += 1;
        assert!(pauses < 1_000_000, "it never wakes up");
        if wakes.count() == woken {
            // It waits for time to pass.
            world.step(20);
        }
        woken = wakes.count();
    }
    assert!(pauses >= 100, "a loop that ignores errors lets no other task run");
}

// Failing senders

#[test]
fn a_set_point_of_which_no_byte_has_left_is_not_sent_late() {
    let mut story = Story::new(MasterConfig::direct(), Mode::Velocity);
    story.bus.discover().unwrap();
    story.bus.port_mut().is_mute = true;
    assert!(set_velocity(&mut story.bus, 10.0).is_err());
    story.pass(10_000);
    story.bus.port_mut().is_mute = false;
    stop(&mut story, false).unwrap();
    let old = WriteRequest::velocity(NodeId::N1, Rps::new(10.0).unwrap());
    let mut written = story.bus.port().written.windows(WriteRequest::LEN);
    let is_sent = written.any(|packet| packet == old.as_bytes());
    assert!(!is_sent, "a ten-second-old set-point is sent before the stop");
}

#[test]
fn a_stop_whose_packet_was_discarded_is_written_again() {
    let mut story = Story::at_10_rps({
        let mut config = MasterConfig::direct();
        config.polling = Polling::Manual;
        config
    });
    story.bus.port_mut().is_mute = true;
    assert!(stop(&mut story, false).is_err());
    story.bus.discard();
    story.bus.port_mut().is_mute = false;
    story.run(1000);
    let is_still = story.rps().abs() < 0.05;
    assert!(is_still, "the stop is discarded for good, and the motor keeps running");
}
