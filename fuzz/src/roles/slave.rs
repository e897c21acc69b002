//! A slave under any calls, bytes and times: at most one answer to a request, in its mode.

use arbitrary::{Result, Unstructured};
use axlewire::{
    endpoint::{Endpoint, Unsent},
    ikeya::{
        Mode, NodeId, ReadRequest, Rps, Slave, Target, WriteRequest,
        board::{Board, OneMotor, ThreeMotors},
        slave::SlaveConfig,
        three,
    },
    time::{Duration, Instant},
};

use super::{Clock, raw, serve};

/// A slave of a motor bus, with either kind of board.
pub fn ikeya_slave(data: &[u8]) {
    let mut u = Unstructured::new(data);
    let _ = match u.arbitrary() {
        Ok(true) => slave::<ThreeMotors>(&mut u, |id, target| match target {
            None => ReadRequest::new(id).as_bytes().to_vec(),
            Some(rps) => three::WriteRequest::velocity(id, [rps; 3]).as_bytes().to_vec(),
        }),
        _ => slave::<OneMotor>(&mut u, |id, target| match target {
            None => ReadRequest::new(id).as_bytes().to_vec(),
            Some(rps) => WriteRequest::velocity(id, rps).as_bytes().to_vec(),
        }),
    };
}

fn slave<B: Board>(
    u: &mut Unstructured<'_>,
    request: fn(NodeId, Option<Rps>) -> Vec<u8>,
) -> Result<()> {
    let mut config = SlaveConfig::direct();
    config.watchdog = u.arbitrary::<bool>()?.then_some(Duration::from_millis(20));
    config.turnaround_gap = Duration::from_micros(*u.choose(&[0, 30])?);
    config.two_wire = u.arbitrary()?;
    let mode = if u.arbitrary()? { Mode::Velocity } else { Mode::Position };
    let mut clock = Clock::new(u)?;
    let id = *u.choose(&NodeId::ALL)?;
    let mut slave = Slave::<B>::new(id, mode, config, Instant::from_micros(0));
    while !u.is_empty() {
        let now = clock.pass(u)?;
        match u.int_in_range(0..=6)? {
            0 => slave.handle_input(raw(u)?, now),
            1 => slave.handle_input(&request(id, None), now),
            2 => slave.handle_input(&request(*u.choose(&NodeId::ALL)?, u.arbitrary().ok()), now),
            3 => slave.set_velocity(B::ZERO),
            4 => slave.handle_unsent(*u.choose(&[Unsent::Untouched, Unsent::CutOff])?, now),
            5 => {
                // The start of the next packet is enough.
                slave.handle_input(&request(id, None), now);
                slave.handle_input(&[0xAA], now);
                assert_eq!(slave.poll_transmit(now + config.turnaround_gap), None);
            }
            _ => slave.set_mode(if u.arbitrary()? { Mode::Velocity } else { Mode::Position }),
        }
        let sent = serve(&mut slave, now, |_| {});
        assert!(sent.len() <= 1, "one answer to one request");
        for packet in sent {
            assert_eq!(packet[1], id.get());
            assert!(packet[0] == 0x55 || packet[0] == 0x56);
            let expected = if slave.mode() == Mode::Velocity { 0x55 } else { 0x56 };
            assert_eq!(packet[0], expected);
        }
        let counts = slave.statistics();
        let asked = counts.reads + if B::ANSWERS_WRITE { counts.writes } else { 0 };
        assert!(counts.replies + counts.overtaken <= asked, "{counts:?}");
        match slave.command(now) {
            None => {}
            Some(Target::Velocity(_)) => assert_eq!(slave.mode(), Mode::Velocity),
            Some(Target::Position(_)) => assert_eq!(slave.mode(), Mode::Position),
        }
    }
    Ok(())
}
