//! The text of Ikeya packets, against core's formatting of the same values.

use axlewire::ikeya::master::NodeSet;
use axlewire::ikeya::{
    Mode, NodeId, Packet, Position, PositionResponse, ReadRequest, Request, Response, Rps,
    VelocityResponse, WriteRequest, three,
};
use proptest::prelude::*;

use super::spaced;
use crate::rig::sealed;

#[test]
fn a_set_of_nodes_is_printed_as_a_list() {
    for (nodes, text) in [
        (&[][..], "none"),
        (&[NodeId::N3], "3"),
        (&[NodeId::N8, NodeId::N3], "3 and 8"),
        (&[NodeId::N1, NodeId::N8, NodeId::N3], "1, 3 and 8"),
    ] {
        let set: NodeSet = nodes.iter().copied().collect();
        assert_eq!(set.to_string(), text);
    }
}

fn place(positions: &[Position]) -> String {
    format!(
        "{} turns (rotation {}, count {})",
        spaced(positions.iter().map(|position| format!("{:.4}", position.revolutions()))),
        spaced(positions.iter().map(|position| position.rotation())),
        spaced(positions.iter().map(|position| position.count())),
    )
}

/// A packet of this header and payload, as from a line.
fn packet<const N: usize>(header: u8, payload: &[u8]) -> [u8; N] {
    sealed(&[&[header, 3], payload].concat()).try_into().unwrap()
}

#[test]
fn one_motor_has_the_numbers_that_core_prints() {
    proptest!(|(payload: [u8; 4])| {
        let write = packet(0xBB, &payload);
        let write = WriteRequest::parse(&write)?;
        let (rps, at) = (format!("{:?} rps", write.as_velocity()), place(&[write.as_position()]));
        let contents = Request::Write(write).contents();
        prop_assert_eq!(contents.to_string(), format!("{rps} or {at}"));
        prop_assert_eq!(contents.in_mode(None).to_string(), format!("{rps} or {at}"));
        prop_assert_eq!(contents.in_mode(Mode::Velocity).to_string(), rps.clone());
        prop_assert_eq!(contents.in_mode(Some(Mode::Position)).to_string(), at.clone());

        let velocity = packet(0x55, &payload);
        let velocity = Response::Velocity(VelocityResponse::parse(&velocity)?);
        prop_assert_eq!(velocity.contents().to_string(), rps.clone());
        // The header of a response tells its mode, whatever the caller believes.
        prop_assert_eq!(velocity.contents().in_mode(Mode::Position).to_string(), rps);
        let position = packet(0x56, &payload);
        let position = Response::Position(PositionResponse::parse(&position)?);
        prop_assert_eq!(position.contents().to_string(), at);
    });
}

#[test]
fn three_motors_have_the_numbers_that_core_prints() {
    proptest!(|(payload: [u8; 12])| {
        let write = packet(0xBB, &payload);
        let write = three::WriteRequest::parse(&write)?;
        let speeds = spaced(write.as_velocity().map(|rps| format!("{rps:?}")));
        let (rps, at) = (format!("{speeds} rps"), place(&write.as_position()));
        let contents = three::Packet::Request(three::Request::Write(write)).contents();
        prop_assert_eq!(contents.to_string(), format!("{rps} or {at}"));
        prop_assert_eq!(contents.in_mode(Mode::Velocity).to_string(), rps.clone());
        prop_assert_eq!(contents.in_mode(Mode::Position).to_string(), at.clone());
        let velocity = packet(0x55, &payload);
        let velocity = three::Response::Velocity(three::VelocityResponse::parse(&velocity)?);
        prop_assert_eq!(velocity.to_string(), format!("velocity_response, node 3: {rps}"));
        let position = packet(0x56, &payload);
        let position = three::Response::Position(three::PositionResponse::parse(&position)?);
        prop_assert_eq!(position.to_string(), format!("position_response, node 3: {at}"));
    });
}

#[test]
fn turns_are_rounded_as_core_does_for_every_count_of_a_revolution() {
    for rotation in [i16::MIN, -2, -1, 0, 1, i16::MAX] {
        for count in i16::MIN..=i16::MAX {
            let position = Position::new(count, rotation);
            let response = PositionResponse::new(NodeId::N1, position);
            assert_eq!(Response::Position(&response).contents().to_string(), place(&[position]));
        }
    }
}

#[test]
fn each_packet_has_its_name_its_node_and_its_bytes() {
    let (rps, position) = (Rps::new(1.5).unwrap(), Position::new(4096, 1));
    let (read, write) = (ReadRequest::new(NodeId::N2), WriteRequest::velocity(NodeId::N8, rps));
    let velocity = VelocityResponse::new(NodeId::N1, rps);
    let at = PositionResponse::new(NodeId::N4, position);
    let position_text = "1.5000 turns (rotation 1, count 4096)";
    let write_text = "1.5 rps or 16320.0000 turns (rotation 16320, count 0)";
    let rows: [(Packet<'_>, &str, NodeId, &[u8], &str); 4] = [
        (Packet::Request(Request::Read(&read)), "read_request", NodeId::N2, read.as_bytes(), ""),
        (
            Packet::Request(Request::Write(&write)),
            "write",
            NodeId::N8,
            write.as_bytes(),
            write_text,
        ),
        (
            Packet::Response(Response::Velocity(&velocity)),
            "velocity_response",
            NodeId::N1,
            velocity.as_bytes(),
            "1.5 rps",
        ),
        (
            Packet::Response(Response::Position(&at)),
            "position_response",
            NodeId::N4,
            at.as_bytes(),
            position_text,
        ),
    ];
    for (packet, name, node, bytes, contents) in rows {
        assert_eq!((packet.name(), packet.id(), packet.as_bytes()), (name, node, bytes));
        assert_eq!(packet.contents().to_string(), contents);
        let colon = if contents.is_empty() { "" } else { ": " };
        assert_eq!(packet.to_string(), format!("{name}, node {node}{colon}{contents}"));
        let inner = match packet {
            Packet::Request(request) => request.to_string(),
            Packet::Response(response) => response.to_string(),
        };
        assert_eq!(inner, packet.to_string());
    }
    let three = three::Packet::Request(three::Request::Read(&read));
    assert_eq!((three.name(), three.id(), three.as_bytes().len()), ("read_request", NodeId::N2, 4));
    assert_eq!(three.to_string(), "read_request, node 2");
}
