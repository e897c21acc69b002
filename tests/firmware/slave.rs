//! The firmware slave against a master on this machine.

use axlewire::{ikeya, stream::Event};

use crate::{driver_enable_pin, names::*};

pub(crate) type Bus = Driver<Master, Wire, WireClock>;

pub(crate) const NODE: NodeId = NodeId::N1;

pub(crate) fn rps(value: f32) -> Rps {
    Rps::new(value).unwrap()
}

/// A master on a wire.
pub(crate) fn master_on(wire: Wire, mut config: MasterConfig) -> Bus {
    // A socket is faster than any line.
    config.accepts_early = true;
    let clock = wire.clock();
    Driver::master(config, wire, clock)
}

/// A board, and a master that has found it.
fn discovered() -> Option<(Board, Bus)> {
    discovered_with(MasterConfig::direct().coast)
}

/// The same, with this time for a motor to become still.
fn discovered_with(coast: Duration) -> Option<(Board, Bus)> {
    let mut board = Board::start(Program::Slave)?;
    let mut config = MasterConfig::direct();
    // QEMU answers when this machine gets to it.
    (config.reply_timeout, config.attempts) = (Duration::from_millis(150), 2);
    config.polling = Polling::Every(Duration::from_millis(10));
    (config.nodes, config.coast) = (NODE.into(), coast);
    let mut bus = master_on(Wire::new(board.bus()), config);
    assert_eq!(bus.discover().unwrap(), [(NODE, Mode::Velocity)]);
    Some((board, bus))
}

/// Runs the master until an event matches.
fn event_when(bus: &mut Bus, what: &str, done: impl Fn(&MasterEvent) -> bool) {
    let end = bus.now() + Duration::from_millis(PATIENCE.as_millis() as u32);
    while let Some(event) = bus.next_event(end - bus.now()).unwrap() {
        if done(&event) {
            return;
        }
    }
    panic!("timed out waiting for: {what}");
}

pub(crate) fn is_turning_at(event: &MasterEvent, wanted: f32) -> bool {
    let MasterEvent::Status { node: NODE, status: ikeya::Status::Velocity(rps) } = *event else {
        return false;
    };
    (rps - wanted).abs() < 0.01
}

#[test]
fn discovery_finds_the_board_and_its_motor_turns_and_stops_as_commanded() {
    let Some((mut board, mut bus)) = discovered() else { return };
    for speed in [2.0, -1.5] {
        bus.set_velocity(NODE, rps(speed)).unwrap();
        event_when(&mut bus, "at speed", |event| is_turning_at(event, speed));
    }
    bus.stop_all().unwrap();
    event_when(&mut bus, "at rest", |event| is_turning_at(event, 0.0));
    let told = board.report_when("stopped", |report| report.at("mrps").abs() <= 10);
    assert!(told.at("counts") != 0 && told.at("writes") >= 3, "{told:?}");
    told.assert_nothing_lost();
}

#[test]
fn a_paid_stop_is_two_commands_each_followed_by_an_answer_and_the_motor_is_at_rest() {
    let Some((mut board, mut bus)) = discovered() else { return };
    bus.set_velocity(NODE, rps(3.0)).unwrap();
    event_when(&mut bus, "at speed", |event| is_turning_at(event, 3.0));

    let before = board.report_when("turning", |report| report.at("mrps") > 2900);
    let answers = bus.role().node_statistics(NODE).replies;
    bus.stop(NODE).unwrap();
    let told = board.report_when("told 0", |report| report.get("target_mrps") == Some(0));
    assert!(told.at("writes") >= before.at("writes") + 2, "{before:?} {told:?}");
    assert!(bus.role().node_statistics(NODE).replies >= answers + 2);
    assert!(told.at("replies") >= before.at("replies") + 2, "{before:?} {told:?}");
    // A stop command, not the board's own watchdog.
    assert_eq!(told.at("stops"), 0, "{told:?}");

    let here = board.report_when("at rest", |report| report.at("mrps") == 0);
    bus.run_for(Duration::from_millis(300), |_, _, _| {}).unwrap();
    let there = board.report_when("read again", |report| report.at("reads") > here.at("reads"));
    let way = there.at("counts") - here.at("counts");
    assert!(way.abs() <= 8, "{here:?} {there:?}");
    assert_eq!(there.get("target_mrps"), Some(0), "{there:?}");
    there.assert_nothing_lost();
}

