//! The schedule of faults: seeded, and the same for every line.

use super::*;

/// An end of the line.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum End {
    Head,
    Tails,
}

/// A fault. Stations at the tail have numbers; `None` is the whole line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fault {
    /// Both directions: wrong bits, lost, doubled and made-up bytes.
    Noise(Faults),
    /// A plug is out.
    Unplugged(Option<usize>),
    /// A station has no power: its bytes are cut off, and it forgets its command.
    BrownOut(usize),
    /// A station is reset, in no time.
    Reset(usize),
    /// The station at the head is reset, in no time.
    ResetHead,
}

impl Fault {
    pub(crate) const NAMES: [&str; 5] =
        ["noise", "unplugged", "brown-out", "reset", "reset of the head"];

    pub(crate) const fn kind(&self) -> usize {
        match self {
            Self::Noise(_) => 0,
            Self::Unplugged(_) => 1,
            Self::BrownOut(_) => 2,
            Self::Reset(_) => 3,
            Self::ResetHead => 4,
        }
    }
}

/// When faults begin and end, in microseconds since the start.
pub(crate) struct Schedule {
    rng: Rng,
    tails: u64,
    /// Mean time between two faults.
    mean_us: u64,
    /// The longest time that a plug is out.
    longest_us: u64,
    /// After this time one end, the head or the tails, is not reset any more.
    resets_until_us: u64,
    spares: End,
    next_us: u64,
    active: Vec<(u64, Fault)>,
    pub(crate) counts: [u64; 5],
}

impl Schedule {
    pub(crate) fn new(plan: &Plan, tails: u64, spares: End) -> Self {
        let mut schedule = Self {
            rng: Rng::new(plan.seed ^ 0xFA17),
            tails,
            mean_us: plan.fault_us,
            longest_us: plan.unplugged_us,
            resets_until_us: plan.resets_us,
            spares,
            next_us: 0,
            active: Vec::new(),
            counts: [0; 5],
        };
        schedule.next_us = schedule.pause();
        schedule
    }

    /// The pause before the next fault.
    fn pause(&mut self) -> u64 {
        let part = (self.rng.below(1 << 20) + 1) as f64 / f64::from(1 << 20);
        (-part.ln() * self.mean_us as f64) as u64 + 1
    }

    /// A time between these, small ones as likely as large ones.
    fn span(&mut self, from_us: u64, to_us: u64) -> u64 {
        let part = self.rng.below(1 << 20) as f64 / f64::from(1 << 20);
        (from_us as f64 * (to_us.max(from_us) as f64 / from_us as f64).powf(part)) as u64
    }

    /// When something changes next, if it does before `end_us`.
    pub(crate) fn edge_before(&self, end_us: u64) -> Option<u64> {
        let edge = self.active.iter().map(|(end, _)| *end).fold(self.next_us, u64::min);
        (edge < end_us).then_some(edge)
    }

    /// The faults that end by `now`.
    pub(crate) fn ended(&mut self, now: u64) -> Vec<Fault> {
        let over = |(end, _): &(u64, Fault)| *end <= now;
        let ended = self.active.iter().copied().filter(over).map(|(_, fault)| fault).collect();
        self.active.retain(|it| !over(it));
        ended
    }

    /// The fault that begins by `now`, if one does.
    pub(crate) fn begun(&mut self, now: u64) -> Option<Fault> {
        if self.next_us > now {
            return None;
        }
        self.next_us = now + self.pause();
        let tail = self.rng.below(self.tails) as usize;
        let is_spared = |end| self.spares == end && now >= self.resets_until_us;
        let (spares_head, spares_tails) = (is_spared(End::Head), is_spared(End::Tails));
        let (fault, span) = match self.rng.below(20) {
            0..8 => (Fault::Noise(self.noise()), self.span(1_000_000, 60_000_000)),
            8..12 => (Fault::Unplugged(Some(tail)), self.span(1000, self.longest_us)),
            12..14 => (Fault::Unplugged(None), self.span(1000, self.longest_us / 4)),
            14..17 if !spares_tails => (Fault::BrownOut(tail), self.span(1000, 3_000_000)),
            14..17 => (Fault::Unplugged(Some(tail)), self.span(1000, 3_000_000)),
            17..19 if !spares_tails => (Fault::Reset(tail), 0),
            _ if spares_head => (Fault::Reset(tail), 0),
            _ => (Fault::ResetHead, 0),
        };
        self.counts[fault.kind()] += 1;
        self.active.push((now + span, fault));
        Some(fault)
    }

    fn noise(&mut self) -> Faults {
        let mut part = |most: f64| self.rng.below(1_000_001) as f64 / 1e6 * most;
        let mut faults = Faults::noise(part(0.1).powi(2));
        (faults.lost, faults.duplicated, faults.inserted) = (part(1e-3), part(1e-3), part(1e-3));
        faults
    }

    /// Microseconds from the start of a frame to the beginning of a fault, for half of them.
    pub(crate) fn micros_into_a_frame(&mut self) -> Option<u64> {
        (self.rng.below(2) == 0).then(|| self.rng.below(400))
    }

    pub(crate) fn is_quiet(&self) -> bool {
        self.active.is_empty()
    }

    /// Faults of both pairs.
    pub(crate) fn pair(&self) -> Faults {
        let noise = |(_, fault): &(u64, Fault)| match fault {
            Fault::Noise(faults) => Some(*faults),
            _ => None,
        };
        let mut faults = self.active.iter().rev().find_map(noise).unwrap_or_default();
        faults.unplugged = self.is_active(Fault::Unplugged(None));
        faults
    }

    /// Whether a station at the tail is cut off.
    pub(crate) fn is_cut_off(&self, tail: usize) -> bool {
        self.is_active(Fault::Unplugged(Some(tail))) || self.is_active(Fault::BrownOut(tail))
    }

    pub(crate) fn is_active(&self, fault: Fault) -> bool {
        self.active.iter().any(|(_, it)| *it == fault)
    }
}
