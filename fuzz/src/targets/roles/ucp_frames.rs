//! Good frames of either side.

use arbitrary::{Result, Unstructured};
use axlewire::ucp::{
    self, Body, Message,
    message::{ImuBias, MagBias},
};

use super::oracle;

/// Whether only a host may send this message; excludes those of both directions.
pub(super) fn is_to_robot(message: &Message<'_>) -> bool {
    matches!(
        message,
        Message::Ping(_)
            | Message::MotorControl(_)
            | Message::CalibrationStart(_)
            | Message::CalibrationEnd(_)
            | Message::ImuBiasAck(_)
            | Message::MagBiasAck(_)
            | Message::Biases(_)
            | Message::OtaRequest(_)
            | Message::SetNetworkState(_)
            | Message::SetNetworkStateWide(_)
    )
}

/// A good frame of a robot.
pub(super) fn from_robot(u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let index = u.arbitrary()?;
    Ok(match u.int_in_range(0..=8)? {
        0 => ucp::message::Pong::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        1 => {
            ucp::message::FirmwareReport::new(&u.arbitrary()?, 38).frame(index).as_bytes().to_vec()
        }
        7 => ucp::message::DocumentReport::new(&u.arbitrary()?).frame(index).as_bytes().to_vec(),
        2 => ucp::message::BiasRequest {}.frame(index).as_bytes().to_vec(),
        3 => ImuBias::new(u.arbitrary()?, u.arbitrary()?).frame(index).as_bytes().to_vec(),
        4 => MagBias::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        5 => {
            let ack = ucp::message::CalibrationStartAck::new(u.arbitrary()?, u.arbitrary()?);
            ack.frame(index).as_bytes().to_vec()
        }
        6 => {
            let ack = ucp::message::CalibrationEndAck::new(u.arbitrary()?, u.arbitrary()?);
            ack.frame(index).as_bytes().to_vec()
        }
        _ => ucp::message::OtaAck::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
    })
}

/// A good frame of a host, possibly a careless one.
pub(super) fn from_host(u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let index = u.arbitrary()?;
    Ok(match u.int_in_range(0..=9)? {
        0 => ucp::message::Ping {}.frame(index).as_bytes().to_vec(),
        1 | 2 => {
            // Any sixteen bytes, including values out of range and versions that start an update.
            let body: [u8; 16] = u.arbitrary()?;
            let mut frame = vec![0xFD, 0xFF, 20, 0, 2, index];
            frame.extend(body);
            frame.extend([0, 0]);
            oracle::seal(&mut frame);
            frame
        }
        3 => ucp::message::CalibrationStart::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        4 => ucp::message::CalibrationEnd::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        5 => ucp::message::ImuBiasAck::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        6 => ucp::message::MagBiasAck::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        7 => {
            let (imu, mag) = (imu(u)?, MagBias::new(u.arbitrary()?));
            ucp::message::Biases::new(imu, mag).frame(index).as_bytes().to_vec()
        }
        8 => {
            // The state of the network in four bytes, as some hosts send it.
            let state: [u8; 4] = u.arbitrary()?;
            let mut frame = [&[0xFD, 0xFF, 8, 0, 0x0A, index][..], &state, &[0, 0]].concat();
            oracle::seal(&mut frame);
            frame
        }
        _ => ucp::message::OtaRequest::start_firmware_update(u.arbitrary()?)
            .frame(index)
            .as_bytes()
            .to_vec(),
    })
}

pub(super) fn imu(u: &mut Unstructured<'_>) -> Result<ImuBias> {
    Ok(ImuBias::new(u.arbitrary()?, u.arbitrary()?))
}