#[test]
fn a_stop_is_ok_once_a_write_behind_the_damaged_ones_was_taken_and_not_because_reads_are_answered()
{
    // Shorter than the board's own watchdog where no WRITE arrives.
    for (damaged, coast_ms) in [(2, 2000), (u32::MAX, 100)] {
        let coast = Duration::from_millis(coast_ms);
        let Some((mut board, mut bus)) = discovered_with(coast) else { return };
        bus.set_velocity(NODE, rps(3.0)).unwrap();
        event_when(&mut bus, "at speed", |event| is_turning_at(event, 3.0));
        let before = board.report_when("turning", |report| report.at("mrps") > 2900);
        bus.port_mut().damaged = (packet(&WriteRequest::velocity(NODE, rps(0.0))), damaged);
        let stopped = bus.stop(NODE);
        // Nothing is sent behind the call.
        let told = board.report_when("told", |_| true);
        assert!(told.at("replies") >= before.at("replies") + 2, "{before:?} {told:?}");
        assert!(told.at("skipped") >= before.at("skipped") + 2 * 8, "{before:?} {told:?}");
        if damaged == 2 {
            stopped.unwrap();
            assert_eq!(bus.port().damaged.1, 0);
            // A stop command, not the board's own watchdog.
            assert_eq!((told.get("target_mrps"), told.at("stops")), (Some(0), 0), "{told:?}");
            assert!(told.at("mrps").abs() < 50, "{told:?}");
        } else {
            let is_moving =
                matches!(stopped, Err(DriveError::StillMoving(it)) if it == NODE.into());
            assert!(is_moving, "{stopped:?}");
        }
    }
}

#[test]
fn a_motor_that_is_read_but_no_longer_commanded_stops() {
    let Some((mut board, mut bus)) = discovered() else { return };
    bus.set_velocity(NODE, rps(3.0)).unwrap();
    event_when(&mut bus, "at speed", |event| is_turning_at(event, 3.0));
    bus.role_mut().release(NODE);
    event_when(&mut bus, "at rest", |event| is_turning_at(event, 0.0));
    let told = board.report_when("stopped", |report| report.at("mrps").abs() <= 10);
    assert_eq!((told.at("stops"), told.get("target_mrps")), (1, None));
}

#[test]
fn an_unplugged_board_is_abnormal_stops_and_does_not_move_when_it_comes_back() {
    let Some((mut board, mut bus)) = discovered() else { return };
    bus.set_velocity(NODE, rps(2.0)).unwrap();
    event_when(&mut bus, "at speed", |event| is_turning_at(event, 2.0));

    bus.port_mut().unplug();
    let abnormal = MasterEvent::Health { node: NODE, health: Health::Abnormal };
    event_when(&mut bus, "abnormal", |event| *event == abnormal);
    assert!(bus.set_velocity(NODE, rps(2.0)).is_err());
    let told = board.report_when("stopped", |report| report.at("mrps").abs() <= 10);
    assert_eq!((told.at("stops"), told.get("target_mrps")), (1, None));

    let stream = board.bus();
    bus.port_mut().plug(stream);
    let online = MasterEvent::Health { node: NODE, health: Health::Online };
    event_when(&mut bus, "online again", |event| *event == online);
    // It was lost under a set-point, so it is stopped before it accepts commands again.
    event_when(&mut bus, "stopped", |event| *event == MasterEvent::Stopped { node: NODE });
    // After twenty readings it is still at rest.
    for _ in 0..20 {
        event_when(&mut bus, "read", |event| matches!(event, MasterEvent::Status { .. }));
    }
    let still = board.report_when("read again", |report| report.at("reads") > told.at("reads"));
    assert!(still.at("writes") >= told.at("writes") + 2, "{still:?}");
    assert_eq!((still.get("target_mrps"), still.at("mrps")), (Some(0), 0), "{still:?}");

    bus.set_velocity(NODE, rps(1.0)).unwrap();
    event_when(&mut bus, "at speed again", |event| is_turning_at(event, 1.0));
}

/// A bare packet sender: it sends on request and waits as long as necessary.
struct Bare {
    board: Board,
    wire: Wire,
    decoder: ikeya::Decoder<ToMaster>,
}

impl Bare {
    fn new(mut board: Board) -> Self {
        let wire = Wire::new(board.bus());
        Self { board, wire, decoder: ikeya::Decoder::new() }
    }

