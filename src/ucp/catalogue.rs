//! The messages and their codes: the one place that lists them (ruling U4).
//!
//! Each table is handed, as it is, to macros that make code of it, as an X-macro of C is:
//! `message_ids` makes `MessageId`, `plain_bodies` the bodies, `messages` the enum `Message`, and
//! `codes` the codes. Decoding, encoding, text and `serde` follow.
//!
//! **A new message is a new entry:**
//!
//! ```text
//! /// What the id is for.
//! Id = 0x42 {
//!     /// What the message is for.
//!     to_robot "name_in_json" Name(&'a Name) {
//!         /// What the value is.
//!         field: [u8; 2] as u16 = "field_ms" in "ms",
//!     }
//! }
//! ```
//!
//! The entry has the direction, the name in snake case, the variant of `Message` with what it
//! holds, and the fields of the body in the order on the wire. Of each field:
//!
//! * `[u8; 2]`: the bytes on the wire, little-endian.
//! * `as u16`: the value in them: an integer of 8, 16 or 32 bits, a code, or an array of those.
//! * `= "field_ms"`: its key in JSON.
//! * `in "ms"`: its unit in text, `field 40 ms`; optional. `raw "0.1 V"` instead: what 1 is, where
//!   the text has the number alone.
//! * `by "U11"`: the ruling that decides it; optional.
//!
//! The struct, `new`, a getter of each field, text, data and the entry in
//! [`FIELDS`](crate::fields::FIELDS) are made of these: a *plain* message. With `;` in place of the
//! fields, the body is written by hand, with `Print` in `contents` and its fields in `fields`: for
//! a range, a layout of its own, or a rule for what may be sent.
//!
//! It does not compile if two bodies of an id have one length, if a body is longer than 56 bytes,
//! or if a key is one that every frame has. The roles do not send it: that is for them to say.
//!
//! The unit tests, in `src/ucp/tests.rs`, add a message. Three tests in `tests/wire` repeat
//! ruling U4, and fail until the message is there, too. Two others fail until the page `fields` and
//! the JSON Schema of the tool have it; with `AXLEWIRE_WRITE=1` they write them.

/// Hands a table to the macro that expands it.
#[cfg(not(all(test, feature = "serde")))]
macro_rules! expand_table {
    ($expand:ident $($table:tt)+) => {
        $expand! { $($table)+ }
    };
}
#[cfg(not(all(test, feature = "serde")))]
pub(super) use expand_table;

#[cfg(all(test, feature = "serde"))]
pub(super) use super::tests::expand_table;

