//! Frames of all protocols behind one trait: what a listing needs of them.

use core::fmt::Display;

use axlewire::{
    ikeya::{self, three},
    ucp,
};
use serde::Serialize;

/// A frame of any protocol. `Serialize` gives the JSON fields.
pub(crate) trait Frame: Serialize {
    /// Name of the message.
    fn name(&self) -> &'static str;

    /// The number that a listing shows: node or index.
    fn number(&self) -> u8;

    /// The number that, with the name, identifies messages of one kind: node or id.
    fn key(&self) -> u8;

    /// The frame as bytes on the wire.
    fn bytes(&self) -> &[u8];

    /// Contents as text, without name and number.
    fn contents(&self) -> impl Display;
}

impl Frame for &ucp::Frame {
    fn name(&self) -> &'static str {
        self.message().name()
    }

    fn number(&self) -> u8 {
        self.index()
    }

    fn key(&self) -> u8 {
        self.id()
    }

    fn bytes(&self) -> &[u8] {
        self.as_bytes()
    }

    fn contents(&self) -> impl Display {
        self.message().contents()
    }
}

macro_rules! packets {
    ($($packet:ty),+) => {$(
        impl Frame for $packet {
            fn name(&self) -> &'static str {
                Self::name(self)
            }

            fn number(&self) -> u8 {
                self.id().get()
            }

            fn key(&self) -> u8 {
                self.id().get()
            }

            fn bytes(&self) -> &[u8] {
                self.as_bytes()
            }

            fn contents(&self) -> impl Display {
                Self::contents(self)
            }
        }
    )+};
}

packets!(ikeya::Packet<'_>, ikeya::Request<'_>, ikeya::Response<'_>);
packets!(three::Packet<'_>, three::Request<'_>, three::Response<'_>);