    fn write(&mut self, speed: f32) {
        self.wire.send(&packet(&WriteRequest::velocity(NODE, rps(speed))));
    }

    /// The board's report after this many answers.
    fn told(&mut self, replies: i64) -> Report {
        self.board.report_when("answered", |report| report.at("replies") >= replies)
    }

    /// Bytes that the board sends until it has been silent for 200 ms.
    fn heard_in_silence(&mut self) -> i64 {
        let mut heard = 0;
        while self.wire.receive(std::time::Duration::from_millis(200)).is_some() {
            heard += 1;
        }
        heard
    }

    /// Requests and returns the speed. Bytes that are not an answer fail the test.
    fn read(&mut self) -> f32 {
        self.wire.send(&packet(&ReadRequest::new(NODE)));
        loop {
            let Some(byte) = self.wire.receive(PATIENCE) else {
                panic!("no answer: {:?}", self.board.report_when("told", |_| true));
            };
            if let Some(event) = self.decoder.decode(&mut [byte].as_slice()) {
                match event {
                    Event::Frame(Response::Velocity(now)) if now.id() == NODE => return now.rps(),
                    other => panic!("no answer: {other:?}"),
                }
            }
        }
    }
}

pub(crate) fn packet(packet: &impl Encode) -> Vec<u8> {
    let mut buffer = [0; 16];
    packet.encode(&mut buffer).unwrap().to_vec()
}

#[test]
fn a_motor_speeds_up_in_steps_that_are_short_compared_with_its_time_constant() {
    let Some(board) = Board::start(Program::Slave) else { return };
    let mut master = Bare::new(board);
    let seen = master.board.reports().len();
    master.write(3.0);
    // One report for each step, until the watchdog stops the motor.
    master.board.ask_for_a_while(80, std::time::Duration::from_millis(3));
    master.board.report_when("at speed", |told| told.at("mrps") > 2900);
    let reports = master.board.reports();
    let mut speeds: Vec<_> = reports[seen..].iter().map(|told| told.at("mrps")).collect();
    speeds.dedup();
    let on_the_way = speeds.iter().take_while(|speed| **speed <= 2900).filter(|it| **it > 0);
    // 36 steps of 5 ms, at a time constant of 50 ms; steps of 50 ms would be 5.
    assert!(on_the_way.count() >= 12, "{speeds:?}");
}

#[test]
fn ten_thousand_exchanges_lose_no_byte_at_either_end() {
    const EXCHANGES: u32 = 10_000;
    let Some(mut board) = Board::start(Program::Slave) else { return };
    let mut config = MasterConfig::direct();
    // Longer than this machine ever keeps QEMU waiting, and no retry that would hide a loss.
    (config.reply_timeout, config.attempts) = (Duration::from_millis(400), 1);
    config.polling = Polling::Manual;
    let mut bus = master_on(Wire::new(board.bus()), config);
    assert_eq!(bus.discover().unwrap(), [(NODE, Mode::Velocity)]);
    for turn in 0..EXCHANGES {
        // A WRITE, followed by a READ.
        let now = bus.now();
        bus.role_mut().set_velocity(NODE, rps((turn % 7) as f32), now).unwrap();
        match bus.read(NODE).unwrap() {
            ikeya::Status::Velocity(speed) if (0.0..=6.0).contains(&speed) => {}
            other => panic!("{other:?} was never commanded"),
        }
    }
    let (node, line) = (bus.role().node_statistics(NODE), bus.role().statistics());
    // One more is the discovery; it asked seven absent nodes.
    assert_eq!((node.requests, node.replies), (EXCHANGES + 1, EXCHANGES + 1));
    assert_eq!((node.timeouts, node.late, line.stale_bytes), (0, 0, 0));
    assert_eq!((line.reads, line.writes), (EXCHANGES + 8, EXCHANGES));
    let told = board.report_when("told", |_| true);
    let counts = ["reads", "replies", "writes", "foreign"].map(|name| told.at(name));
    let exchanges = i64::from(EXCHANGES);
    assert_eq!(counts, [exchanges + 1, exchanges + 1, exchanges, 7], "{told:?}");
    let nothing = ["overtaken", "refused", "skipped"].map(|name| told.at(name));
    assert_eq!(nothing, [0; 3], "{told:?}");
    told.assert_nothing_lost();
}

