//! The account of a line.

use axlewire::{
    ikeya::{BothDirections, ReadRequest, Rps, VelocityResponse},
    ucp::{
        Body, Ucp,
        message::{ErrorCode, Ping, Pong},
    },
};

use super::*;
use crate::{args::Protocol, watch::model::Kind};

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

#[test]
fn bytes_that_belong_to_no_frame_are_near_the_node_that_was_asked_last() {
    let (n1, n2) = (NodeId::N1, NodeId::N2);
    let mut feed = Feed::<BothDirections>::new(Model::new(Protocol::Ikeya), None);
    feed.take(Source::Sent, ReadRequest::new(n1).as_bytes(), 0);
    feed.take(Source::Received, VelocityResponse::new(n1, Rps::ZERO).as_bytes(), 1000);
    feed.take(Source::Sent, ReadRequest::new(n2).as_bytes(), 2000);
    feed.take(Source::Received, &[0; 3], 3000);
    feed.tick(100_000);
    let gaps: Vec<_> = feed.model.log.newest().filter(|entry| entry.kind == Kind::Gap).collect();
    assert!(!gaps.is_empty() && gaps.iter().all(|gap| gap.node == Some(n2)), "{gaps:?}");
}
