//! Packets of a motor bus, and short names for times and settings, for roles called by hand.

use axlewire::{
    ikeya::{NodeId, Position, PositionResponse, ReadRequest, Rps, VelocityResponse, WriteRequest},
    time::Duration,
};

pub(crate) const US: fn(u32) -> Duration = Duration::from_micros;
pub(crate) const MS: fn(u32) -> Duration = Duration::from_millis;

pub(crate) fn rps(value: f32) -> Rps {
    Rps::new(value).unwrap()
}

pub(crate) fn read(node: NodeId) -> Vec<u8> {
    ReadRequest::new(node).as_bytes().to_vec()
}

pub(crate) fn velocity(node: NodeId, value: f32) -> Vec<u8> {
    VelocityResponse::new(node, rps(value)).as_bytes().to_vec()
}

pub(crate) fn position(node: NodeId, at: Position) -> Vec<u8> {
    PositionResponse::new(node, at).as_bytes().to_vec()
}

/// A WRITE of a speed.
pub(crate) fn write(node: NodeId, value: f32) -> Vec<u8> {
    WriteRequest::velocity(node, rps(value)).as_bytes().to_vec()
}

/// A WRITE of a position.
pub(crate) fn hold(node: NodeId, at: Position) -> Vec<u8> {
    WriteRequest::position(node, at).as_bytes().to_vec()
}

pub(crate) const fn turns(rotation: i16) -> Position {
    Position::new(0, rotation)
}

/// Settings with a change.
pub(crate) fn with<T>(mut settings: T, change: impl FnOnce(&mut T)) -> T {
    change(&mut settings);
    settings
}
