//! Maps for `serde` whose number of fields depends on the value.

use core::fmt;

use serde::{Serialize, Serializer, ser::SerializeMap};

/// The fields of a map.
pub(crate) trait Fields {
    /// Puts all fields into `map`; each time the same number of them.
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error>;

    /// Serialises the map. Binary formats, such as postcard, write the number of fields first, so
    /// they are counted.
    fn as_map<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut count = Count(0);
        // Counting does not fail.
        let _ = self.put(&mut count);
        let mut map = serializer.serialize_map(Some(count.0))?;
        self.put(&mut map)?;
        map.end()
    }
}

/// Counts fields, whatever they are.
struct Count(usize);

impl SerializeMap for Count {
    type Ok = ();
    type Error = fmt::Error;

    fn serialize_key<T: ?Sized + Serialize>(&mut self, _: &T) -> fmt::Result {
        self.0 += 1;
        Ok(())
    }

    fn serialize_value<T: ?Sized + Serialize>(&mut self, _: &T) -> fmt::Result {
        Ok(())
    }

    fn end(self) -> fmt::Result {
        Ok(())
    }
}
