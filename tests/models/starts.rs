//! The worlds of the motor bus, and their initial states.

use super::{
    action::{Action, Answer, Call, Exchange, Fate, Menu, Wait},
    bus::Bus,
    names::*,
};

const VELOCITY: &[Mode] = &[Mode::Velocity];
const POSITION: &[Mode] = &[Mode::Position];
const BOTH: &[Mode] = &[Mode::Velocity, Mode::Position];
const POSITIONS: &[Mode] = &[Mode::Position, Mode::Position];

impl<B: Kit> Bus<B> {
    /// All nodes have been discovered.
    fn known(modes: &[Mode], config: MasterConfig, menu: Menu) -> Self {
        let found = [Action::Exchange(Exchange::Right)].repeat(modes.len());
        Self::new(modes, config, menu).after(&[Action::Call(Call::Discover)]).after(&found)
    }

    /// Node 1 has a set-point.
    fn under_set_point(self) -> Self {
        let exchange = Action::Exchange(Exchange::Right);
        self.after(&[Action::Call(Call::Set(NodeId::N1)), exchange, exchange])
    }

    /// Node 1 has missed this many requests in a row.
    fn missed(mut self, times: u8) -> Self {
        let target = times + self.misses_in_all(NodeId::N1);
        for _ in 0..60 {
            if self.misses_in_all(NodeId::N1) == target {
                return self;
            }
            let silent = self.clone().after(&[Action::Exchange(Exchange::Silent)]);
            let is_asked = silent.misses_in_all(NodeId::N1) > self.misses_in_all(NodeId::N1);
            let right = Action::Exchange(Exchange::Right);
            self = if is_asked { silent } else { self.after(&[right]) };
        }
        panic!("node 1 was not asked {times} times");
    }

    /// The switch of node 1 was moved, and the master has noticed.
    fn in_doubt(mut self) -> Self {
        self = self.after(&[Action::Switch(NodeId::N1)]);
        for _ in 0..4 {
            if self.master.is_mode_in_doubt(NodeId::N1) {
                return self;
            }
            self = self.after(&[Action::Exchange(Exchange::Right)]);
        }
        panic!("node 1 was not heard in its new mode");
    }

    fn misses_in_all(&self, node: NodeId) -> u8 {
        self.master.node_statistics(node).timeouts as u8
    }
}

fn direct() -> MasterConfig {
    MasterConfig::direct()
}

/// A master that knows no nodes, in small steps.
pub(crate) fn fresh<B: Kit>(run: &mut Run) {
    let menu = Menu::FINE;
    run.world("fresh, velocity", Depth(3, 7), Bus::<B>::new(VELOCITY, direct(), menu));
    run.world("fresh, position", Depth(3, 7), Bus::<B>::new(POSITION, direct(), menu));
    run.world("fresh, two nodes", Depth(2, 6), Bus::<B>::new(BOTH, direct(), menu));
}

/// Known nodes, in small steps.
pub(crate) fn small_steps<B: Kit>(run: &mut Run) {
    let menu = Menu::FINE;
    for (name, modes) in [("velocity", VELOCITY), ("position", POSITION)] {
        let known = Bus::<B>::known(modes, direct(), menu);
        run.world(&format!("known, {name}"), Depth(2, 6), known.clone());
        let stop = [Action::Send(Fate::Arrives), Action::Call(Call::Stop(NodeId::N1))];
        let asked = known.clone().after(&stop);
        run.world(&format!("stop during a READ, {name}"), Depth(2, 6), asked);
        let moving = known.under_set_point();
        let owed = moving.clone().after(&stop[1..]);
        run.world(&format!("stop owed, {name}"), Depth(2, 6), owed);
        let late = [
            Action::Switch(NodeId::N1),
            Action::Send(Fate::Arrives),
            Action::Send(Fate::Arrives),
            Action::Answer(Answer::Late),
            Action::Wait(Wait::Deadline),
        ];
        let other = moving.after(&late);
        run.world(&format!("late answer in the other mode, {name}"), Depth(2, 4), other);
    }
    let known = Bus::<B>::known(BOTH, direct(), menu);
    run.world("known, two nodes", Depth(2, 4), known);
}

