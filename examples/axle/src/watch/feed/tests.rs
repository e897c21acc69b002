//! The account of a line.

use axlewire::ucp::{
    Body, Ucp,
    message::{ErrorCode, Ping, Pong},
};

use super::*;
use crate::args::Protocol;

#[test]
fn what_is_sent_and_what_is_received_are_both_counted() {
    let mut feed = Feed::<Ucp>::new(Model::new(Protocol::Ucp), None);
    let (ping, pong) = (Ping {}.frame(0), Pong::new(ErrorCode::Fine).frame(0));
    let (ping, pong) = (ping.as_bytes(), pong.as_bytes());
    // A frame of one direction is whole, whatever comes from the other meanwhile.
    feed.take(Source::Received, &pong[..4], 0);
    feed.take(Source::Sent, ping, 1);
    feed.take(Source::Received, &pong[4..], 2);
    feed.take(Source::Sent, &[0; 5], 3);
    let counters = feed.counters();
    assert_eq!((counters.frames, counters.skipped()), (2, 5));
    assert_eq!(counters.received, (ping.len() + pong.len() + 5) as u64);
}