/// The messages, by id.
macro_rules! catalogue {
    ($expand:ident) => {
        $crate::ucp::catalogue::expand_table! { $expand
            /// Ping to the robot, pong to the host.
            Ping = 1 {
                /// Host to robot: checks that the robot is there. No body.
                to_robot "ping" Ping(&'a Ping) {}

                /// Robot to host, answers a ping: `err`, 1 byte.
                to_host "pong" Pong(&'a Pong) {
                    /// Whether the ping arrived undamaged.
                    err: u8 as ErrorCode = "err" by "U12",
                }
            }

            /// Motor and lamp command to the robot.
            MotorControl = 2 {
                to_robot "motor_control" MotorControl(&'a RawMotorControl);
            }

            /// Calibration start to the robot, its acknowledgement to the host.
            CalibrationStart = 3 {
                /// Host to robot, begins a calibration: `type`, 1 byte (ruling U11).
                to_robot "calibration_start" CalibrationStart(&'a CalibrationStart) {
                    /// Sensors to be calibrated.
                    kind: u8 as CalibrationKind = "type" by "U11",
                }

                /// Robot to host, answers the start at once: `type | err`, 2 bytes.
                to_host "calibration_start_ack" CalibrationStartAck(&'a CalibrationStartAck) {
                    /// Sensors being calibrated.
                    kind: u8 as CalibrationKind = "type" by "U11",
                    /// Whether the request arrived undamaged.
                    err: u8 as ErrorCode = "err" by "U12",
                }
            }

            /// Calibration end to the robot, its acknowledgement to the host.
            CalibrationEnd = 4 {
                /// Host to robot, ends a calibration: `type`, 1 byte (ruling U11).
                to_robot "calibration_end" CalibrationEnd(&'a CalibrationEnd) {
                    /// Sensors that were calibrated.
                    kind: u8 as CalibrationKind = "type" by "U11",
                }

                /// Robot to host, answers the end at once: `type | err`, 2 bytes.
                ///
                /// The vendor firmware returns the type of the last *start* here.
                to_host "calibration_end_ack" CalibrationEndAck(&'a CalibrationEndAck) {
                    /// Sensors that were calibrated.
                    kind: u8 as CalibrationKind = "type" by "U11",
                    /// Whether the request arrived undamaged.
                    err: u8 as ErrorCode = "err" by "U12",
                }
            }

            /// Telemetry to the host.
            Report = 5 {
                to_host "report" Report(Report<'a>);
            }

            /// Accelerometer and gyroscope biases to the host, their acknowledgement to the robot.
            ImuBias = 6 {
                /// Robot to host, the result of an IMU calibration, raw as in a
                /// [report](super::message::Report): `acc: 3 × i16 | gyro: 3 × i16`, 12 bytes.
                ///
                /// Repeated every 1000 ms until acknowledged; the robot does not store it (U11).
                to_host "imu_bias" ImuBias(&'a ImuBias) {
                    /// Bias of the accelerometer x, y, z.
                    acc: [[u8; 2]; 3] as [i16; 3] = "acc_bias" raw "1/16384 g" by "U11",
                    /// Bias of the gyroscope x, y, z.
                    gyro: [[u8; 2]; 3] as [i16; 3] = "gyro_bias" raw "1/16.4 °/s" by "U11",
                }

                /// Host to robot, acknowledges an [`ImuBias`]: `err`, 1 byte.
                to_robot "imu_bias_ack" ImuBiasAck(&'a ImuBiasAck) {
                    /// Whether it arrived undamaged; the vendor firmware ignores it.
                    err: u8 as ErrorCode = "err" by "U12",
                }
            }

            /// Magnetometer biases to the host, their acknowledgement to the robot.
            MagBias = 7 {
                /// Robot to host, the result of a magnetometer calibration, raw as in a
                /// [report](super::message::Report): `mag: 3 × i16`, 6 bytes.
                ///
                /// Repeated every 1000 ms until acknowledged; the robot does not store it (U11).
                to_host "mag_bias" MagBias(&'a MagBias) {
                    /// Bias of the magnetometer x, y, z.
                    mag: [[u8; 2]; 3] as [i16; 3] = "mag_bias" raw "sensor count" by "U11",
                }

                /// Host to robot, acknowledges a [`MagBias`]: `err`, 1 byte.
                to_robot "mag_bias_ack" MagBiasAck(&'a MagBiasAck) {
                    /// Whether it arrived undamaged; the vendor firmware ignores it.
                    err: u8 as ErrorCode = "err" by "U12",
                }
            }

            /// Request for the stored biases to the host, the biases to the robot.
            Biases = 8 {
                /// Robot to host, asks for the stored biases at boot, every 1000 ms until answered.
                /// No body.
                to_host "bias_request" BiasRequest(&'a BiasRequest) {}

                to_robot "biases" Biases(&'a Biases);
            }

            /// Firmware update request to the robot, its acknowledgement to the host.
            Ota = 9 {
                to_robot "ota_request" OtaRequest(&'a RawOtaRequest);

                /// Robot to host, answers an [`OtaRequest`](super::message::OtaRequest): `err`, 1
                /// byte. Shipped robots never send it.
                to_host "ota_ack" OtaAck(&'a OtaAck) {
                    /// The robot's decision on the request.
                    status: u8 as OtaStatus = "err" by "U4",
                }
            }

            /// State of the host's network to the robot, shown by its lamp.
            NetworkState = 0x0A {
                to_robot "network_state" SetNetworkState(&'a SetNetworkState);
                to_robot "network_state" SetNetworkStateWide(&'a SetNetworkStateWide);
            }
        }
    };
}
pub(super) use catalogue;

/// The codes: integers whose values have names. An entry has the integer, twice, the word in front
/// of a value without a name, and of each value the variant and its text.
macro_rules! catalogue_of_codes {
    ($expand:ident) => {
        $crate::ucp::catalogue::expand_table! { $expand
            /// Verdict of a pong or an acknowledgement on the frame that it answers (ruling U12).
            ErrorCode: u8 = "u8", "err" {
                /// It arrived undamaged.
                Fine = 0, "fine";
                /// It arrived damaged.
                Damaged = 1, "damaged";
            }

            /// Sensors to calibrate.
            CalibrationKind: u8 = "u8", "type" {
                /// The magnetometer; the host must turn the robot meanwhile.
                Magnetometer = 1, "magnetometer";
                /// Accelerometer and gyroscope; the robot must stand still meanwhile.
                Imu = 2, "IMU";
            }

            /// The robot's answer to a firmware update request. Shipped robots never send it.
            OtaStatus: u8 = "u8", "err" {
                /// The update starts.
                Accepted = 0, "accepted";
                /// An unknown error.
                Failed = 1, "failed";
                /// Not allowed.
                Forbidden = 2, "forbidden";
            }

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
    };
}
pub(super) use catalogue_of_codes;
