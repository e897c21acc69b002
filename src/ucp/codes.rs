//! Small codes that keep unknown values.

use core::fmt::{self, Write};

use super::{catalogue::catalogue_of_codes, value::Value};
use crate::{
    field::{Kind, Typed},
    text::Line,
};

/// Codes with names for some values; `Other` keeps the rest as received and prints as a number
/// behind a word.
macro_rules! codes {
    ($(
        $(#[$meta:meta])*
        $name:ident: $raw:ty = $serde:literal, $other:literal {
            $($(#[$variant_meta:meta])* $variant:ident = $value:literal, $text:literal;)+
        }
    )+) => {$(
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        #[cfg_attr(feature = "serde", serde(from = $serde, into = $serde))]
        pub enum $name {
            $($(#[$variant_meta])* $variant,)+
            /// Any other value, as received.
            Other($raw),
        }

        impl From<$raw> for $name {
            fn from(raw: $raw) -> Self {
                match raw {
                    $($value => Self::$variant,)+
                    other => Self::Other(other),
                }
            }
        }

        /// By the value on the wire, so that `Other` never holds a value that has a name.
        #[cfg(feature = "arbitrary")]
        impl<'a> arbitrary::Arbitrary<'a> for $name {
            fn arbitrary(u: &mut arbitrary::Unstructured<'a>) -> arbitrary::Result<Self> {
                u.arbitrary::<$raw>().map(Self::from)
            }
        }

        impl From<$name> for $raw {
            fn from(code: $name) -> Self {
                match code {
                    $($name::$variant => $value,)+
                    $name::Other(other) => other,
                }
            }
        }

        impl Value for $name {
            type Wire = <$raw as Value>::Wire;

            const IS_WORDS: bool = true;

            fn from_wire(bytes: Self::Wire) -> Self {
                <$raw>::from_wire(bytes).into()
            }

            fn to_wire(self) -> Self::Wire {
                <$raw>::from(self).to_wire()
            }

            /// Appends the words, or the number of a value without a name.
            fn print(self, line: &mut Line<'_>) {
                match self {
                    $(Self::$variant => line.text($text),)+
                    Self::Other(other) => {
                        line.text(concat!($other, " "));
                        line.fixed::<0>(false, other.into(), 0);
                    }
                }
            }
        }

        impl Typed for $name {
            const KIND: Kind = <$raw>::KIND;
            const VALUES: &'static [(u32, &'static str)] = &[$(($value, $text)),+];
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                match self {
                    $(Self::$variant => f.pad($text),)+
                    Self::Other(other) => {
                        let mut text = heapless::String::<16>::new();
                        write!(text, concat!($other, " {}"), other)?;
                        f.pad(&text)
                    }
                }
            }
        }
    )+};
}

catalogue_of_codes! { codes }