#[test]
fn noise_costs_no_intact_packet_and_commands_nothing() {
    const ROUNDS: i64 = 120;
    let Some(board) = Board::start(Program::Slave) else { return };
    let mut master = Bare::new(board);
    let mut rng = Rng::new(7);
    for _ in 0..ROUNDS {
        // Stray bytes, often false headers; then a command with one bit flipped.
        let strays = (0..rng.below(6)).map(|_| match rng.below(4) {
            0 => 0xAA,
            1 => 0xBB,
            2 => 0x01,
            _ => rng.below(256) as u8,
        });
        let strays: Vec<u8> = strays.collect();
        master.wire.send(&strays);
        let mut damaged = packet(&WriteRequest::velocity(NODE, rps(90.0)));
        let bit = rng.below(64) as usize;
        damaged[bit / 8] ^= 1 << (bit % 8);
        master.wire.send(&damaged);
        // Then the intended command.
        master.write(1.0);
        master.wire.send(&strays);
        let speed = master.read();
        assert!((0.0..=1.01).contains(&speed), "a damaged command was obeyed: {speed} rps");
    }
    assert_eq!(master.decoder.counters().frames, ROUNDS as u64);
    let told = master.told(ROUNDS);
    let counts = ["reads", "writes", "replies"].map(|name| told.at(name));
    assert_eq!(counts, [ROUNDS; 3], "{told:?}");
    assert!(told.at("skipped") >= 8 * ROUNDS, "{told:?}");
    told.assert_nothing_lost();
}

#[test]
fn answers_that_are_overtaken_or_late_are_dropped_and_counted() {
    let Some(board) = Board::start(Program::Slave) else { return };
    let mut master = Bare::new(board);
    let read = packet(&ReadRequest::new(NODE));
    let end = std::time::Instant::now() + PATIENCE;
    let (mut asked, mut answered) = (0, 0);
    let told = loop {
        // Overtaken: the next request arrives before the board has answered.
        master.wire.send(&read.repeat(20));
        // Late: after a false header the request is found after 100 ms. The board halts
        // meanwhile.
        answered += master.heard_in_silence();
        master.wire.send(&[&[0xBB], &read[..]].concat());
        std::thread::sleep(std::time::Duration::from_millis(30));
        master.board.halt(std::time::Duration::from_millis(700));
        answered += master.heard_in_silence();
        asked += 21;
        let told = master.board.report_when("heard", |report| report.at("reads") == asked);
        let counted = told.at("replies") + told.at("overtaken") + told.at("expired");
        assert_eq!((counted, answered), (asked, 8 * told.at("replies")), "{told:?}");
        if told.at("overtaken") > 0 && told.at("expired") > 0 {
            break told;
        }
        assert!(std::time::Instant::now() < end, "{told:?}");
    };
    told.assert_nothing_lost();
}

#[test]
fn the_driver_enable_pin_is_on_while_an_answer_is_sent_and_off_otherwise() {
    let Some(board) = Board::start_logged(Program::Slave) else { return };
    let mut master = Bare::new(board);
    let mut rng = Rng::new(21);
    let mut answers = 0;
    for round in 0..60 {
        // A quiet line, a damaged one, and a master that talks over the answers.
        if round % 3 == 1 {
            let mut damaged = packet(&WriteRequest::velocity(NODE, rps(90.0)));
            damaged[rng.below(8) as usize] ^= 1 << rng.below(8);
            let strays: Vec<u8> = (0..rng.below(30)).map(|_| rng.byte()).collect();
            master.wire.send(&[strays, damaged].concat());
        } else if round % 3 == 2 {
            master.wire.send(&packet(&ReadRequest::new(NODE)).repeat(20));
            answers += master.heard_in_silence();
        }
        master.write(1.0);
        let _speed = master.read();
        answers += 8;
    }
    let told = master.board.report_when("told", |_| true);
    assert_eq!(8 * told.at("replies"), answers, "{told:?}");
    assert!(told.at("overtaken") > 0 && told.at("skipped") > 0, "{told:?}");

    // Usually one answer per burst; with waiting requests, the next answer follows directly.
    let mut sent = 0;
    for burst in driver_enable_pin::bursts(&master.board.accesses()) {
        let mut answers = Frames::<ToMaster>::new(&burst);
        sent += answers.by_ref().count();
        assert_eq!((answers.counters().skipped(), answers.rest().len()), (0, 0), "{burst:02X?}");
    }
    assert_eq!(sent as i64, told.at("replies"));
}
