//! Small codes that keep unknown values.

use core::fmt::{self, Write};

use crate::text::Line;

/// A code with names for some values; `Other` keeps the rest as received and prints as a number
/// behind a word.
macro_rules! code {
    (
        $(#[$meta:meta])*
        $name:ident: $raw:ty = $serde:literal, $other:literal {
            $($(#[$variant_meta:meta])* $variant:ident = $value:literal, $text:literal;)+
        }
    ) => {
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

        impl $name {
            /// Appends the words, or the number of a value without a name.
            pub(super) fn print(self, line: &mut Line<'_>) {
                match self {
                    $(Self::$variant => line.text($text),)+
                    Self::Other(other) => {
                        line.text(concat!($other, " "));
                        line.fixed::<0>(false, other.into(), 0);
                    }
                }
            }
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
    };
}

code! {
    /// Verdict of a pong or an acknowledgement on the frame that it answers (ruling U12).
    ErrorCode: u8 = "u8", "err" {
        /// It arrived undamaged.
        Fine = 0, "fine";
        /// It arrived damaged.
        Damaged = 1, "damaged";
    }
}

code! {
    /// Sensors to calibrate.
    CalibrationKind: u8 = "u8", "type" {
        /// The magnetometer; the host must turn the robot meanwhile.
        Magnetometer = 1, "magnetometer";
        /// Accelerometer and gyroscope; the robot must stand still meanwhile.
        Imu = 2, "IMU";
    }
}

code! {
    /// The robot's answer to a firmware update request. Shipped robots never send it.
    OtaStatus: u8 = "u8", "err" {
        /// The update starts.
        Accepted = 0, "accepted";
        /// An unknown error.
        Failed = 1, "failed";
        /// Not allowed.
        Forbidden = 2, "forbidden";
    }
}

code! {
    /// State of the host's network, shown by the robot's lamp (ruling U8).
    ///
    /// A host sends one byte; some send four, hence the wide `Other`.
    NetworkState: u32 = "u32", "state" {
        /// Not known yet: the state after power-on.
        Unknown = 0, "unknown";
        /// No SIM card.
        SimAbsent = 1, "SIM absent";
        /// No network.
        Disconnected = 2, "disconnected";
        /// Connected.
        Connected = 3, "connected";
        /// Firmware update in progress; not in the protocol document.
        Ota = 4, "firmware update";
    }
}
