//! A master under any calls, bytes and times: it writes only the latest orders and the stops that
//! it owes, and forgets no stop.

use arbitrary::{Result, Unstructured};
use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        Master, Mode, NodeId, Position, PositionResponse, ReadRequest, Rps, Status, Target,
        VelocityResponse,
        board::{OneMotor, ThreeMotors},
        master::{Health, MasterConfig, MasterEvent, NodeSet, Polling, StopProgress},
        three,
    },
    time::{Duration, Instant},
};

use super::{Clock, Tally, raw, serve, unsent};
use crate::kit::BoardPackets;

/// The master of a motor bus, with either kind of board.
pub(crate) fn ikeya_master(data: &[u8], tally: &mut Tally) {
    let mut u = Unstructured::new(data);
    let turn = Rps::new(1.0).expect("finite");
    let place = Position::new(1, -1);
    let _ = match u.arbitrary() {
        Ok(true) => {
            master::<ThreeMotors>(&mut u, tally, [turn; 3], [place; 3], |id, mode| match mode {
                Mode::Velocity => {
                    three::VelocityResponse::new(id, [Rps::ZERO; 3]).as_bytes().to_vec()
                }
                Mode::Position => {
                    three::PositionResponse::new(id, [Position::default(); 3]).as_bytes().to_vec()
                }
            })
        }
        _ => master::<OneMotor>(&mut u, tally, turn, place, |id, mode| match mode {
            Mode::Velocity => VelocityResponse::new(id, Rps::ZERO).as_bytes().to_vec(),
            Mode::Position => PositionResponse::new(id, Position::default()).as_bytes().to_vec(),
        }),
    };
}

/// Commands of the application for each node.
struct Wishes<B: BoardPackets> {
    /// The latest order, unless it is a stop or was withdrawn.
    orders: [Option<Target<B>>; 8],
    /// Nodes whose stop was owed at the last check.
    owed: NodeSet,
}

impl<B: BoardPackets> Wishes<B> {
    fn order(&mut self, id: NodeId) -> &mut Option<Target<B>> {
        &mut self.orders[usize::from(id.get() - 1)]
    }

    /// Checks and adopts the master's own decisions: it never owes less than before unless a stop
    /// is paid, and a node that is owed a stop gets nothing else.
    fn follow(&mut self, master: &mut Master<B>, turn: B::Velocity, now: Instant) {
        let owed = master.stops_owed();
        for id in NodeId::ALL {
            let set_point = master.set_point(id);
            if owed.contains(id) {
                *self.order(id) = None;
                assert_eq!(set_point, None, "a set-point despite an owed stop");
                assert_eq!(master.stop_progress(id), StopProgress::Owed);
                assert!(
                    master.set_velocity(id, turn, now).is_err(),
                    "accepted despite an owed stop"
                );
            } else if self.owed.contains(id) && self.order(id).is_none() {
                let progress = master.stop_progress(id);
                assert_ne!(progress, StopProgress::NotAsked, "a forgotten stop");
            }
            let is_online = matches!(master.health(id), Some(Health::Online | Health::Suspect(_)));
            assert!(is_online || set_point.is_none(), "a set-point for an offline node");
            if set_point.is_none() {
                *self.order(id) = None;
            }
        }
        self.owed = owed;
    }

    /// A WRITE is the latest order, in the mode of the node, or a stop: the nodes are at rest at 0.
    fn check(&mut self, sent: &[u8], master: &Master<B>, stop: &Stops) {
        let id = NodeId::new(sent[1]).expect("an id on the wire");
        let is_stop = [&stop.velocity, &stop.position]
            .into_iter()
            .any(|stop| stop[2..] == sent[2..sent.len() - 2]);
        if is_stop {
            return;
        }
        let order = self.order(id).expect("a WRITE without an order");
        let expected = B::write(id, order);
        assert_eq!(sent, expected, "not the latest order");
        assert_eq!(master.mode(id), Some(order.mode()), "wrong mode");
        assert!(B::ANSWERS_WRITE || !master.is_mode_in_doubt(id), "mode in doubt");
    }
}

/// The stop command for a node at rest at 0, without the CRC.
struct Stops {
    velocity: Vec<u8>,
    position: Vec<u8>,
}

