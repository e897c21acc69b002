//! A frame as one row of columns. The frame serialises itself, as it does for JSON; each value goes
//! straight to its column.

use axlewire::ikeya::Mode;
use serde::{
    Serialize, Serializer,
    ser::{Impossible, SerializeMap, SerializeTuple},
};

use super::column::{Column, Unfit};

/// Where a field of a line goes.
#[derive(Debug)]
pub(super) struct Slot {
    pub(super) name: &'static str,
    /// Its first column.
    pub(super) first: usize,
    /// Number of its columns; 0 for a field that is the same in the whole table.
    pub(super) width: usize,
    /// Whether it is the whole frame, which is at hand without hex digits.
    pub(super) is_whole: bool,
}

type Fit = Result<(), Unfit>;

/// Serialises a frame into a row.
#[derive(Debug)]
pub(super) struct Row<'a> {
    /// Those that have not come yet.
    pub(super) slots: &'a [Slot],
    pub(super) columns: &'a mut [Column],
    /// The bytes of the frame.
    pub(super) whole: &'a [u8],
    /// The mode of the node, which is told behind the fields of the frame.
    pub(super) mode: Option<Mode>,
}

impl Row<'_> {
    fn columns_of(&mut self, slot: &Slot) -> Result<&mut [Column], Unfit> {
        self.columns.get_mut(slot.first..slot.first + slot.width).ok_or(Unfit)
    }

    fn absent(&mut self, slot: &Slot) -> Fit {
        self.columns_of(slot)?.iter_mut().try_for_each(Column::absent)
    }
}

impl SerializeMap for Row<'_> {
    type Ok = ();
    type Error = Unfit;

    fn serialize_key<T: ?Sized + Serialize>(&mut self, _: &T) -> Fit {
        Err(Unfit)
    }

    fn serialize_value<T: ?Sized + Serialize>(&mut self, _: &T) -> Fit {
        Err(Unfit)
    }

    /// The fields come in the order of the columns, so that no name is looked up. Inlined into the
    /// serializer of the frame, where the key is a constant and its comparison a few instructions.
    #[inline(always)]
    fn serialize_entry<K, V>(&mut self, key: &K, value: &V) -> Fit
    where
        K: ?Sized + Serialize,
        V: ?Sized + Serialize,
    {
        loop {
            let (slot, rest) = self.slots.split_first().ok_or(Unfit)?;
            self.slots = rest;
            if key.serialize(IsName(slot.name))? {
                let whole = self.whole;
                return match slot.width {
                    0 => Ok(()),
                    _ if slot.is_whole => Cells(self.columns_of(slot)?).one()?.bytes(whole),
                    _ => value.serialize(Cells(self.columns_of(slot)?)),
                };
            }
            self.absent(slot)?;
        }
    }

    fn end(mut self) -> Fit {
        for slot in self.slots {
            match self.mode {
                Some(mode) if slot.name == "mode" => {
                    let name = match mode {
                        Mode::Velocity => "velocity",
                        Mode::Position => "position",
                    };
                    Cells(self.columns_of(slot)?).serialize_str(name)?;
                }
                _ => self.absent(slot)?,
            }
        }
        Ok(())
    }
}

/// The columns of one value, or of an array.
struct Cells<'a>(&'a mut [Column]);

impl Cells<'_> {
    #[inline(always)]
    fn one(&mut self) -> Result<&mut Column, Unfit> {
        self.0.first_mut().ok_or(Unfit)
    }
}

impl SerializeTuple for Cells<'_> {
    type Ok = ();
    type Error = Unfit;

    #[inline(always)]
    fn serialize_element<T: ?Sized + Serialize>(&mut self, value: &T) -> Fit {
        let columns = core::mem::take(&mut self.0);
        let (column, rest) = columns.split_first_mut().ok_or(Unfit)?;
        self.0 = rest;
        value.serialize(Cells(core::slice::from_mut(column)))
    }

    fn end(self) -> Fit {
        if self.0.is_empty() { Ok(()) } else { Err(Unfit) }
    }
}

