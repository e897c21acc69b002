//! `axle watch`: shows the traffic on a line live, without sending anything.

mod args;
#[cfg(all(unix, feature = "dashboard"))]
mod dashboard;
#[cfg(all(unix, feature = "dashboard"))]
mod feed;
mod file;
mod lines;
#[cfg(all(unix, feature = "dashboard"))]
mod live;
#[cfg(all(unix, feature = "dashboard"))]
mod model;
pub(crate) mod moving;
#[cfg(all(unix, feature = "dashboard"))]
mod on_page;
#[cfg(all(unix, feature = "dashboard"))]
mod page;
mod recorder;
#[cfg(all(unix, feature = "dashboard"))]
mod screen;
mod udp;

use axlewire::{
    ikeya::{self, three},
    ucp,
};

use crate::{args::Protocol, failure::Failure};
pub(crate) use args::Args;
use args::Watched;

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let (Some(port), Some(protocol)) = (&args.from.port, args.protocol) else {
        return file::run(args);
    };
    let baud = args.baud.unwrap_or(protocol.default_baud());
    let watched = Watched { port, protocol, baud, args };
    #[cfg(all(unix, feature = "dashboard"))]
    if !args.plain && !args.json && screen::is_possible() {
        return match protocol {
            Protocol::Ucp => on_page::watch::<ucp::Ucp>(&watched),
            Protocol::Ikeya => on_page::watch::<ikeya::BothDirections>(&watched),
            Protocol::Ikeya3 => on_page::watch::<three::BothDirections>(&watched),
        };
    }
    #[cfg(not(all(unix, feature = "dashboard")))]
    if !args.plain && !args.json && std::io::IsTerminal::is_terminal(&std::io::stdout()) {
        eprintln!("axle: {}", moving::NO_PAGE);
    }
    match protocol {
        Protocol::Ucp => lines::watch::<ucp::Ucp>(&watched),
        Protocol::Ikeya => lines::watch::<ikeya::BothDirections>(&watched),
        Protocol::Ikeya3 => lines::watch::<three::BothDirections>(&watched),
    }
}
