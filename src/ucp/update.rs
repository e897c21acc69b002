//! Firmware update requests: those that may be sent, and those that were received.

use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout, Unaligned, transmute};

use super::{
    frame::{Body, debug_values, sealed::Sealed},
    header::MessageId,
};

/// Host to robot, **starts a firmware update** if `version: i16` is above the robot's own, 2 bytes.
/// The robot then leaves this protocol and waits for YMODEM on the same line.
///
/// Made only by [`start_firmware_update`](Self::start_firmware_update) (ruling U7): no bytes can be
/// cast to this type, and a received request is a [`RawOtaRequest`].
///
/// ```compile_fail
/// use axlewire::ucp::message::OtaRequest;
/// use zerocopy::FromBytes;
/// let request = OtaRequest::read_from_bytes(&[40, 0]); // no such method
/// ```
#[derive(Clone, Copy, Eq, Hash, PartialEq)]
#[derive(IntoBytes, Immutable, KnownLayout, Unaligned)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::NoUninit))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct OtaRequest {
    version: [u8; 2],
}

debug_values! { OtaRequest: version }

impl Sealed for OtaRequest {}

impl Body for OtaRequest {
    const ID: MessageId = MessageId::Ota;
}

impl OtaRequest {
    /// **Starts a firmware update** in a robot whose firmware is older than `version`.
    #[must_use]
    pub const fn start_firmware_update(version: i16) -> Self {
        Self { version: version.to_le_bytes() }
    }

    /// The version offered.
    #[must_use]
    pub const fn version(&self) -> i16 {
        i16::from_le_bytes(self.version)
    }
}

/// A firmware update request as received: `version: i16`, 2 bytes.
///
/// It cannot be framed, so that nothing received starts an update (ruling U7).
/// [`Frame::relay_unchecked`](super::Frame::relay_unchecked) passes on its frame, byte for byte.
///
/// ```compile_fail
/// use axlewire::ucp::{message::RawOtaRequest, Body};
/// fn send(received: RawOtaRequest) {
///     let _ = received.frame(0); // no such method
/// }
/// ```
#[derive(Clone, Copy, Eq, Hash, PartialEq)]
#[derive(FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::Pod, bytemuck::Zeroable))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct RawOtaRequest {
    version: [u8; 2],
}

debug_values! { RawOtaRequest: version }

impl RawOtaRequest {
    /// The version offered.
    #[must_use]
    pub const fn version(&self) -> i16 {
        i16::from_le_bytes(self.version)
    }
}

impl From<OtaRequest> for RawOtaRequest {
    fn from(request: OtaRequest) -> Self {
        transmute!(request)
    }
}
