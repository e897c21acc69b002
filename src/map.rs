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

#[cfg(all(test, feature = "alloc", feature = "ikeya", feature = "ucp"))]
mod tests {
    use core::fmt;

    use serde::{
        Serialize, Serializer,
        ser::{Impossible, SerializeMap},
    };

    use crate::{
        ikeya::{BothDirections, NodeId, ReadRequest, Rps, VelocityResponse, WriteRequest},
        stream::Frames,
        ucp::{Body, MotorControl, Ucp, message::Ping},
    };

    /// A format that writes the number of fields first. Values are not looked at.
    struct Counted;

    struct Announced {
        left: usize,
    }

    impl SerializeMap for Announced {
        type Ok = usize;
        type Error = fmt::Error;

        fn serialize_key<T: ?Sized + Serialize>(&mut self, _: &T) -> fmt::Result {
            self.left = self.left.checked_sub(1).ok_or(fmt::Error)?;
            Ok(())
        }

        fn serialize_value<T: ?Sized + Serialize>(&mut self, _: &T) -> fmt::Result {
            Ok(())
        }

        fn end(self) -> Result<usize, fmt::Error> {
            Ok(self.left)
        }
    }

    macro_rules! refused {
        ($($name:ident: $($value:ty),*;)+) => {$(
            fn $name(self, $(_: $value),*) -> Result<usize, fmt::Error> {
                Err(fmt::Error)
            }
        )+};
    }

    type Not = Impossible<usize, fmt::Error>;
    type Made<T> = Result<T, fmt::Error>;
    type Name = &'static str;

    impl Serializer for Counted {
        type Ok = usize;
        type Error = fmt::Error;
        type SerializeSeq = Not;
        type SerializeTuple = Not;
        type SerializeTupleStruct = Not;
        type SerializeTupleVariant = Not;
        type SerializeMap = Announced;
        type SerializeStruct = Not;
        type SerializeStructVariant = Not;

        refused! {
            serialize_bool: bool; serialize_char: char; serialize_str: &str; serialize_bytes: &[u8];
            serialize_i8: i8; serialize_i16: i16; serialize_i32: i32; serialize_i64: i64;
            serialize_u8: u8; serialize_u16: u16; serialize_u32: u32; serialize_u64: u64;
            serialize_f32: f32; serialize_f64: f64; serialize_none:; serialize_unit:;
            serialize_unit_struct: Name; serialize_unit_variant: Name, u32, Name;
        }

        fn serialize_some<T: ?Sized + Serialize>(self, _: &T) -> Made<usize> {
            Err(fmt::Error)
        }

        fn serialize_newtype_struct<T: ?Sized + Serialize>(self, _: Name, _: &T) -> Made<usize> {
            Err(fmt::Error)
        }

        fn serialize_newtype_variant<T: ?Sized + Serialize>(
            self,
            _: Name,
            _: u32,
            _: Name,
            _: &T,
        ) -> Made<usize> {
            Err(fmt::Error)
        }

        fn serialize_seq(self, _: Option<usize>) -> Made<Not> {
            Err(fmt::Error)
        }

        fn serialize_tuple(self, _: usize) -> Made<Not> {
            Err(fmt::Error)
        }

        fn serialize_tuple_struct(self, _: Name, _: usize) -> Made<Not> {
            Err(fmt::Error)
        }

        fn serialize_tuple_variant(self, _: Name, _: u32, _: Name, _: usize) -> Made<Not> {
            Err(fmt::Error)
        }

        fn serialize_map(self, len: Option<usize>) -> Made<Announced> {
            Ok(Announced { left: len.ok_or(fmt::Error)? })
        }

        fn serialize_struct(self, _: Name, _: usize) -> Made<Not> {
            Err(fmt::Error)
        }

        fn serialize_struct_variant(self, _: Name, _: u32, _: Name, _: usize) -> Made<Not> {
            Err(fmt::Error)
        }
    }

    #[test]
    fn a_map_announces_the_number_of_its_fields() {
        let is_right = |map: &dyn Fn(Counted) -> Made<usize>| assert_eq!(map(Counted), Ok(0));
        let node = NodeId::N1;
        let packets = [
            ReadRequest::new(node).as_bytes().to_vec(),
            WriteRequest::velocity(node, Rps::ZERO).as_bytes().to_vec(),
            VelocityResponse::new(node, Rps::ZERO).as_bytes().to_vec(),
        ]
        .concat();
        for packet in Frames::<BothDirections>::new(&packets) {
            is_right(&|format| packet.serialize(format));
        }
        let command = MotorControl::turn_left(1, 2).unwrap();
        let frames = [Ping {}.frame(0).as_bytes(), command.frame(0).as_bytes()].concat();
        for frame in Frames::<Ucp>::new(&frames) {
            is_right(&|format| frame.serialize(format));
            is_right(&|format| frame.message().serialize(format));
        }
    }
}
