//! The roles at both ends of a wire with noise in both directions: flipped bits, inserted bytes.

use std::{collections::HashSet, time::Instant};

use crate::{
    master::Nodes,
    names::*,
    robot::{board_shows, end_of, linked_by, patient, wheels_turn_at},
    slave::{Bus, is_turning_at, master_on},
    wire::Noise,
};

/// Commands a speed until this many consecutive readings show it, as an application does on a bad
/// line: when the master has dropped the command, it commands again.
fn keep(bus: &mut Bus, board: &mut Board, speed: f32, readings: u32) {
    let end = bus.now() + Duration::from_millis(PATIENCE.as_millis() as u32);
    let now = bus.now();
    let mut is_dropped = bus.role_mut().set_velocity(NODE, rps(speed), now).is_err();
    let mut in_a_row = 0;
    while in_a_row < readings {
        let event = bus.next_event(end - bus.now()).unwrap().expect("the speed within 30 s");
        let now = bus.now();
        match event {
            MasterEvent::Health { health: Health::Abnormal, .. } => is_dropped = true,
            // Commands are refused until the owed stop is paid.
            MasterEvent::Status { .. } if is_dropped => {
                is_dropped = bus.role_mut().set_velocity(NODE, rps(speed), now).is_err();
            }
            MasterEvent::Status { .. } => {
                in_a_row = if is_turning_at(&event, speed) { in_a_row + 1 } else { 0 };
                board.ask();
            }
            _ => {}
        }
    }
}

#[test]
fn a_motor_on_a_noisy_bus_keeps_each_speed_and_gets_no_spurious_command() {
    const SPEEDS: [f32; 3] = [2.0, -1.5, 3.25];
    let Some(mut board) = Board::start(Program::Slave) else { return };
    let mut config = MasterConfig::direct();
    // QEMU answers when this machine gets to it. Short enough that a lost answer costs little.
    config.reply_timeout = Duration::from_millis(30);
    config.polling = Polling::Every(Duration::from_millis(10));
    config.recovery_share_pct = 50;
    let mut bus = master_on(Wire::noisy(board.bus(), Noise::ikeya(11)), config);
    let end = Instant::now() + PATIENCE;
    while bus.discover().unwrap().is_empty() {
        assert!(Instant::now() < end, "not discovered in time");
    }
    for speed in SPEEDS {
        keep(&mut bus, &mut board, speed, 50);
    }

    // The noise has created no other node.
    let there: Vec<_> =
        NodeId::ALL.into_iter().filter(|&id| bus.role().mode(id).is_some()).collect();
    assert_eq!((there, bus.role().mode(NODE)), (vec![NODE], Some(Mode::Velocity)));
    let seen = *bus.role().node_statistics(NODE);
    assert!(seen.crc_errors > 0 && seen.timeouts > 0 && seen.retries > 0, "{seen:?}");
    assert!(bus.role().counters().skipped() > 0);
    let told = board.report_when("told", |_| true);
    assert!(told.at("skipped") > 0, "{told:?}");
    assert!(told.at("writes") < bus.role().statistics().writes.into(), "{told:?}");
    let mut targets: HashSet<_> =
        board.reports().iter().filter_map(|report| report.get("target_mrps")).collect();
    // A node that looked abnormal receives a stop.
    targets.remove(&0);
    assert_eq!(targets, SPEEDS.map(|speed| (speed * 1000.0) as i64).into());
    told.assert_nothing_lost();
}

