//! A set of nodes.

use core::{fmt, ops::BitOr};

use crate::ikeya::units::NodeId;

/// A set of node ids, as one bit each.
///
/// ```
/// use axlewire::ikeya::{master::NodeSet, NodeId};
///
/// let nodes = NodeSet::from([NodeId::N1, NodeId::N3]) | NodeId::N8;
/// assert_eq!(nodes.to_string(), "1, 3 and 8");
/// assert_eq!((nodes.len(), nodes.contains(NodeId::N2)), (3, false));
/// ```
#[derive(Clone, Copy, Default, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(transparent))]
pub struct NodeSet {
    bits: u8,
}

impl NodeSet {
    /// No node.
    pub const NONE: Self = Self { bits: 0 };

    /// All eight nodes.
    pub const ALL: Self = Self { bits: 0xFF };

    /// Adds a node.
    pub const fn insert(&mut self, node: NodeId) {
        self.bits |= bit(node);
    }

    /// Removes a node.
    pub const fn remove(&mut self, node: NodeId) {
        self.bits &= !bit(node);
    }

    /// Whether the set contains the node.
    #[must_use]
    pub const fn contains(self, node: NodeId) -> bool {
        self.bits & bit(node) != 0
    }

    /// Number of nodes, 0 to 8.
    #[must_use]
    pub const fn len(self) -> usize {
        self.bits.count_ones() as usize
    }

    /// Whether the set is empty.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.bits == 0
    }

    /// The nodes that are in both sets.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self { bits: self.bits & other.bits }
    }

    /// The nodes in the order of their ids.
    pub fn iter(self) -> impl Iterator<Item = NodeId> {
        NodeId::ALL.into_iter().filter(move |&node| self.contains(node))
    }
}

const fn bit(node: NodeId) -> u8 {
    1 << ((node.get() - 1) & 7)
}

impl From<NodeId> for NodeSet {
    fn from(node: NodeId) -> Self {
        Self { bits: bit(node) }
    }
}

impl<const N: usize> From<[NodeId; N]> for NodeSet {
    fn from(nodes: [NodeId; N]) -> Self {
        nodes.into_iter().collect()
    }
}

impl FromIterator<NodeId> for NodeSet {
    fn from_iter<I: IntoIterator<Item = NodeId>>(nodes: I) -> Self {
        nodes.into_iter().fold(Self::NONE, BitOr::bitor)
    }
}

/// The nodes that are in either set.
impl<T: Into<Self>> BitOr<T> for NodeSet {
    type Output = Self;

    fn bitor(self, other: T) -> Self {
        Self { bits: self.bits | other.into().bits }
    }
}

impl fmt::Debug for NodeSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.iter()).finish()
    }
}

impl fmt::Display for NodeSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let len = self.len();
        if len == 0 {
            return f.write_str("none");
        }
        for (index, node) in self.iter().enumerate() {
            let between = match index {
                0 => "",
                _ if index + 1 == len => " and ",
                _ => ", ",
            };
            write!(f, "{between}{node}")?;
        }
        Ok(())
    }
}
