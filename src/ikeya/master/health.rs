//! Health of a node.

/// Health of a node (ruling I7).
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Health {
    /// It answered its last request.
    Online,
    /// It missed this many answers in a row, 1 or 2.
    Suspect(u8),
    /// It missed three in a row. It gets no set-points, and is polled only occasionally.
    Abnormal,
}

impl Health {
    /// Whether the node is believed to answer, that is, not abnormal.
    #[must_use]
    pub const fn is_online(self) -> bool {
        !matches!(self, Self::Abnormal)
    }
}
