//! Errors of a driver: each message is one line, and the cause is its source.

use std::error::Error;

#[cfg(feature = "ucp")]
use axlewire::ucp;
use axlewire::{
    drive::DriveError,
    ikeya::{self, NodeId},
};

use crate::port::Unplugged;

#[test]
fn an_error_of_the_port_is_the_source_and_every_error_is_one_line() {
    let error = DriveError::Port(Unplugged);
    assert_eq!(error.source().unwrap().to_string(), "unplugged");
    assert_eq!(error.to_string(), "port failed: unplugged");
    assert!(DriveError::<Unplugged>::Closed.source().is_none());
    assert_eq!(
        DriveError::<Unplugged>::Closed.to_string(),
        "port is closed: the other end has gone"
    );
    assert_eq!(DriveError::<Unplugged>::WriteZero.to_string(), "port took no bytes");
    let bus = ikeya::master::CommandError::NotOnline { node: NodeId::N2 };
    let told = DriveError::<Unplugged>::from(bus).source().unwrap().to_string();
    assert_eq!(told, bus.to_string());
}

#[cfg(feature = "ucp")]
#[test]
fn a_refused_value_is_the_source_of_the_refusal_which_is_the_source_of_the_error() {
    let value = ucp::MotorControl::new(101, 0).unwrap_err();
    let rover = ucp::host::CommandError::Value(value);
    assert_eq!(rover.source().unwrap().to_string(), value.to_string());
    let told = DriveError::<Unplugged>::from(rover).source().unwrap().to_string();
    assert_eq!(told, rover.to_string());
}