fn master<B: BoardPackets>(
    u: &mut Unstructured<'_>,
    tally: &mut Tally,
    turn: B::Velocity,
    place: B::Position,
    answer: fn(NodeId, Mode) -> Vec<u8>,
) -> Result<()> {
    let mut config =
        if u.arbitrary()? { MasterConfig::direct() } else { MasterConfig::usb_adapter() };
    config.attempts = u.int_in_range(0..=5)?;
    config.recovery_share_pct = u.arbitrary()?;
    config.turnaround_gap = Duration::from_micros(*u.choose(&[0, 0, 35])?);
    let polling = [Polling::Fastest, Polling::Every(Duration::from_millis(5)), Polling::Manual];
    config.polling = *u.choose(&polling)?;
    config.accepts_early = u.arbitrary()?;
    config.stops_abnormal = u.arbitrary()?;
    config.hold_age = Duration::from_millis(*u.choose(&[0, 0, 2])?);
    config.dead_man = u.arbitrary::<bool>()?.then_some(Duration::from_millis(50));
    if u.arbitrary()? {
        config.nodes = [NodeId::N1, NodeId::N5].into_iter().collect();
    }
    let mut clock = Clock::new(u)?;
    let mut master = Master::<B>::for_board(config, clock.0);
    let mut wishes = Wishes { orders: [None; 8], owed: NodeSet::NONE };
    // The node that was read and may answer.
    let mut asked = None;
    let mut given = 0;
    while !u.is_empty() {
        let id = *u.choose(&NodeId::ALL)?;
        let now = clock.pass(u)?;
        let mut statuses = 0;
        let action = u.int_in_range(0..=14_u8)?;
        let mut input = Vec::new();
        match action {
            0 => master.discover(now),
            1 => {
                if master.set_velocity(id, turn, now).is_ok() {
                    *wishes.order(id) = Some(Target::Velocity(turn));
                }
            }
            2 => {
                if master.set_position(id, place, now).is_ok() {
                    *wishes.order(id) = Some(Target::Position(place));
                }
            }
            3 => {
                master.stop(id, now);
                assert!(stopping(&master).contains(&id));
            }
            4 => {
                master.stop_all(now);
                let stopping = stopping(&master);
                assert!(config.nodes.iter().all(|id| stopping.contains(&id)));
            }
            5 => drop(master.confirm(id, now)),
            6 => {
                let owed = master.stops_owed();
                master.release(id);
                assert_eq!(master.stops_owed(), owed, "a release must not cancel a stop");
            }
            7 => drop(master.read(id, now)),
            8 => master.keep_alive(now),
            9 => master.handle_transmit(unsent(u)?, now),
            10 => input = raw(u)?.to_vec(),
            11 => {
                let mode = if u.arbitrary()? { Mode::Velocity } else { Mode::Position };
                input = answer(id, mode);
                // Only the node that was read can have answered.
                statuses = u32::from(asked == Some(id));
            }
            _ => {
                if let Some(id) = asked {
                    let mode = if u.ratio(1, 8)? { Mode::Position } else { Mode::Velocity };
                    input = answer(id, master.mode(id).unwrap_or(mode));
                    statuses = 1;
                }
            }
        }
        given += input.len() as u64;
        master.handle_input(&input, now);
        wishes.follow(&mut master, turn, now);
        let mut told = 0;
        let sent = serve(&mut master, now, |event| {
            told += u32::from(matches!(event, MasterEvent::Status { .. }));
        });
        wishes.follow(&mut master, turn, now);
        // Raw input can also contain a valid answer if it is long enough.
        assert!(told <= statuses.max(1), "{told} answers to one request");
        for sent in sent {
            let id = NodeId::new(sent[1]).expect("an id on the wire");
            if sent[0] == 0xAA || B::ANSWERS_WRITE {
                asked = Some(id);
            }
            if sent[0] == 0xBB {
                let stops = Stops {
                    velocity: without_crc(B::write(id, Target::Velocity(B::ZERO))),
                    position: without_crc(answer(id, Mode::Position)),
                };
                wishes.check(&sent, &master, &stops);
            } else {
                assert_eq!(sent, ReadRequest::new(id).as_bytes());
            }
        }
        check_counts(&master);
        let counters = master.counters();
        assert_eq!(counters.received, given);
        let booked = counters.framed + counters.skipped();
        let longest = if B::ANSWERS_WRITE { 16 } else { 8 };
        assert!((booked..booked + longest).contains(&counters.received), "{counters:?}");
        tally.did(action);
    }
    Ok(())
}

/// Nodes that are not seen to be still after their stop yet.
fn stopping<B: BoardPackets>(master: &Master<B>) -> Vec<NodeId> {
    master.stops_owed().iter().chain(master.coasting().iter()).collect()
}

fn without_crc(mut packet: Vec<u8>) -> Vec<u8> {
    packet.truncate(packet.len() - 2);
    packet
}

fn check_counts<B: BoardPackets>(master: &Master<B>) {
    for id in NodeId::ALL {
        let node = master.node_statistics(id);
        let closed = u64::from(node.replies) + u64::from(node.timeouts);
        let requests = u64::from(node.requests);
        assert!(closed <= requests, "an answer without a request: {node:?}");
        // An answer that puts the mode in doubt also closes its window.
        let open = requests - closed;
        let doubtful = u64::from(node.other_mode);
        assert!(open <= doubtful + 1, "an unfinished request: {node:?}");
        let mode = master.status(id).map(|(status, _): (Status<B>, _)| status.mode());
        assert_eq!(mode, master.mode(id));
    }
}
