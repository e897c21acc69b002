//! A slave that is called late, or whose switch is moved, neither obeys nor sends outdated data.

use crate::{motor_line::Wire, rig::*};

const FIVE_RPS: fn() -> WriteRequest =
    || WriteRequest::velocity(NodeId::N1, Rps::new(5.0).unwrap());

fn one_slave(wire: &Wire, config: SlaveConfig) -> On<Slave> {
    wire.driver(|now| Slave::new(NodeId::N1, Mode::Velocity, config, now))
}

fn command(slave: &On<Slave>) -> Option<Target<OneMotor>> {
    slave.role().command(slave.port().world.now())
}

#[test]
fn an_answer_that_was_cut_off_is_given_up_when_another_request_is_heard_at_once() {
    for (is_async, late_us) in [(false, 0), (true, 0), (false, 5000), (true, 5000)] {
        let wire = Wire::bus(None);
        let config = SlaveConfig::usb_adapter();
        let mut slave = one_slave(&wire, config);
        wire.receive(ReadRequest::new(NodeId::N1).as_bytes());
        wire.write_only(4);
        assert!(slave.service().is_err());
        wire.world.step(late_us);
        wire.receive(ReadRequest::new(NodeId::N2).as_bytes());
        wire.write_all();
        call!(is_async, slave, service()).unwrap();
        assert_eq!(wire.sent().len(), 4, "it talks during node 2's turn");
        // Nothing was received: the rest may be sent.
        let wire = Wire::bus(None);
        let mut slave = one_slave(&wire, config);
        wire.receive(ReadRequest::new(NodeId::N1).as_bytes());
        wire.write_only(4);
        assert!(slave.service().is_err());
        wire.write_all();
        slave.service().unwrap();
        assert_eq!(wire.sent().len(), 8);
    }
}

#[test]
fn bytes_from_before_a_hold_up_do_not_drive_a_motor() {
    let wire = Wire::bus(None);
    let mut slave = one_slave(&wire, with_watchdog());
    wire.receive(FIVE_RPS().as_bytes());
    slave.service().unwrap();
    assert!(command(&slave).is_some());
    wire.world.step(1000);
    wire.receive(FIVE_RPS().as_bytes());
    wire.receive(ReadRequest::new(NodeId::N1).as_bytes());
    wire.world.step(10_000_000);
    slave.service().unwrap();
    assert_eq!(command(&slave), None, "it turns on a ten-second-old command");
    assert_eq!(*wire.sent(), [], "it answers a ten-second-old request");
    let events: Vec<_> = std::iter::from_fn(|| slave.poll_event()).collect();
    assert_eq!(events, [SlaveEvent::Watchdog]);
}

#[test]
fn a_command_does_not_outlive_its_watchdog_while_an_answer_is_flushed() {
    let (slow, fails) = (Step::Blocks(700_000), Step::BlocksAndFails(700_000));
    for (first, flush) in [(None, slow), (None, fails.clone()), (Some(Step::Error), fails)] {
        for (is_async, is_polled) in BOTH.into_iter().flat_map(|it| BOTH.map(|by| (it, by))) {
            let wire = Wire::bus(None);
            let mut slave = idle_slave(&wire, with_watchdog());
            slave.port_mut().flushes.extend(first.clone());
            wire.receive(ReadRequest::new(NodeId::N1).as_bytes());
            assert_eq!(slave.service().is_ok(), first.is_none());
            wire.world.step(2000);
            wire.receive(FIVE_RPS().as_bytes());
            wire.receive(ReadRequest::new(NodeId::N1).as_bytes());
            wire.world.step(200);
            slave.port_mut().flushes = [flush.clone()].into();
            if is_polled {
                let _ = call!(is_async, slave, service());
                assert_eq!(events(&mut slave), [SlaveEvent::Watchdog]);
            } else {
                let heard = call!(is_async, slave, next_command(Duration::ZERO));
                assert_eq!(heard, Ok(Some(SlaveEvent::Watchdog)), "instead of its command");
                assert_eq!(events(&mut slave), []);
            }
            assert_eq!(command(&slave), None);
        }
    }
}

#[test]
fn a_command_does_not_outlive_its_watchdog_while_another_task_runs() {
    let wire = Wire::bus(None);
    let mut slave = idle_slave(&wire, with_watchdog());
    wire.receive(FIVE_RPS().as_bytes());
    wire.world.step(200);
    slave.port_mut().reads = [Step::Few(usize::MAX), Step::Error].into();
    let heard = {
        let within = at_ms(60_000) - slave.now();
        let mut call = std::pin::pin!(slave.asynch().next_command(within));
        assert!(poll(call.as_mut()).is_pending(), "it yields behind an error");
        wire.world.step(5_000_000);
        wire.world.block_on(call)
    };
    assert_eq!(heard, Ok(Some(SlaveEvent::Watchdog)), "instead of a command that is 5 s old");
}

/// A slave that has received nothing yet, and its watchdog.
fn idle_slave(wire: &Wire, config: SlaveConfig) -> On<Slave> {
    let mut slave = one_slave(wire, config);
    slave.service().unwrap();
    slave
}

