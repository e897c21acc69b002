//! What the user has chosen to see, and the colours of the page.

use axlewire::ikeya::NodeId;
use ratatui_core::style::{Color, Modifier, Style};

/// What the user has chosen to see, and what the tool does meanwhile.
#[derive(Clone, Debug, Default)]
pub(crate) struct View {
    /// Command, port, protocol and speed.
    pub(crate) title: String,
    pub(crate) baud: u32,
    pub(crate) filter: Filter,
    pub(crate) is_paused: bool,
    pub(crate) has_help: bool,
    /// The file of the running recording.
    pub(crate) recording: Option<String>,
    pub(crate) role: Role,
    /// Only ASCII, for terminals without UTF-8.
    pub(crate) is_ascii: bool,
}

/// What the keys do.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub(crate) enum Role {
    /// Nothing is sent.
    #[default]
    Watching,
    /// Something moves: every key that ends stops it first.
    Moving,
    /// It was told to stop.
    Stopping,
}

/// Which entries of the log are shown.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub(crate) enum Filter {
    #[default]
    All,
    Gaps,
    Node(NodeId),
}

pub(super) const ALARM: Style = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD);

pub(super) const GOOD: Style = Style::new().fg(Color::Green);

pub(super) const DOUBT: Style = Style::new().fg(Color::Yellow);

pub(super) const FAINT: Style = Style::new().fg(Color::DarkGray);

pub(super) const PLAIN: Style = Style::new();
