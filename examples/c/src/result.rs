//! What every function returns.

use core::ffi::{CStr, c_char};

use axlewire::{
    error::{EncodeError, ParseError},
    ikeya::master::CommandError as MasterError,
    ucp::host::CommandError as HostError,
};

/// What a function returns: `AXLE_OK`, `AXLE_NONE`, or an error, which is negative.
///
/// A function that returns an error has done nothing, and has written to none of its outputs.
pub type axle_result = i32;

/// Makes the constants, their names and their texts of one table.
macro_rules! results {
    ($($(#[$doc:meta])* $name:ident = $value:literal, $text:literal;)*) => {
        $($(#[$doc])* pub const $name: axle_result = $value;)*

        /// Its name, such as "AXLE_ERROR_NULL"; "?" for a number that is no result.
        #[unsafe(no_mangle)]
        pub extern "C" fn axle_result_name(result: axle_result) -> *const c_char {
            name(result).as_ptr()
        }

        /// What it means, in a few words.
        #[unsafe(no_mangle)]
        pub extern "C" fn axle_result_text(result: axle_result) -> *const c_char {
            text(result).as_ptr()
        }

        const fn name(result: axle_result) -> &'static CStr {
            match result {
                $($value => match CStr::from_bytes_with_nul(concat!(stringify!($name), "\0").as_bytes()) {
                    Ok(name) => name,
                    Err(_) => c"",
                },)*
                _ => c"?",
            }
        }

        const fn text(result: axle_result) -> &'static CStr {
            match result {
                $($value => $text,)*
                _ => c"unknown result",
            }
        }

        #[cfg(test)]
        const ALL: &[axle_result] = &[$($name),*];
    };
}

results! {
    /// Done.
    AXLE_OK = 0, c"done";
    /// Done, and there is nothing: no event, no bytes, no deadline, no value yet.
    AXLE_NONE = 1, c"nothing there";

    /// A pointer is null.
    AXLE_ERROR_NULL = -1, c"a pointer is null";
    /// The memory is not of the size that this library needs: header and library are of different
    /// versions.
    AXLE_ERROR_SIZE = -2, c"memory of another size: header and library differ";
    /// The object has not been initialised, or its memory was overwritten.
    AXLE_ERROR_NOT_INITIALIZED = -3, c"the object is not initialised";
    /// The object is in use: by a call that an interrupt has suspended, or by another thread.
    AXLE_ERROR_BUSY = -4, c"the object is in use by another call";
    /// A pointer is not aligned as its type.
    AXLE_ERROR_ALIGNMENT = -5, c"a pointer is not aligned";
    /// The length is longer than any memory.
    AXLE_ERROR_TOO_LONG = -6, c"a length is longer than any memory";
    /// The bytes are in the memory of the object itself, or of the output.
    AXLE_ERROR_OVERLAP = -7, c"the bytes are in the memory of the object or output";
    /// A number that stands for none of its kinds.
    AXLE_ERROR_VALUE = -8, c"a number that has no meaning here";

    /// A node id outside 1 to 8 (ruling I1).
    AXLE_ERROR_NODE_ID = -20, c"node id is outside 1 to 8";
    /// DIP switches that select no node (ruling I2).
    AXLE_ERROR_DIP_SWITCH = -21, c"DIP switches select no node";
    /// NaN or infinity, where a motor needs a finite number (ruling I4).
    AXLE_ERROR_NOT_FINITE = -22, c"not a finite number";
    /// A position outside the range of count and rotation (ruling I5).
    AXLE_ERROR_POSITION = -23, c"position is outside its range";
    /// A speed or turn outside -100 to 100 (rulings U6, U7).
    AXLE_ERROR_PERCENT = -24, c"speed or turn is outside -100 to 100";
    /// A network state above 255 (ruling U8).
    AXLE_ERROR_NETWORK_STATE = -25, c"network state does not fit into one byte";
    /// The buffer is too small for the frame.
    AXLE_ERROR_BUFFER_TOO_SMALL = -26, c"buffer is too small for the frame";
    /// The body is longer than shipped robots can handle (rulings U2, U13).
    AXLE_ERROR_BODY_TOO_LONG = -27, c"body is too long";
    /// An unknown frame with the id of a known message (rulings U7, U13).
    AXLE_ERROR_KNOWN_ID = -28, c"the id is that of a known message";
    /// An unknown frame with FD FF behind its header (ruling U13).
    AXLE_ERROR_NESTED_HEADER = -29, c"FD FF inside the frame";
    /// A motor command that would start a firmware update (rulings U7, U13).
    AXLE_ERROR_STARTS_UPDATE = -30, c"the command would start a firmware update";

    /// The bytes are not as long as a packet, or as the length in its header.
    AXLE_ERROR_LENGTH = -40, c"not the length of a packet";
    /// The header or the node id has a value that no packet has.
    AXLE_ERROR_FIELD = -41, c"not the header of a packet";
    /// The CRC does not match (ruling B1).
    AXLE_ERROR_CRC = -42, c"CRC does not match";
    /// The decoder is full: poll its events until `AXLE_NONE`, then push the byte again.
    AXLE_ERROR_FULL = -43, c"decoder is full";

    /// The node is not online: it has not answered yet, or no longer does (ruling I7).
    AXLE_ERROR_NOT_ONLINE = -60, c"node is not online";
    /// The node is in the other mode (ruling I3).
    AXLE_ERROR_WRONG_MODE = -61, c"node is in the other mode";
    /// The mode of the node is in doubt; it is being read (ruling I11).
    AXLE_ERROR_MODE_IN_DOUBT = -62, c"mode of the node is in doubt";
    /// The node is owed a stop, which comes first (ruling I12).
    AXLE_ERROR_STOP_OWED = -63, c"node is owed a stop";
    /// The node has no set-point that could be confirmed.
    AXLE_ERROR_NO_SET_POINT = -64, c"node has no set-point";

    /// The robot is not heard (ruling U16).
    AXLE_ERROR_LINK_DOWN = -80, c"robot is not heard";
    /// A calibration request is not answered yet, or its event has no room yet.
    AXLE_ERROR_CALIBRATING = -81, c"a calibration request is pending";
    /// A kind of calibration that shipped robots do not know.
    AXLE_ERROR_CALIBRATION_KIND = -82, c"unknown kind of calibration";
    /// The robot hangs on such an id, and `low_ids_only` is set (ruling U14).
    AXLE_ERROR_LOW_IDS_ONLY = -83, c"not sent to a robot of low ids only";
    /// The robot is not seen to stand still behind a stop (ruling U16).
    AXLE_ERROR_MOVING = -84, c"robot is not seen to stand still";
    /// A firmware update is going on.
    AXLE_ERROR_UPDATING = -85, c"a firmware update is going on";

    /// Refused for a reason that is newer than this header.
    AXLE_ERROR_OTHER = -100, c"refused";
}

/// The result of an operation that has none but its success.
pub(crate) fn of(result: Result<(), axle_result>) -> axle_result {
    result.err().unwrap_or(AXLE_OK)
}

pub(crate) fn of_encode(error: EncodeError) -> axle_result {
    match error {
        EncodeError::NodeId { .. } => AXLE_ERROR_NODE_ID,
        EncodeError::DipSwitch { .. } => AXLE_ERROR_DIP_SWITCH,
        EncodeError::NotFinite { .. } => AXLE_ERROR_NOT_FINITE,
        EncodeError::Position { .. } => AXLE_ERROR_POSITION,
        EncodeError::Percent { .. } => AXLE_ERROR_PERCENT,
        EncodeError::NetworkState { .. } => AXLE_ERROR_NETWORK_STATE,
        EncodeError::BufferTooSmall { .. } => AXLE_ERROR_BUFFER_TOO_SMALL,
        EncodeError::BodyTooLong { .. } => AXLE_ERROR_BODY_TOO_LONG,
        EncodeError::KnownId { .. } => AXLE_ERROR_KNOWN_ID,
        EncodeError::NestedHeader { .. } => AXLE_ERROR_NESTED_HEADER,
        EncodeError::StartsUpdate { .. } => AXLE_ERROR_STARTS_UPDATE,
        _ => AXLE_ERROR_OTHER,
    }
}

pub(crate) fn of_parse(error: ParseError) -> axle_result {
    match error {
        ParseError::Length { .. } => AXLE_ERROR_LENGTH,
        ParseError::Field => AXLE_ERROR_FIELD,
        ParseError::Crc { .. } => AXLE_ERROR_CRC,
        _ => AXLE_ERROR_OTHER,
    }
}

pub(crate) fn of_master(error: MasterError) -> axle_result {
    match error {
        MasterError::NotOnline { .. } => AXLE_ERROR_NOT_ONLINE,
        MasterError::WrongMode { .. } => AXLE_ERROR_WRONG_MODE,
        MasterError::ModeInDoubt { .. } => AXLE_ERROR_MODE_IN_DOUBT,
        MasterError::StopOwed { .. } => AXLE_ERROR_STOP_OWED,
        MasterError::NoSetPoint { .. } => AXLE_ERROR_NO_SET_POINT,
        _ => AXLE_ERROR_OTHER,
    }
}

pub(crate) fn of_host(error: HostError) -> axle_result {
    match error {
        HostError::LinkDown => AXLE_ERROR_LINK_DOWN,
        HostError::Calibrating => AXLE_ERROR_CALIBRATING,
        HostError::CalibrationKind { .. } => AXLE_ERROR_CALIBRATION_KIND,
        HostError::LowIdsOnly { .. } => AXLE_ERROR_LOW_IDS_ONLY,
        HostError::Moving => AXLE_ERROR_MOVING,
        HostError::Updating => AXLE_ERROR_UPDATING,
        HostError::Value(error) => of_encode(error),
        _ => AXLE_ERROR_OTHER,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_result_has_a_number_a_name_and_a_text_of_its_own() {
        for (place, &result) in ALL.iter().enumerate() {
            assert!(name(result).to_bytes().starts_with(b"AXLE_"));
            assert!(!text(result).is_empty());
            for &other in &ALL[..place] {
                assert_ne!(name(result), name(other));
                assert_ne!(text(result), text(other));
            }
        }
        assert_eq!((name(7), text(i32::MIN)), (c"?", c"unknown result"));
    }
}
