//! Packets and messages print and serialise themselves.

#![cfg(all(feature = "ikeya", feature = "ucp"))]

mod data;
mod debug;
mod errors;
mod ikeya;
mod ucp;

use crate::rig::*;

fn spaced<T: ToString>(values: impl IntoIterator<Item = T>) -> String {
    values.into_iter().map(|value| value.to_string()).collect::<Vec<_>>().join(" ")
}

#[test]
fn a_gap_tells_its_length_and_its_reason() {
    let gap = |len, reason| Gap { len, reason }.to_string();
    assert_eq!(gap(1, Reason::Header), "1 byte skipped: header, no frame starts here");
    assert_eq!(gap(2, Reason::Length), "2 bytes skipped: length, invalid length");
    assert_eq!(gap(3, Reason::Id), "3 bytes skipped: id, invalid node id");
    assert_eq!(gap(4, Reason::Crc), "4 bytes skipped: crc, damaged, or not a frame");
    assert_eq!(gap(5, Reason::Idle), "5 bytes skipped: idle, truncated at the end");
}

#[test]
fn an_event_prints_as_its_frame_or_as_its_gap() {
    let gap = Gap { len: 2, reason: Reason::Crc };
    assert_eq!(Event::<u8>::Skipped(gap).to_string(), gap.to_string());
    assert_eq!(Event::Frame(7).to_string(), "7");
}