/// Methods for what frames do not have.
macro_rules! refused {
    ($ok:ty: $($method:ident($($of:ty),*) -> $result:ty;)*) => {$(
        fn $method(self, $(_: $of),*) -> Result<$result, Unfit> {
            Err(Unfit)
        }
    )*};
    (compound $ok:ty) => {
        type SerializeSeq = Impossible<$ok, Unfit>;
        type SerializeTupleStruct = Impossible<$ok, Unfit>;
        type SerializeTupleVariant = Impossible<$ok, Unfit>;
        type SerializeStruct = Impossible<$ok, Unfit>;
        type SerializeStructVariant = Impossible<$ok, Unfit>;

        fn serialize_some<T: ?Sized + Serialize>(self, _: &T) -> Result<$ok, Unfit> {
            Err(Unfit)
        }

        fn serialize_newtype_variant<T: ?Sized + Serialize>(
            self,
            _: &'static str,
            _: u32,
            _: &'static str,
            _: &T,
        ) -> Result<$ok, Unfit> {
            Err(Unfit)
        }

        refused! {
            $ok:
            serialize_bool(bool) -> $ok;
            serialize_char(char) -> $ok;
            serialize_f64(f64) -> $ok;
            serialize_bytes(&[u8]) -> $ok;
            serialize_none() -> $ok;
            serialize_unit() -> $ok;
            serialize_unit_struct(&'static str) -> $ok;
            serialize_unit_variant(&'static str, u32, &'static str) -> $ok;
            serialize_seq(Option<usize>) -> Self::SerializeSeq;
            serialize_tuple_struct(&'static str, usize) -> Self::SerializeTupleStruct;
            serialize_tuple_variant(&'static str, u32, &'static str, usize)
                -> Self::SerializeTupleVariant;
            serialize_struct(&'static str, usize) -> Self::SerializeStruct;
            serialize_struct_variant(&'static str, u32, &'static str, usize)
                -> Self::SerializeStructVariant;
        }
    };
    (numbers $ok:ty) => {
        refused! {
            $ok:
            serialize_i8(i8) -> $ok;
            serialize_i16(i16) -> $ok;
            serialize_i32(i32) -> $ok;
            serialize_i64(i64) -> $ok;
            serialize_u8(u8) -> $ok;
            serialize_u16(u16) -> $ok;
            serialize_u32(u32) -> $ok;
            serialize_u64(u64) -> $ok;
            serialize_f32(f32) -> $ok;
        }
    };
}

impl<'a> Serializer for Row<'a> {
    type Ok = ();
    type Error = Unfit;
    type SerializeTuple = Impossible<(), Unfit>;
    type SerializeMap = Row<'a>;

    #[inline]
    fn serialize_map(self, _: Option<usize>) -> Result<Self, Unfit> {
        Ok(self)
    }

    fn serialize_newtype_struct<T: ?Sized + Serialize>(self, _: &'static str, _: &T) -> Fit {
        Err(Unfit)
    }

    refused!(compound());
    refused!(numbers());
    refused! {
        ():
        serialize_str(&str) -> ();
        serialize_tuple(usize) -> Self::SerializeTuple;
    }
}

impl<'a> Serializer for Cells<'a> {
    type Ok = ();
    type Error = Unfit;
    type SerializeTuple = Cells<'a>;
    type SerializeMap = Impossible<(), Unfit>;

    #[inline(always)]
    fn serialize_i8(mut self, value: i8) -> Fit {
        self.one()?.integer(value.into())
    }

    #[inline(always)]
    fn serialize_i16(mut self, value: i16) -> Fit {
        self.one()?.integer(value.into())
    }

    #[inline(always)]
    fn serialize_i32(mut self, value: i32) -> Fit {
        self.one()?.integer(value.into())
    }

    #[inline(always)]
    fn serialize_i64(mut self, value: i64) -> Fit {
        self.one()?.integer(value)
    }

    #[inline(always)]
    fn serialize_u8(mut self, value: u8) -> Fit {
        self.one()?.integer(value.into())
    }

    #[inline(always)]
    fn serialize_u16(mut self, value: u16) -> Fit {
        self.one()?.integer(value.into())
    }

    #[inline(always)]
    fn serialize_u32(mut self, value: u32) -> Fit {
        self.one()?.integer(value.into())
    }

    #[inline(always)]
    fn serialize_u64(mut self, value: u64) -> Fit {
        self.one()?.unsigned(value)
    }

    #[inline(always)]
    fn serialize_f32(mut self, value: f32) -> Fit {
        self.one()?.float(value)
    }

    #[inline(always)]
    fn serialize_str(mut self, value: &str) -> Fit {
        self.one()?.text(value)
    }

    /// One value of a message, for the ids and codes of the library.
    #[inline(always)]
    fn serialize_newtype_struct<T: ?Sized + Serialize>(self, _: &'static str, value: &T) -> Fit {
        value.serialize(self)
    }

    #[inline(always)]
    fn serialize_tuple(self, _: usize) -> Result<Self, Unfit> {
        Ok(self)
    }

    refused!(compound());
    refused! {
        ():
        serialize_map(Option<usize>) -> Self::SerializeMap;
    }
}

/// Whether a key is this name.
struct IsName<'a>(&'a str);

impl Serializer for IsName<'_> {
    type Ok = bool;
    type Error = Unfit;
    type SerializeTuple = Impossible<bool, Unfit>;
    type SerializeMap = Impossible<bool, Unfit>;

    #[inline(always)]
    fn serialize_str(self, value: &str) -> Result<bool, Unfit> {
        Ok(value == self.0)
    }

    fn serialize_newtype_struct<T: ?Sized + Serialize>(
        self,
        _: &'static str,
        _: &T,
    ) -> Result<bool, Unfit> {
        Err(Unfit)
    }

    refused!(compound bool);
    refused!(numbers bool);
    refused! {
        bool:
        serialize_map(Option<usize>) -> Self::SerializeMap;
        serialize_tuple(usize) -> Self::SerializeTuple;
    }
}