#[test]
fn a_rover_on_a_noisy_link_reports_in_order_keeps_its_command_and_stops_when_the_host_goes_silent()
{
    const REPORTS: u32 = 100;
    let noisy = |stream| Wire::noisy(stream, Noise::ucp(12));
    let mut config = patient();
    // Five lost commands in a row happen occasionally, and after 500 ms the robot stops. Ten do
    // not.
    config.command_period = Duration::from_millis(40);
    let Some((mut board, mut rover)) = linked_by(noisy, config) else { return };
    // The loss count restarts whenever the robot requests its biases, which it does until it
    // has them.
    let (imu, mag) = (ImuBias::new([1, 2, 3], [4, 5, 6]), MagBias::new([7, 8, 9]));
    *rover.role_mut().store_mut() = MemoryStore { imu: Some(imu), mag: Some(mag) };
    let begun = board_shows(&mut board, &mut rover, |told| told.at("biases") >= 1);
    let first = *rover.role().statistics();

    let ahead = MotorControl::turn_right(50, 10).unwrap().with_front_led(true);
    let (end, mut before, mut at_speed) = (end_of(&mut rover), None, 0);
    // Reports arrive, and the wheels reach their speed and keep it.
    while rover.role().statistics().reports < first.reports + REPORTS || at_speed < 30 {
        let now = rover.now();
        assert!(now < end, "at speed {at_speed} times: {:?}", rover.role().statistics());
        rover.role_mut().drive(ahead, now).unwrap();
        let event = rover.next_event(Duration::from_millis(50)).unwrap();
        if let Some(event @ HostEvent::Report(report)) = event {
            if let Some(before) = before.replace(report.index) {
                assert_eq!(report.index, before.wrapping_add(1).wrapping_add(report.lost));
            }
            at_speed = if wheels_turn_at(&event, [64, 55]) { at_speed + 1 } else { 0 };
            board.ask();
        }
    }

    let (counts, seen) = (rover.role().counters(), *rover.role().statistics());
    assert!(counts.skipped() > 0 && seen.reports_lost > 0, "{counts:?} {seen:?}");
    assert_eq!((seen.reports_repeated, seen.unknown, seen.misdirected), (0, 0, 0), "{seen:?}");
    let told = board.report_when("told", |_| true);
    // Each was received or counted as lost, except for some in flight.
    let counted = seen.reports + seen.reports_lost - first.reports - first.reports_lost;
    let missing = told.at("reports") - begun.at("reports") - i64::from(counted);
    assert!(missing.abs() <= 50, "{missing} of {told:?}");
    assert!(told.at("skipped") > 0 && told.at("commands") < seen.commands.into(), "{told:?}");
    let commands: HashSet<_> = board
        .reports()
        .iter()
        .map(|told| ["speed", "angular", "lamp"].map(|name| told.at(name)))
        // At the start, and whenever this machine was half a second late, it is at rest.
        .filter(|&[speed, angular, _]| (speed, angular) != (0, 0))
        .collect();
    assert_eq!(commands, [[50, 10, 1]].into());

    // The host goes silent.
    let stopped = board.report_when("stopped", |report| {
        report.at("stops") > told.at("stops") && report.at("left_rpm") == 0
    });
    let state = ["speed", "angular", "right_rpm"].map(|name| stopped.at(name));
    assert_eq!(state, [0; 3], "{stopped:?}");
    stopped.assert_nothing_lost();
}

#[test]
fn the_board_masters_a_noisy_bus_and_no_slave_gets_a_command_that_its_program_does_not_have() {
    let Some(mut board) = Board::start(Program::Master) else { return };
    // Quiet until both are found: the program searches only until it has found one node.
    let wire = Wire::disturbed(board.bus(), Some(Noise::ikeya(13)));
    let clock = wire.clock();
    let mut bus = Driver::new(Nodes::new(), wire, clock);
    let turn = Target::Velocity(Rps::new(1.0).unwrap());
    let (mut turns, mut goes) = (0, 0);
    // Noise occasionally makes a node look abnormal; it comes back and is commanded again.
    let found = ["event discovered node 2 velocity", "event discovered node 5 position"];
    let back = ["event health node 2 abnormal", "event health node 2 online"];
    let (end, mut turns_when_back) = (Instant::now() + 2 * PATIENCE, None);
    while turns_when_back.is_none_or(|then| turns == then) || goes == 0 {
        bus.run_for(Duration::from_millis(20), |nodes, event, _| match event {
            // A node that looked abnormal is stopped: 0 rps, or the position where it was.
            SlaveEvent::Command(Target::Velocity(Rps::ZERO)) => {}
            SlaveEvent::Command(Target::Position(to)) if nodes.told.contains(&to.counts()) => {}
            SlaveEvent::Command(target @ Target::Velocity(_)) => {
                assert_eq!(target, turn);
                turns += 1;
            }
            // Five revolutions from a position where it has been.
            SlaveEvent::Command(Target::Position(to)) => {
                let from = to.counts() - 5 * Position::COUNTS_PER_REVOLUTION;
                assert!(nodes.told.contains(&from), "sent to {to:?}");
                goes += 1;
            }
            other => panic!("{other:?}"),
        })
        .unwrap();
        if turns_when_back.is_none() && found.iter().all(|line| board.has_written(&[line])) {
            bus.port_mut().disturb();
            turns_when_back = board.has_written(&back).then_some(turns);
        }
        assert!(Instant::now() < end, "{turns} turns, {goes} goes: {:#?}", board.lines());
    }
    for node in &bus.role().nodes {
        let (seen, slave) = (node.slave().statistics(), node.slave());
        assert!(slave.counters().skipped() > 0 && seen.refused == 0, "{seen:?}");
        assert_eq!(slave.lost_events(), 0);
    }
    assert!(
        board
            .lines()
            .iter()
            .any(|line| line.starts_with("event health") && line.ends_with("suspect"))
    );
    let told = board.report_when("told", |_| true);
    assert_eq!(told.at("lost_events"), 0, "{told:?}");
    told.assert_nothing_lost();
}
