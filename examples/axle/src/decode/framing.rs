//! The framing of a protocol and a direction.

use axlewire::stream::Framing;

use super::{Stream, StreamOf, args::Direction};
use crate::{
    args::Protocol,
    failure::Failure,
    listing::{Place, Shown},
    pcapng,
};

/// A generic function for the framing of this protocol, in one direction or in both. UCP frames
/// show their own.
macro_rules! for_framing {
    ($function:ident, $protocol:expr, $direction:expr) => {{
        use axlewire::{
            ikeya::{self, three},
            ucp,
        };
        use $crate::{
            args::Protocol::{Ikeya, Ikeya3, Ucp},
            decode::Direction::{ToMaster, ToSlave},
        };
        match ($protocol, $direction) {
            (Ucp, _) => $function::<ucp::Ucp>,
            (Ikeya, None) => $function::<ikeya::BothDirections>,
            (Ikeya, Some(ToSlave)) => $function::<ikeya::ToSlave>,
            (Ikeya, Some(ToMaster)) => $function::<ikeya::ToMaster>,
            (Ikeya3, None) => $function::<three::BothDirections>,
            (Ikeya3, Some(ToSlave)) => $function::<three::ToSlave>,
            (Ikeya3, Some(ToMaster)) => $function::<three::ToMaster>,
        }
    }};
}
pub(super) use for_framing;

/// What is to be decoded.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Choice {
    /// The protocol of all lines; otherwise the capture tells it.
    pub(crate) protocol: Option<Protocol>,
    /// Ikeya: packets of one direction only.
    pub(crate) direction: Option<Direction>,
    /// Of a capture with interfaces: packets of this one only.
    pub(crate) interface: Option<usize>,
    /// The interfaces of one port in several sections of a file are one, with the number of the
    /// first.
    pub(crate) joins_sections: bool,
}

impl Choice {
    /// Refuses a direction for a line of this protocol that has none to choose.
    pub(super) fn permits(self, protocol: Protocol) -> Result<(), Failure> {
        if self.direction.is_some() && protocol == Protocol::Ucp {
            let line = "--direction is for ikeya and ikeya-3: UCP frames show their own direction";
            return Err(Failure::Usage(line.to_owned()));
        }
        Ok(())
    }

    /// The stream of an interface, as far as there is one, in one direction of the line.
    pub(super) fn stream(
        self,
        protocol: Protocol,
        interface: Option<usize>,
        direction: Option<pcapng::Direction>,
    ) -> Box<dyn Stream> {
        self.stream_at(protocol, Place { interface, direction, ..Place::default() })
    }

    /// The stream whose first byte is at this place.
    pub(super) fn stream_at(self, protocol: Protocol, place: Place) -> Box<dyn Stream> {
        for_framing!(boxed, protocol, self.direction)(place)
    }
}

fn boxed<F>(place: Place) -> Box<dyn Stream>
where
    F: Framing + 'static,
    for<'a> F::Frame<'a>: Shown,
{
    Box::new(StreamOf::<F>::at(place))
}
