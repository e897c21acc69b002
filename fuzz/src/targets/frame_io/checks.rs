//! What must hold for readers and writers.

use super::{
    super::{known_framings::Known, oracle},
    Life,
};

impl<F: Known, const N: usize> Life<F, N> {
    /// What has left and what is unsent is what was promised, in order.
    pub(super) fn check(&mut self) {
        let given = self.reader.port_mut().given;
        let (taken, rest) = (self.writer.port_mut().written.clone(), self.writer.unsent());
        assert_eq!(taken.len() + rest.len(), self.promised.len());
        assert_eq!(self.promised[..taken.len()], taken[..]);
        assert_eq!(self.promised[taken.len()..], *rest);
        let counters = self.reader.decoder().counters();
        let booked = counters.framed + counters.skipped() + self.reader.pending() as u64;
        assert_eq!((counters.received, booked), (given, given));
    }

    /// The same frames and gaps as the oracle's.
    pub(super) fn check_events(&mut self) {
        let told = oracle::answer(F::RULES, &self.stream, &self.idles);
        let places = |events: &[oracle::Event]| -> Vec<_> {
            let place = |event: &oracle::Event| match *event {
                oracle::Event::Frame { offset, len } => (true, offset, len),
                oracle::Event::Skipped { offset, len, .. } => (false, offset, len),
            };
            events.iter().map(place).collect()
        };
        assert_eq!(places(&self.events), places(&told.events));
        assert_eq!(self.reader.pending(), told.pending);
    }
}
