//! The master of three-motor boards: no board waits forever.

use axlewire::{
    endpoint::Endpoint,
    ikeya::{Master, NodeId, Rps, board::ThreeMotors, master::MasterConfig, three},
    time::{Duration, Instant},
};

// The calls under test.

fn set_velocity(master: &mut Master<ThreeMotors>, node: NodeId, now: Instant) {
    master.set_velocity(node, [Rps::new(1.0).unwrap(); 3], now).unwrap();
}

const WRITE: u8 = 0xBB;

/// Three-motor boards 1 and 8, of which 1 gets a new set-point before each packet: the headers of
/// the packets to board 8 after `begin`.
fn sent_beside_a_control_loop(begin: impl FnOnce(&mut Master<ThreeMotors>, Instant)) -> Vec<u8> {
    let mut now = Instant::from_millis(1000);
    let mut master: Master<ThreeMotors> = Master::new(MasterConfig::direct(), now);
    master.discover(now);
    let (mut begin, mut sent) = (Some(begin), vec![]);
    for _ in 0..2000 {
        while master.poll_event().is_some() {}
        if !master.is_discovering() {
            set_velocity(&mut master, NodeId::N1, now);
            if let Some(begin) = begin.take() {
                begin(&mut master, now);
            }
        }
        let packet = master.poll_transmit(now).map(|packet| (packet[0], packet[1]));
        if let (Some((header, 8)), None) = (packet, &begin) {
            sent.push(header);
        }
        if let Some((_, id @ (1 | 8))) = packet {
            let answer = three::VelocityResponse::new(NodeId::new(id).unwrap(), [Rps::ZERO; 3]);
            now += Duration::from_micros(700);
            master.handle_input(answer.as_bytes(), now);
        } else {
            now = master.poll_timeout().unwrap();
            master.handle_timeout(now);
        }
    }
    sent
}

#[test]
fn a_control_loop_on_one_three_motor_board_does_not_hold_up_the_stop_of_another() {
    let sent = sent_beside_a_control_loop(|master, now| master.stop(NodeId::N8, now));
    assert!(sent.contains(&WRITE), "the stop of node 8 waits forever");
}

#[test]
fn a_control_loop_on_one_three_motor_board_does_not_keep_the_others_from_being_read() {
    let sent = sent_beside_a_control_loop(|_, _| ());
    assert!(sent.len() >= 100, "node 8 is hardly ever read");
}