/// One known node, an exchange at a time.
pub(crate) fn one_node<B: Kit>(run: &mut Run) {
    let menu = Menu::COARSE;
    for (name, modes) in [("velocity", VELOCITY), ("position", POSITION)] {
        let known = Bus::<B>::known(modes, direct(), menu);
        run.world(&format!("known, {name}"), Depth(2, 6), known.clone());
        let commanded = known.clone().under_set_point();
        let confirm = [Action::Call(Call::Confirm(NodeId::N1))];
        let failing = commanded.clone().missed(2).after(&confirm);
        run.world(&format!("confirmation about to fail, {name}"), Depth(2, 6), failing);
        let abnormal = commanded.clone().missed(3);
        run.world(&format!("abnormal, {name}"), Depth(2, 6), abnormal.clone());
        let back = abnormal.after(&[Action::Exchange(Exchange::Right)]);
        run.world(&format!("back again, {name}"), Depth(2, 6), back);
        let doubt = commanded.clone().in_doubt();
        run.world(&format!("in doubt, {name}"), Depth(2, 6), doubt);
        let refused = [Action::Call(Call::Set(NodeId::N1)), Action::Switch(NodeId::N1)];
        let back = commanded.clone().in_doubt().after(&refused);
        run.world(&format!("refused in doubt, switched back, {name}"), Depth(2, 6), back);
        // The first answer in the other mode is a measurement for the stop.
        let owed = [Action::Call(Call::Stop(NodeId::N1)), Action::Switch(NodeId::N1)];
        let moved = commanded.clone().after(&owed);
        let mut far = moved.clone();
        far.is_far = true;
        run.world(&format!("stopped and switched, {name}"), Depth(2, 6), moved);
        run.world(&format!("stopped and switched far off, {name}"), Depth(2, 6), far);
        let undecided = commanded.clone().in_doubt().missed(5);
        run.world(&format!("five exchanges in doubt, {name}"), Depth(2, 4), undecided);
        let stopped = commanded.after(&[
            Action::Call(Call::Stop(NodeId::N1)),
            Action::Exchange(Exchange::Right),
            Action::Exchange(Exchange::Right),
            Action::Exchange(Exchange::Right),
        ]);
        run.world(&format!("stopped, {name}"), Depth(2, 6), stopped);
        let mut deaf = known;
        deaf.takes_events = false;
        let full = deaf.after(&[Action::Call(Call::Discover)].repeat(20));
        run.world(&format!("full event queue, {name}"), Depth(2, 6), full);
    }
}

/// One known node, other settings.
pub(crate) fn settings<B: Kit>(run: &mut Run) {
    let menu = Menu { polls_fastest: false, ..Menu::COARSE };
    for (name, modes) in [("velocity", VELOCITY), ("position", POSITION)] {
        let mut manual = direct();
        manual.polling = Polling::Manual;
        let known = Bus::<B>::known(modes, manual, menu);
        run.world(&format!("manual, {name}"), Depth(2, 6), known);
        let mut slow = direct();
        slow.polling = Polling::Every(Duration::from_millis(10));
        run.world(&format!("every 10 ms, {name}"), Depth(2, 6), Bus::<B>::known(modes, slow, menu));
        let mut dead_man = direct();
        dead_man.dead_man = Some(Duration::from_millis(3));
        let known = Bus::<B>::known(modes, dead_man, menu);
        let at_limit = known.under_set_point().after(&[Action::Wait(Wait::Short)]);
        run.world(&format!("dead-man, {name}"), Depth(2, 6), at_limit.clone());
        let released = at_limit.after(&[Action::Call(Call::Release(NodeId::N1))]);
        run.world(&format!("dead-man, released, {name}"), Depth(2, 6), released);
        let mut trusting = direct();
        trusting.stops_abnormal = false;
        let abnormal = Bus::<B>::known(modes, trusting, Menu::COARSE).under_set_point().missed(3);
        run.world(&format!("abnormal and owed no stop, {name}"), Depth(2, 6), abnormal);
    }
}

/// Two known nodes, an exchange at a time.
pub(crate) fn two_nodes<B: Kit>(run: &mut Run) {
    let menu = Menu::COARSE;
    for (name, modes) in [("both modes", BOTH), ("positions", POSITIONS)] {
        let known = Bus::<B>::known(modes, direct(), menu);
        run.world(&format!("known, {name}"), Depth(2, 4), known.clone());
        let commanded = known.under_set_point();
        run.world(&format!("one abnormal, {name}"), Depth(2, 4), commanded.clone().missed(3));
        run.world(&format!("one in doubt, {name}"), Depth(2, 4), commanded.clone().in_doubt());
        let owed = commanded.after(&[Action::Call(Call::StopAll)]);
        run.world(&format!("two stops owed, {name}"), Depth(2, 4), owed);
    }
}

/// Two known nodes that are commanded and stopped continuously.
pub(crate) fn queues<B: Kit>(run: &mut Run) {
    for (name, modes) in [("both modes", BOTH), ("positions", POSITIONS)] {
        // Long enough for the cycle to skip a node.
        let rounds = [Action::Exchange(Exchange::Right)].repeat(12);
        let known = Bus::<B>::known(modes, direct(), Menu::QUEUE).after(&rounds);
        run.world(&format!("busy queue, {name}"), Depth(3, 9), known);
    }
}
