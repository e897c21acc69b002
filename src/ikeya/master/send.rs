//! Choosing and sending requests.

use super::{
    Board, ECHO_LEN, Master, NodeId, PACKET_LEN, ReadRequest, Request, Target,
    node::{Due, Node},
};
use crate::{
    stream::Encode,
    time::{Duration, Instant},
};

/// Why it is sent.
#[derive(Clone, Copy, Debug)]
enum Source {
    Fresh,
    Discovery,
    Probe,
    Poll,
}

impl<B: Board> Master<B> {
    /// When the next request is due, wherever the line may be.
    pub(super) fn due(&self) -> Option<Instant> {
        let at = |due| match due {
            Due::Never => None,
            Due::Now => Some(self.now),
            Due::At(at) => Some(at),
        };
        let fresh = self.nodes.iter().filter_map(|node| at(node.fresh_due())).min();
        let discovery = self.discovery.and_then(|it| at(self.nodes[it.next & 7].askable()));
        let polled = match self.discovery {
            Some(_) => None,
            None => self.nodes.iter().filter_map(|node| at(node.due(&self.config))).min(),
        };
        [fresh, discovery, polled, at(self.probe_due())].into_iter().flatten().min()
    }

    /// When an abnormal node may be looked for.
    fn probe_due(&self) -> Due {
        let wanted = self.config.recovery_share_pct > 0 && self.discovery.is_none();
        if !wanted {
            return Due::Never;
        }
        // Nor before a late answer of the node can be told from the one that is asked for.
        let guards = self.nodes.iter().filter(|node| node.is_abnormal());
        let guard = guards.map(|node| node.guarded_until.unwrap_or(self.now)).min();
        match (guard, self.probe_at) {
            (None, _) => Due::Never,
            (Some(guard), None) => Due::At(guard),
            (Some(guard), Some(probe)) => Due::At(guard.max(probe)),
        }
    }

    /// What to send now, if anything.
    ///
    /// New set-points go first, so that a stop never waits for a discovery; but a node whose
    /// set-point has just jumped the queue waits for an exchange before the next one may, so that
    /// no flood of set-points keeps the others from being read.
    pub(super) fn next_request(&mut self, now: Instant) -> Option<(NodeId, Request)> {
        let is_free = self.line_free.is_none_or(|free| now >= free);
        if !is_free && !self.is_behind_write {
            return None;
        }
        let fresh = |jumped| {
            let wanted =
                move |node: &Node<B>| node.fresh_due().is_reached(now) && node.jumped == jumped;
            let index = self.nodes.iter().position(wanted)?;
            Some((index, Request::Write, Source::Fresh))
        };
        let chosen = fresh(false).or_else(|| self.next_exchange(now)).or_else(|| fresh(true));
        let (index, request, source) = chosen?;
        if !is_free && request == Request::Write {
            return None; // only a READ may follow on the heels of a WRITE
        }
        match source {
            Source::Fresh => self.nodes[index & 7].jumped = true,
            Source::Discovery => {}
            Source::Probe => {
                let share = u32::from(self.config.recovery_share_pct.clamp(1, 50));
                let window = self.window().saturating_mul(100).as_micros();
                let pause = window.checked_div(share).unwrap_or(u32::MAX);
                (self.probe_turn, self.probe_at) =
                    (index, Some(now + Duration::from_micros(pause)));
            }
            // Behind its WRITE the node is still to be read.
            Source::Poll if request == Request::Write && !B::ANSWERS_WRITE => self.turn = index,
            Source::Poll => self.turn = (index + 1) & 7,
        }
        Some((NodeId::ALL[index & 7], request))
    }

    /// The next request that is no new set-point: of a discovery, of the search for abnormal
    /// nodes, or of the node whose turn it is.
    fn next_exchange(&self, now: Instant) -> Option<(usize, Request, Source)> {
        let from = |first: usize| (0..8).map(move |step| (first + step) & 7);
        if let Some(discovery) = self.discovery {
            let is_askable = self.nodes[discovery.next & 7].askable().is_reached(now);
            return is_askable.then_some((discovery.next, Request::Read, Source::Discovery));
        }
        if self.probe_due().is_reached(now) {
            let is_sought = |node: &Node<B>| node.is_abnormal() && node.askable().is_reached(now);
            let index = from(self.probe_turn + 1).find(|&index| is_sought(&self.nodes[index]))?;
            return Some((index, Request::Read, Source::Probe));
        }
        let is_due = |index: &usize| self.nodes[*index].due(&self.config).is_reached(now);
        let index = from(self.turn).find(is_due)?;
        let node = &self.nodes[index];
        let is_write = node.target.is_some() && !node.written;
        let request = if is_write { Request::Write } else { Request::Read };
        Some((index, request, Source::Poll))
    }

    /// Puts the request into the buffer that is handed out.
    pub(super) fn encode(&mut self, id: NodeId, request: Request) -> Option<()> {
        let mut buffer = [0; PACKET_LEN];
        let bytes = match (request, self.node(id).target) {
            (Request::Read, _) => ReadRequest::new(id).encode(&mut buffer),
            (Request::Write, None) => return None,
            (Request::Write, Some(Target::Velocity(to))) => {
                B::write_velocity(id, to).encode(&mut buffer)
            }
            (Request::Write, Some(Target::Position(to))) => {
                B::write_position(id, to).encode(&mut buffer)
            }
        };
        self.packet.clear();
        self.packet.extend_from_slice(bytes.ok()?).ok()?;
        if request == Request::Write {
            self.node_mut(id).sent_target();
        }
        Some(())
    }

    /// Remembers what an echoing line will give back.
    pub(super) fn expect_echo(&mut self) {
        if self.config.removes_echo {
            // Where the line gives back nothing, old expectations are of no use.
            if self.echo.len() + self.packet.len() > ECHO_LEN {
                self.echo.clear();
            }
            for &byte in &self.packet {
                let _ = self.echo.push_back(byte);
            }
        }
    }
}
