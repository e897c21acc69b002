//! Health of a node.

/// How a node is (ruling I7).
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Health {
    /// It answered the last time.
    Online,
    /// It missed this many answers in a row, 1 or 2.
    Suspect(u8),
    /// It missed three in a row. It gets no set-points, and is asked now and then.
    Abnormal,
}

impl Health {
    /// Whether the node answers, as far as is known: it is not abnormal.
    #[must_use]
    pub const fn is_online(self) -> bool {
        !matches!(self, Self::Abnormal)
    }
}
