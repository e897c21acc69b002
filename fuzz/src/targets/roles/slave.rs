//! A slave under any calls, bytes and times: at most one answer to a request, in its mode, with
//! what it was told to measure; and no command that it has not heard within its watchdog.

use arbitrary::{Result, Unstructured};
use axlewire::{
    endpoint::{Arrival, Endpoint},
    ikeya::{
        Mode, NodeId, Position, ReadRequest, Rps, Slave, Target,
        board::{OneMotor, ThreeMotors},
        slave::{SlaveConfig, SlaveEvent},
    },
    time::{Duration, Instant},
};

use super::{Clock, Tally, check_account, oracle, raw, serve, unsent};
use crate::kit::Kit;

/// A slave of a motor bus, with either kind of board.
pub(crate) fn ikeya_slave(data: &[u8], tally: &mut Tally) {
    let mut u = Unstructured::new(data);
    let _ = match u.arbitrary() {
        Ok(true) => slave::<ThreeMotors>(&mut u, tally),
        _ => slave::<OneMotor>(&mut u, tally),
    };
}

fn slave<B: Kit>(u: &mut Unstructured<'_>, tally: &mut Tally) -> Result<()> {
    let mut config =
        if u.arbitrary()? { SlaveConfig::direct() } else { SlaveConfig::usb_adapter() };
    config.watchdog = u.arbitrary::<bool>()?.then_some(Duration::from_millis(20));
    config.turnaround_gap = Duration::from_micros(*u.choose(&[0, 30])?);
    config.two_wire = u.arbitrary()?;
    let mode = if u.arbitrary()? { Mode::Velocity } else { Mode::Position };
    let mut clock = Clock::new(u)?;
    let id = *u.choose(&NodeId::ALL)?;
    let mut slave = Slave::<B>::for_board(id, mode, config, clock.0);
    let long = if B::ANSWERS_WRITE { 16 } else { 8 };
    let mut heard = Heard { id, long, tail: Vec::new(), writes: Vec::new() };
    let (mut speed, mut place, mut given) = (B::speed(0.0), None, 0);
    while !u.is_empty() {
        let now = clock.pass(u)?;
        let mut input = Vec::new();
        let action = u.int_in_range(0..=9_u8)?;
        match action {
            0 => input = raw(u)?.to_vec(),
            1 => input = ReadRequest::new(id).as_bytes().to_vec(),
            2 => input = B::write(*u.choose(&NodeId::ALL)?, Target::Velocity(any_speed::<B>(u)?)),
            3 => {
                speed = any_speed::<B>(u)?;
                slave.set_velocity(speed);
            }
            4 => slave.handle_transmit(unsent(u)?, now),
            5 => {
                // The start of the next packet is enough.
                let read = ReadRequest::new(id);
                input = [read.as_bytes(), &[0xAA][..]].concat();
            }
            6 => {
                let mode = if u.arbitrary()? { Mode::Velocity } else { Mode::Position };
                // What it has measured in the other mode is old.
                place = place.filter(|_| mode == slave.mode());
                slave.set_mode(mode);
            }
            7 => {
                place = Some(B::place(u.arbitrary()?));
                slave.set_position(B::place(position(u)?));
                slave.set_position(place.expect("just set"));
            }
            8 => {
                input = B::write(
                    *u.choose(&[id, NodeId::N8])?,
                    Target::Position(B::place(position(u)?)),
                )
            }
            _ => {
                // Bytes that have waited: their commands are as old as they may be.
                let since = clock.0;
                let now = clock.pass(u)?;
                let write = B::write(id, Target::Velocity(any_speed::<B>(u)?));
                given += write.len() as u64;
                heard.take(&write, since);
                slave.handle_input(&write, Arrival::Between { since, now });
            }
        }
        let now = clock.0.max(now);
        given += input.len() as u64;
        heard.take(&input, now);
        slave.handle_input(&input, now);
        let sent = serve(&mut slave, now, |event| heard.check_event::<B>(&event));
        assert!(sent.len() <= 1, "one answer to one request");
        assert!(action != 5 || sent.is_empty(), "an answer into the next packet");
        for packet in sent {
            let measured = match (slave.mode(), place) {
                (Mode::Velocity, _) => Target::Velocity(speed),
                (Mode::Position, Some(place)) => Target::Position(place),
                (Mode::Position, None) => panic!("a position that was never measured"),
            };
            assert_eq!(packet, B::answer(id, measured));
        }
        let counts = slave.statistics();
        let asked = counts.reads + if B::ANSWERS_WRITE { counts.writes } else { 0 };
        assert!(counts.replies + counts.overtaken + counts.expired <= asked, "{counts:?}");
        check_account(slave.counters(), given, heard.long as u64);
        if let Some(target) = slave.command(now) {
            assert_eq!(target.mode(), slave.mode());
            heard.check_command::<B>(target, config, now);
        }
        tally.did(action);
    }
    Ok(())
}

fn any_speed<B: Kit>(u: &mut Unstructured<'_>) -> Result<B::Velocity> {
    let rps: Rps = u.arbitrary()?;
    Ok(B::speed(rps.get()))
}

fn position(u: &mut Unstructured<'_>) -> Result<Position> {
    u.arbitrary()
}

/// The WRITEs for this slave that its input may contain: at any offset, by the oracle's checksum.
struct Heard {
    id: NodeId,
    long: usize,
    /// The last bytes of the input.
    tail: Vec<u8>,
    /// When each WRITE was complete, and its bytes.
    writes: Vec<(Instant, Vec<u8>)>,
}

impl Heard {
    fn take(&mut self, input: &[u8], at: Instant) {
        for &byte in input {
            self.tail.push(byte);
            let start = self.tail.len().saturating_sub(self.long);
            self.tail.drain(..start);
            let (body, crc) = self.tail.split_at(self.tail.len().saturating_sub(2));
            let is_write = body.first() == Some(&0xBB) && body.get(1) == Some(&self.id.get());
            if is_write && self.tail.len() == self.long && oracle::crc(body).to_le_bytes() == crc {
                self.writes.push((at, self.tail.clone()));
            }
        }
    }

    fn check_event<B: Kit>(&self, event: &SlaveEvent<B>) {
        if let SlaveEvent::Command(target) = *event {
            let written = B::write(self.id, target);
            assert!(self.writes.iter().any(|(_, write)| *write == written), "{target:?} unheard");
        }
    }

    /// A command in force was written, and no longer ago than the watchdog allows. A false header
    /// may hold it back for as many pauses as a packet has bytes.
    fn check_command<B: Kit>(&self, target: Target<B>, config: SlaveConfig, now: Instant) {
        let limit = config.watchdog.map_or(Duration::from_micros(u32::MAX), |watchdog| {
            watchdog + config.idle.saturating_mul(self.long as u32)
        });
        let written = B::write(self.id, target);
        let is_recent = |(at, write): &&(Instant, Vec<u8>)| now - *at <= limit && *write == written;
        assert!(self.writes.iter().rev().any(|it| is_recent(&it)), "{target:?} at {now:?}");
    }
}
