//! Makes bodies: the struct of bytes of any of them, and all that a plain message of the table in
//! `catalogue` needs.

/// Declares bodies: a struct of private byte fields, alignment 1, the id of its message, and the
/// getters whose values `{:?}` shows.
macro_rules! body {
    ($(
        $(#[$meta:meta])*
        pub struct $name:ident($id:ident) { $($field:ident: $ty:ty),* } => $($getter:ident),*;
    )+) => {$(
        $(#[$meta])*
        #[derive(Clone, Copy, Eq, Hash, PartialEq)]
        #[derive(
            zerocopy::FromBytes, zerocopy::IntoBytes, zerocopy::Immutable, zerocopy::KnownLayout,
            zerocopy::Unaligned,
        )]
        #[cfg_attr(feature = "bytemuck", derive(bytemuck::Pod, bytemuck::Zeroable))]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(C)]
        pub struct $name { $($field: $ty),* }

        $crate::ucp::frame::debug_values! { $name: $($getter),* }

        impl $crate::ucp::frame::sealed::Sealed for $name {}

        impl $crate::ucp::frame::Body for $name {
            const ID: $crate::ucp::header::MessageId = $crate::ucp::header::MessageId::$id;
        }
    )+};
}
pub(super) use body;

/// The bodies of all plain messages.
macro_rules! plain_bodies {
    ($(
        $(#[$id_doc:meta])*
        $id:ident = $number:literal {$(
            $(#[$doc:meta])*
            $direction:ident $name:literal $variant:ident($held:ty) $body:tt
        )+}
    )+) => {$($(
        $crate::ucp::plain::plain_body! { $(#[$doc])* $variant($id) $body }
    )+)+};
}
pub(super) use plain_bodies;

/// One body.
macro_rules! plain_body {
    // Another file has it.
    ($name:ident($id:ident) ;) => {};

    // No value, so neither `new` nor getters.
    ($(#[$doc:meta])* $name:ident($id:ident) {}) => {
        $crate::ucp::plain::body! { $(#[$doc])* pub struct $name($id) {} =>; }

        impl $crate::ucp::value::Print for $name {
            fn print(&self, _: &mut $crate::text::Line<'_>, _: &'static str) {}
        }

        impl $crate::ucp::value::Described for $name {
            const LAYOUTS: &'static [$crate::ucp::value::Layout] = &[&[]];
        }

        #[cfg(feature = "serde")]
        impl $crate::map::Fields for $name {
            fn put<M: serde::ser::SerializeMap>(&self, _: &mut M) -> Result<(), M::Error> {
                Ok(())
            }
        }
    };

    ($(#[$doc:meta])* $name:ident($id:ident) {$(
        $(#[doc = $field_doc:literal])*
        $field:ident: $wire:ty as $value:ty = $key:literal
            $(in $unit:literal)? $(raw $raw_unit:literal)? $(by $source:literal)?,
    )+}) => {
        $crate::ucp::plain::body! {
            $(#[$doc])*
            pub struct $name($id) { $($field: $wire),+ } => $($field),+;
        }

        impl $name {
            /// A message with these values.
            #[allow(clippy::too_many_arguments, reason = "as many as the message has values")]
            #[must_use]
            pub fn new($($field: $value),+) -> Self {
                Self { $($field: $crate::ucp::value::Value::to_wire($field)),+ }
            }

            $(
                $(#[doc = $field_doc])*
                #[must_use]
                pub fn $field(&self) -> $value {
                    $crate::ucp::value::Value::from_wire(self.$field)
                }
            )+
        }

        impl $crate::ucp::value::Print for $name {
            fn print(&self, line: &mut $crate::text::Line<'_>, before: &'static str) {
                $crate::ucp::value::List::new(line, before)
                    $(.value(stringify!($field), self.$field(), concat!($($unit)?)))+;
            }
        }

        impl $crate::ucp::value::Described for $name {
            const LAYOUTS: &'static [$crate::ucp::value::Layout] = &[&[&[$(
                $crate::field::field! {
                    $(#[doc = $field_doc])*
                    $key: $value, $($unit)? $($raw_unit)? by concat!($($source)?)
                }
            ),+]]];
        }

        #[cfg(feature = "serde")]
        impl $crate::map::Fields for $name {
            fn put<M: serde::ser::SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
                $(map.serialize_entry($key, &self.$field())?;)+
                Ok(())
            }
        }

        // A line of text is ASCII, and a key occurs once in the JSON of a frame.
        $(const _: () = assert!(
            concat!($($unit)?).is_ascii() && $crate::ucp::plain::is_free($key),
            concat!("unit or key of ", stringify!($name), " cannot be used: ", $key)
        );)+
    };
}
pub(super) use plain_body;

/// Whether a field may have this key in JSON: the others are those of all frames.
pub(super) const fn is_free(key: &str) -> bool {
    let of_library = matches!(
        key.as_bytes(),
        b"length" | b"protocol" | b"message" | b"id" | b"index" | b"bytes"
    );
    let of_tool =
        matches!(key.as_bytes(), b"event" | b"offset" | b"t" | b"interface" | b"direction");
    !(of_library || of_tool)
}

#[cfg(test)]
mod tests {
    use super::is_free;

    #[test]
    fn a_field_may_not_have_the_key_of_another_field_of_the_same_frame() {
        for key in ["length", "protocol", "message", "id", "index", "bytes"] {
            assert!(!is_free(key), "{key}");
        }
        for key in ["event", "offset", "t", "interface", "direction"] {
            assert!(!is_free(key), "{key}");
        }
        for key in ["err", "acc_bias", "time"] {
            assert!(is_free(key), "{key}");
        }
    }
}
