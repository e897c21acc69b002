//! Small codes that keep unknown values.

/// A code with names for some values; `Other` keeps the rest as received.
macro_rules! code {
    (
        $(#[$meta:meta])*
        $name:ident: $raw:ty = $serde:literal { $($(#[$variant_meta:meta])* $variant:ident = $value:literal,)+ }
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
    };
}

code! {
    /// Verdict of a pong or an acknowledgement on the frame that it answers (ruling U12).
    ErrorCode: u8 = "u8" {
        /// It arrived undamaged.
        Fine = 0,
        /// It arrived damaged.
        Damaged = 1,
    }
}

code! {
    /// Sensors to calibrate.
    CalibrationKind: u8 = "u8" {
        /// The magnetometer; the host must turn the robot meanwhile.
        Magnetometer = 1,
        /// Accelerometer and gyroscope; the robot must stand still meanwhile.
        Imu = 2,
    }
}

code! {
    /// The robot's answer to a firmware update request. Shipped robots never send it.
    OtaStatus: u8 = "u8" {
        /// The update starts.
        Accepted = 0,
        /// An unknown error.
        Failed = 1,
        /// Not allowed.
        Forbidden = 2,
    }
}

code! {
    /// State of the host's network, shown by the robot's lamp (ruling U8).
    ///
    /// A host sends one byte; some send four, hence the wide `Other`.
    NetworkState: u32 = "u32" {
        /// Not known yet: the state after power-on.
        Unknown = 0,
        /// No SIM card.
        SimAbsent = 1,
        /// No network.
        Disconnected = 2,
        /// Connected.
        Connected = 3,
        /// Firmware update in progress; not in the protocol document.
        Ota = 4,
    }
}
