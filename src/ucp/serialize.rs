//! Frames and messages as data for `serde`: flat maps with the fields of `axle decode --json`.

use serde::{Serialize, Serializer, ser::SerializeMap};

use super::{frame::Frame, message::Message};
use crate::{
    map::Fields,
    record::{BYTES, ID, INDEX, LENGTH, MESSAGE, PROTOCOL},
    text::Hex,
};

/// A map: `length`, `protocol`, `message`, `id`, `index`, the fields of the message, and `bytes`:
/// the whole frame in lower-case hex digits. The page `fields` describes each.
impl Serialize for Frame {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.as_map(serializer)
    }
}

impl Fields for Frame {
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        let (bytes, message) = (self.as_bytes(), self.message());
        map.serialize_entry(LENGTH.name, &bytes.len())?;
        map.serialize_entry(PROTOCOL.name, "ucp")?;
        map.serialize_entry(MESSAGE.name, message.name())?;
        map.serialize_entry(ID.name, &self.id())?;
        map.serialize_entry(INDEX.name, &self.index())?;
        message.put_fields(map)?;
        map.serialize_entry(BYTES.name, &Hex(bytes))
    }
}

/// A map: `message`, `id` and the fields of the message. The page `fields` describes each.
impl Serialize for Message<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.as_map(serializer)
    }
}

impl Fields for Message<'_> {
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        map.serialize_entry(MESSAGE.name, self.name())?;
        map.serialize_entry(ID.name, &self.id())?;
        self.put_fields(map)
    }
}
