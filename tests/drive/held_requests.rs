//! Requests that a port holds back, so that their answers come when they are no longer expected.

use crate::{dice::Dice, rig::*};

/// One step of virtual time, microseconds.
const STEP_US: u64 = 20;

/// A master with node 2, which turns, and node 5, which answers with the time.
struct Clocked {
    story: Story,
    dice: Dice,
    is_async: bool,
    window_us: usize,
    /// The measurement that was taken last.
    seen: Option<Instant>,
    taken: usize,
}

impl Clocked {
    fn new(seed: u64, is_async: bool) -> Self {
        let mut dice = Dice(seed);
        let mut config = only_two_and_five();
        let is_adapter = dice.one_in(2);
        if is_adapter {
            let nodes = config.nodes;
            (config, config.nodes) = (MasterConfig::usb_adapter(), nodes);
        }
        let story = Story::new(config);
        let (world, five) = (story.world.clone(), story.five.clone());
        for node in [&story.two, &story.five] {
            node.borrow_mut().port_mut().delay_us = if is_adapter { 15_000 } else { 0 };
        }
        story.world.add(move || {
            let steps = (world.now().as_micros() / STEP_US) as i32;
            let at = Position::from_counts(steps).unwrap();
            five.borrow_mut().role_mut().set_position(at);
        });
        let window_us = if is_adapter { 20_240 } else { 740 };
        Self { story: story.discovered(), dice, is_async, window_us, seen: None, taken: 0 }
    }

    /// One call, on a port that may stall, hold back, and fail.
    fn call(&mut self, may_fail: bool) {
        let mut some_us = || match self.dice.one_in(3) {
            true => self.dice.below(self.window_us * 4) as u64,
            false => 0,
        };
        let (stall_us, flush_us, hold_us, pause_us) = (some_us(), some_us(), some_us(), some_us());
        let (fails, drops) = (self.dice.one_in(3), may_fail && self.dice.one_in(3));
        let polls = 1 + self.dice.below(40);
        let now_us = self.story.world.now().as_micros();
        let port = self.story.bus.port_mut();
        if may_fail && self.dice.one_in(8) {
            let step = |us| if us == 0 { Step::Few(usize::MAX) } else { Step::Blocks(us) };
            port.writes = [step(stall_us)].into();
            port.flushes =
                [if fails { Step::BlocksAndFails(flush_us) } else { step(flush_us) }].into();
            port.holds_until_us = now_us + hold_us;
        }
        let _ = match self.is_async {
            false => Some(self.story.bus.service()),
            true => self.story.world.run(drops.then_some(polls), self.story.bus.asynch().service()),
        };
        let wake_at = self.story.bus.poll_timeout().unwrap_or_default();
        while self.story.world.now() < wake_at && !self.story.bus.port().has_arrived() {
            self.story.world.pass(STEP_US);
        }
        if may_fail && self.dice.one_in(6) {
            self.story.world.pass(pause_us);
        }
    }

    /// Both nodes have answered to the last request.
    fn is_healthy(&self) -> bool {
        let role = self.story.bus.role();
        [NodeId::N2, NodeId::N5].map(|node| role.health(node)) == [Some(Health::Online); 2]
    }

    /// No answer counts that was measured before its request was given to the port.
    fn check(&mut self) {
        while self.story.bus.poll_event().is_some() {}
        let Some((Status::Position(at), heard_at)) = self.story.bus.role().status(NodeId::N5)
        else {
            return;
        };
        if self.seen.replace(heard_at) == Some(heard_at) {
            return;
        }
        self.taken += 1;
        let port = self.story.bus.port();
        let read = ReadRequest::new(NodeId::N5);
        let (mut end, mut asked_us) = (0, 0);
        for offer in &port.offers {
            end += offer.taken;
            if port.written[..end].ends_with(read.as_bytes()) && offer.at_us < heard_at.as_micros()
            {
                asked_us = offer.at_us;
            }
        }
        let measured_us = at.counts() as u64 * STEP_US;
        // It is set once in each step.
        assert!(
            measured_us + 2 * STEP_US >= asked_us,
            "measured at {measured_us} us, asked at {asked_us} us, heard at {heard_at:?}"
        );
    }
}

#[test]
fn no_answer_counts_that_was_measured_before_its_request_was_given_to_the_port() {
    for is_async in BOTH {
        let mut taken = 0;
        for seed in 0..6 {
            let mut clocked = Clocked::new(seed, is_async);
            for _ in 0..200 {
                clocked.call(true);
                clocked.check();
            }
            taken += clocked.taken;
            // The port is good again.
            let healed_at = clocked.story.world.now();
            while !clocked.is_healthy() {
                clocked.call(false);
                let took = clocked.story.world.now() - healed_at;
                assert!(took < Duration::from_millis(5000), "seed {seed}, async {is_async}");
            }
        }
        assert!(taken > 30, "{taken} answers, async {is_async}");
    }
}
