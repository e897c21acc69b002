//! The mode of a node: the one on record, and whether an answer has put it in doubt (I11).

use crate::ikeya::units::Mode;

/// Number of exchanges without a decision after which the application is told that a mode stays in
/// doubt (I11). The node has been abnormal since the third, and is read at the search rate.
const UNDECIDED: u8 = 6;

/// What is known of a node's mode.
#[derive(Clone, Copy, Debug)]
pub(super) struct KnownMode {
    /// The mode on record; `None` until the node has answered once.
    on_record: Option<Mode>,
    /// While it is in doubt: number of exchanges since then that decided nothing.
    doubt: Option<u8>,
}

/// What an answer says about the mode.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Decision {
    /// The mode on record, or the first one heard.
    Agreed,
    /// The mode on record, which was in doubt until now.
    Settled,
    /// The other mode for the first time: nothing is decided.
    Doubtful,
    /// The other mode again.
    Changed,
}

impl KnownMode {
    pub(super) const UNKNOWN: Self = Self { on_record: None, doubt: None };

    pub(super) const fn on_record(self) -> Option<Mode> {
        self.on_record
    }

    pub(super) const fn is_in_doubt(self) -> bool {
        self.doubt.is_some()
    }

    /// Whether the doubt has lasted so long that the application was told.
    pub(super) fn is_undecided(self) -> bool {
        self.doubt == Some(UNDECIDED)
    }

    /// Whether it is not the mode of a late or early answer.
    pub(super) fn differs_from(self, mode: Mode) -> bool {
        self.on_record.is_some_and(|known| known != mode)
    }

    /// Takes the mode of an answer in its window.
    // In line it would take 50 more bytes of flash.
    #[inline(never)]
    pub(super) fn decide(&mut self, mode: Mode) -> Decision {
        let decision = match (self.differs_from(mode), self.doubt) {
            (true, None) => return Decision::Doubtful,
            (true, Some(_)) => Decision::Changed,
            (false, Some(_)) => Decision::Settled,
            (false, None) => Decision::Agreed,
        };
        *self = Self { on_record: Some(mode), doubt: None };
        decision
    }

    /// Begins to doubt, unless it already is in doubt; returns whether it began.
    pub(super) const fn doubt(&mut self) -> bool {
        let begins = self.doubt.is_none();
        if begins {
            self.doubt = Some(0);
        }
        begins
    }

    /// Counts an exchange that decided nothing; returns whether the application is to be told.
    pub(super) fn miss(&mut self) -> bool {
        let Some(exchanges) = &mut self.doubt else { return false };
        let was = *exchanges;
        *exchanges = was.saturating_add(1).min(UNDECIDED);
        was + 1 == UNDECIDED
    }
}