fn with_watchdog() -> SlaveConfig {
    let mut config = SlaveConfig::direct();
    config.watchdog = Some(Duration::from_millis(500));
    config
}

#[test]
fn an_idle_slave_that_was_held_up_neither_obeys_nor_answers() {
    for is_async in [false, true] {
        let wire = Wire::bus(None);
        let mut slave = idle_slave(&wire, with_watchdog());
        wire.receive(FIVE_RPS().as_bytes());
        wire.receive(ReadRequest::new(NodeId::N1).as_bytes());
        wire.world.step(10_000_000);
        call!(is_async, slave, service()).unwrap();
        assert_eq!(command(&slave), None, "it turns on a ten-second-old command");
        assert_eq!(*wire.sent(), [], "it answers a ten-second-old request");
        assert_eq!(slave.role().statistics().expired, 1);
        assert_eq!(slave.poll_event(), Some(SlaveEvent::Watchdog));
    }
}

#[test]
fn a_slave_whose_executor_was_held_neither_obeys_nor_answers() {
    let wire = Wire::bus(None);
    let mut slave = idle_slave(&wire, with_watchdog());
    let bytes =
        [FIVE_RPS().as_bytes().repeat(20), ReadRequest::new(NodeId::N1).as_bytes().to_vec()];
    let event = wire.block_on_held(
        slave.asynch().next_event(Duration::from_millis(1000)),
        &bytes.concat(),
        3_000_000,
    );
    // Events reported before the rest has been taken in do not count.
    let _ = event.unwrap();
    wire.world.block_on(slave.asynch().service()).unwrap();
    assert_eq!(command(&slave), None, "it turns on a three-second-old command");
    assert_eq!(*wire.sent(), [], "it answers a three-second-old request");
}

#[test]
fn an_idle_slave_answers_a_request_after_a_long_silence() {
    // At several moments between two looks at its port.
    let silences_us = [2_345_678, 2_348_678, 2_351_678];
    for (is_async, silence_us) in BOTH.into_iter().flat_map(|it| silences_us.map(|us| (it, us))) {
        let wire = Wire::bus(None);
        let mut slave = idle_slave(&wire, SlaveConfig::direct());
        let begin_us = wire.world.now_us();
        wire.receive_in(silence_us, ReadRequest::new(NodeId::N1).as_bytes());
        call!(is_async, slave, run_for(Duration::from_millis(3000), |_, _, _| ())).unwrap();
        assert_eq!(wire.sent().len(), 8, "async {is_async}");
        let delay_us = wire.sent()[0].0 - begin_us - silence_us;
        assert!(delay_us < 200, "async {is_async}: it answered after {delay_us} us");
    }
}

#[test]
fn a_slave_that_is_called_when_its_driver_asks_for_it_or_bytes_come_answers() {
    let wire = Wire::bus(None);
    let mut slave = idle_slave(&wire, SlaveConfig::direct());
    let read_us = wire.world.now_us() + 1_234_567;
    wire.receive_in(1_234_567, ReadRequest::new(NodeId::N1).as_bytes());
    while wire.world.now_us() < 2_000_000 {
        let at_us = slave.poll_timeout().unwrap().as_micros();
        let now_us = wire.world.now_us();
        let bytes_us = Some(read_us).filter(|&at| at > now_us).unwrap_or(u64::MAX);
        // A 1 ms timer is up to a millisecond late; the receive interrupt is not.
        let wake_us = bytes_us.min(at_us.next_multiple_of(1000) + 1000);
        wire.world.step(wake_us.saturating_sub(now_us).max(1));
        slave.service().unwrap();
    }
    assert_eq!(wire.sent().len(), 8);
}

#[test]
fn a_command_that_a_held_up_slave_finds_half_arrived_is_not_lost() {
    let wire = Wire::bus(None);
    let mut slave = idle_slave(&wire, SlaveConfig::direct());
    wire.world.step(30_000);
    wire.receive(&FIVE_RPS().as_bytes()[..5]);
    slave.service().unwrap();
    wire.receive_in(60, &FIVE_RPS().as_bytes()[5..]);
    wire.world.step(60);
    slave.service().unwrap();
    assert!(command(&slave).is_some(), "the delay cut a WRITE in two");
}

#[test]
fn a_slave_whose_port_takes_no_answer_hears_of_its_watchdog_in_time() {
    let config = with_watchdog();
    let watchdog = config.watchdog.unwrap();
    let wire = Wire::bus(None);
    let mut slave = one_slave(&wire, config);
    wire.receive(FIVE_RPS().as_bytes());
    wire.world.block_on(slave.asynch().next_command(ms(1))).unwrap().unwrap();
    let commanded = wire.world.now();
    wire.write_with(|_| Step::Stall);
    wire.receive(ReadRequest::new(NodeId::N1).as_bytes());
    while command(&slave).is_some() {
        wire.world.block_on(slave.asynch().next_command(ms(1000))).unwrap();
    }
    assert!(wire.world.now() - commanded <= watchdog + ms(5), "{:?}", wire.world.now());
}
