//! Waiting for events: until the deadline and no longer, serving the role in between.

use crate::rig::*;

#[test]
fn on_a_silent_line_next_event_waits_until_the_deadline_and_no_longer() {
    let world = World::default();
    let (near, _far) = Port::pair(&world, 20);
    let mut driver = on(Recorder::default(), near);
    let within = at_ms(10) - driver.now();
    assert_eq!(driver.next_event(within), Ok(None));
    assert_eq!(world.now(), at_ms(10));
    let within = at_ms(20) - driver.now();
    assert_eq!(world.block_on(driver.asynch().next_event(within)), Ok(None));
    assert_eq!(world.now(), at_ms(20));
    // A deadline in the past takes no time, but still runs a round.
    driver.role_mut().frames.push_back(b"12".into());
    let within = at_ms(0) - driver.now();
    assert_eq!(driver.next_event(within), Ok(None));
    assert_eq!(driver.port().outboxes[0].borrow().len(), 2);
    driver.role_mut().frames.push_back(b"34".into());
    let within = at_ms(0) - driver.now();
    assert_eq!(world.block_on(driver.asynch().next_event(within)), Ok(None));
    assert_eq!(driver.port().outboxes[0].borrow().len(), 4);
    assert_eq!(world.now(), at_ms(20));
}

#[test]
fn a_waiting_driver_wakes_for_its_role() {
    let world = World::default();
    let (near, _far) = Port::pair(&world, 20);
    let mut driver = on(Recorder::default(), near);
    driver.role_mut().timeout = Some(at_ms(5));
    let within = at_ms(10) - driver.now();
    assert_eq!(world.block_on(driver.asynch().next_event(within)), Ok(None));
    let is_none = |call: &Call| matches!(call, Call::Input(bytes) if bytes.is_empty());
    let calls: Vec<_> = driver.role().calls.iter().filter(|call| !is_none(call)).collect();
    assert_eq!(calls.iter().filter(|call| ***call == Call::Timeout).count(), 1);
    // Wakes only for the role: a round at the start, at 5 ms and at the end.
    assert_eq!(calls.len(), 4, "{calls:?}");
}

#[test]
fn every_event_is_handed_out_until_the_deadline() {
    let world = World::default();
    let (near, mut far) = Port::pair(&world, 20);
    embedded_io::Write::write(&mut far, b"abc").unwrap();
    let mut driver = on(Recorder::default(), near);
    let mut events = vec![];
    let span = at_ms(1) - driver.now();
    driver.run_for(span, |_, event, _| events.push(event)).unwrap();
    assert_eq!((&events[..], world.now()), (&b"abc"[..], at_ms(1)));
    embedded_io::Write::write(&mut far, b"def").unwrap();
    let span = at_ms(2) - driver.now();
    let run = driver.asynch().run_for(span, |role, event, _| {
        events.push(event);
        role.frames.push_back(vec![event]);
    });
    world.block_on(run).unwrap();
    assert_eq!((&events[..], world.now()), (&b"abcdef"[..], at_ms(2)));
    assert_eq!(driver.port().outboxes[0].borrow().len(), 3);
}

#[test]
fn a_run_ends_at_its_deadline_although_more_events_wait() {
    for is_async in BOTH {
        let world = World::default();
        let (near, mut far) = Port::pair(&world, 20);
        embedded_io::Write::write(&mut far, b"abc").unwrap();
        world.step(1000);
        let mut driver = on(Recorder::default(), near);
        let (mut events, mut times) = (vec![], vec![]);
        // The application takes 4 ms for each event.
        let slow = |_: &mut Recorder, event, now| {
            events.push(event);
            times.push(now);
            world.step(4000);
        };
        let span = at_ms(5) - driver.now();
        call!(is_async, driver, run_for(span, slow)).unwrap();
        assert_eq!((&events[..], &times[..]), (&b"ab"[..], &[at_ms(1), at_ms(5)][..]));
        assert_eq!(driver.poll_event(), Some(b'c'), "it waits");
    }
}

/// A role with only the required methods.
#[derive(Default)]
struct Plain {
    heard: Vec<(Vec<u8>, Instant)>,
    timeout: Option<Instant>,
}

impl Endpoint for Plain {
    type Event = ();
    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let now = arrived.into().now();
        self.heard.push((bytes.to_vec(), now));
    }
    fn handle_timeout(&mut self, _: Instant) {}
    fn poll_transmit(&mut self, _: Instant) -> Option<&[u8]> {
        None
    }
    fn poll_event(&mut self) -> Option<()> {
        None
    }
    fn poll_timeout(&self) -> Option<Instant> {
        self.timeout
    }
}

#[test]
fn a_role_whose_deadline_has_always_passed_does_not_block_its_driver() {
    let late = Plain { timeout: Some(at_ms(0)), ..Plain::default() };
    let world = World::default();
    let mut driver = on(late, Port::new(&world, 20));
    let within = at_ms(1) - driver.now();
    assert_eq!(driver.next_event(within), Ok(None));
    assert_eq!(world.now(), at_ms(1));
}

#[test]
fn by_default_a_role_treats_old_bytes_as_new_and_loses_what_did_not_leave() {
    let mut role = Plain::default();
    role.handle_input(b"12", Arrival::Between { since: at_ms(1), now: at_ms(9) });
    role.handle_transmit(Unsent::CutOff, at_ms(9));
    assert_eq!(role.heard, [(b"12".to_vec(), at_ms(9))]);
    assert!(role.poll_transmit(at_ms(9)).is_none() && !role.is_outdated());
}

#[test]
fn by_default_frames_may_pause_for_20_ms_and_take_no_time() {
    let rules = Plain::default().line_rules();
    assert_eq!(rules, LineRules { frame_pause: ms(20), baud: 0, held_up_after: None });
    assert_eq!(rules.wire_time(64), Duration::ZERO);
}

#[test]
fn while_a_frame_or_its_flush_is_pending_the_next_round_is_due_within_a_millisecond() {
    let mut driver = on(Recorder::sending(&[b"123"]), Port::writing([Step::Few(1), Step::Error]));
    assert_eq!(driver.poll_timeout(), None);
    assert_eq!(driver.service(), Err(GONE));
    assert_eq!(driver.unsent(), b"23");
    let now = driver.now();
    assert_eq!(driver.poll_timeout(), Some(now + ms(1)));
    assert_eq!(driver.service(), Ok(()));
    assert_eq!(driver.poll_timeout(), None);
    // A call that is dropped before the frame has left, or before it was flushed.
    for polls in [1, 2] {
        let mut driver = on(Recorder::sending(&[b"123"]), Port::new(&World::default(), 20));
        driver.port_mut().stutters = true;
        let world = driver.port().world.clone();
        assert_eq!(world.poll_times(polls, driver.asynch().service()), None);
        let now = driver.now();
        assert!(driver.poll_timeout() <= Some(now + ms(1)) && driver.poll_timeout().is_some());
        assert_eq!(world.block_on(driver.asynch().service()), Ok(()));
        assert_eq!(driver.poll_timeout(), None, "{polls}");
    }
}
