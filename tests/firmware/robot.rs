//! The firmware robot against a host on this machine.

use std::os::unix::net::UnixStream;

use axlewire::ucp::{
    Host,
    host::{HostConfig, Link},
    message::{CalibrationKind, NetworkState, OtaStatus},
};

use crate::names::*;

pub(crate) type Rover = Driver<Host<MemoryStore>, Wire, WireClock>;

fn linked() -> Option<(Board, Rover)> {
    linked_by(Wire::new, patient())
}

/// QEMU answers when this machine gets to it.
pub(crate) fn patient() -> HostConfig {
    let mut config = HostConfig::default();
    config.ack_timeout = Duration::from_millis(3000);
    config.ping_timeout = Duration::from_millis(10_000);
    config.link_timeout = Duration::from_millis(10_000);
    config.idle_margin = Duration::from_millis(200);
    config
}

/// A board, and a host at the other end of a wire made for it.
pub(crate) fn linked_by(
    wire: impl FnOnce(UnixStream) -> Wire,
    config: HostConfig,
) -> Option<(Board, Rover)> {
    let mut board = Board::start(Program::Robot)?;
    let wire = wire(board.bus());
    let mut clock = wire.clock();
    let now = axlewire::drive::Clock::now(&mut clock);
    let host = Host::with_store(config, MemoryStore::default(), now);
    Some((board, Driver::new(host, wire, clock)))
}

pub(crate) fn end_of(rover: &mut Rover) -> Instant {
    rover.now() + Duration::from_millis(PATIENCE.as_millis() as u32)
}

/// Runs the host, driving if requested, until an event matches.
fn event_when(
    rover: &mut Rover,
    what: &str,
    command: Option<MotorControl>,
    done: impl Fn(&HostEvent) -> bool,
) {
    let end = end_of(rover);
    loop {
        let now = rover.now();
        assert!(now < end, "timed out waiting for: {what}");
        if let Some(command) = command {
            // Refused until the board is heard.
            let _ = rover.role_mut().drive(command, now);
        }
        let event = rover.next_event(Duration::from_millis(50)).unwrap();
        if event.is_some_and(|event| done(&event)) {
            return;
        }
    }
}

pub(crate) fn wheels_turn_at(event: &HostEvent, wanted: [i16; 2]) -> bool {
    let HostEvent::Report(report) = event else { return false };
    // Front and rear of a side turn alike.
    let [left, right] = wanted;
    report.telemetry.rpm == [left, right, left, right]
}

/// Reports due by the robot's own clock; one more or fewer may be in flight.
fn assert_fifty_reports_a_second(told: &Report) {
    let due = told.at("ms") / 20;
    assert!((told.at("reports") + told.at("late") - due).abs() <= 2, "{told:?}");
}

#[test]
fn pings_are_answered_and_reports_come_in_order_fifty_times_a_second() {
    let Some((mut board, mut rover)) = linked() else { return };
    let end = end_of(&mut rover);
    rover.ping(end - rover.now()).unwrap();
    assert_eq!(rover.role().link(), Link::Up);
    // Every report is an event; `next_report` would skip to the latest on a busy machine.
    let mut next = || loop {
        if let HostEvent::Report(report) =
            rover.next_event(end - rover.now()).unwrap().expect("a report")
        {
            break report;
        }
    };
    let mut before = next();
    for _ in 0..100 {
        let report = next();
        assert_eq!((report.index, report.lost), (before.index.wrapping_add(1), 0));
        assert_eq!((report.version, report.telemetry.battery()), (Some(38), Some(87)));
        assert_eq!(report.telemetry.rpm, [0; 4]);
        before = report;
    }
    assert_eq!(rover.role().statistics().reports_lost, 0);
    assert_eq!(rover.role().counters().skipped(), 0);
    let told = board.report_when("pinged", |report| report.at("pongs") >= 1);
    assert_fifty_reports_a_second(&told);
    told.assert_nothing_lost();
}

#[test]
fn the_robot_drives_as_commanded_and_stops_when_the_host_goes_silent() {
    let Some((mut board, mut rover)) = linked() else { return };
    let ahead = MotorControl::turn_right(50, 10).unwrap().with_front_led(true);
    event_when(&mut rover, "at speed", Some(ahead), |event| wheels_turn_at(event, [64, 55]));
    // The host is connected but silent: it does not even send its dead-man's stop.
    let told = board.report_when("stopped", |report| {
        report.at("stops") >= 1 && report.at("left_rpm") == 0 && report.at("right_rpm") == 0
    });
    let state = ["speed", "angular", "lamp"].map(|name| told.at(name));
    assert_eq!(state, [0, 0, 1], "{told:?}");
    assert_fifty_reports_a_second(&told);
    told.assert_nothing_lost();

    // Bytes that the host did not read are read now; the next command drives again.
    let back = MotorControl::new(-100, 0).unwrap();
    event_when(&mut rover, "driving back", Some(back), |event| wheels_turn_at(event, [-120; 2]));
    // The application is silent, the host is not: its dead-man stops the robot.
    event_when(&mut rover, "the dead-man", None, |event| *event == HostEvent::DeadMan);
    event_when(&mut rover, "standing", None, |event| wheels_turn_at(event, [0; 2]));
}

/// QEMU delays bytes when this machine is busy; a board would take the rest for a new frame.
#[test]
fn a_pause_of_30_ms_within_a_command_does_not_cut_it_off_in_an_emulator() {
    let Some(mut board) = Board::start(Program::Robot) else { return };
    let mut wire = Wire::new(board.bus());
    let turn = MotorControl::new(0, 60).unwrap();
    // The machine may make a pause longer: one of many is enough.
    for index in 0..20 {
        let frame = turn.frame(index);
        let (head, rest) = frame.as_bytes().split_at(8);
        wire.send(head);
        std::thread::sleep(std::time::Duration::from_millis(30));
        wire.send(rest);
    }
    board.report_when("commanded", |told| told.at("commands") > 0);
}

#[test]
fn the_robot_stands_still_500_ms_after_the_last_valid_command_whatever_else_arrives() {
    let Some(mut board) = Board::start(Program::Robot) else { return };
    let mut wire = Wire::new(board.bus());
    let turn = MotorControl::new(0, 60).unwrap();
    for index in 0..50 {
        wire.send(turn.frame(index).as_bytes());
        board.ask();
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let last = board.report_when("commanded", |report| report.at("commands") == 50);
    assert_eq!((last.at("angular"), last.at("stops")), (60, 0), "{last:?}");

    // No more commands, only pings, damaged commands and noise.
    let mut rng = Rng::new(31);
    let end = std::time::Instant::now() + std::time::Duration::from_secs(3);
    let mut index = 50u8;
    while std::time::Instant::now() < end {
        index = index.wrapping_add(1);
        let mut damaged = turn.frame(index).as_bytes().to_vec();
        let at = rng.below(damaged.len() as u64) as usize;
        damaged[at] ^= 1 << rng.below(8);
        wire.send(&damaged);
        wire.send(&[0xFD, 0xFF, rng.byte(), rng.byte()]);
        wire.send(Ping {}.frame(index).as_bytes());
        while wire.receive(std::time::Duration::from_millis(5)).is_some() {}
        board.ask();
    }
    let told = board.report_when("stopped", |report| report.at("stops") == 1);
    assert_eq!((told.at("commands"), told.at("angular")), (50, 0), "{told:?}");
    assert!(told.at("skipped") > 0 && told.at("pings") > 10, "{told:?}");
    let state = ["speed", "left_rpm", "right_rpm"].map(|name| told.at(name));
    assert_eq!(state, [0; 3], "{told:?}");
    // By the robot's own clock: the last command had arrived when this was first reported.
    let reports = board.reports();
    let heard = reports.iter().find(|it| it.at("commands") == 50).unwrap().at("ms");
    let (mut moving, mut still) = (0, 0);
    for report in reports.iter().filter(|it| it.at("commands") == 50) {
        let is_still = report.at("angular") == 0;
        assert!(is_still || report.at("ms") <= heard + 500, "moves after {heard} ms: {report:?}");
        (moving, still) = (moving + i32::from(!is_still), still + i32::from(is_still));
    }
    assert!(moving > 5 && still > 5, "{moving} {still}");
    told.assert_nothing_lost();
}

#[test]
fn calibrations_are_agreed_found_and_kept_and_an_update_is_refused() {
    let Some((mut board, mut rover)) = linked() else { return };
    for kind in [CalibrationKind::Imu, CalibrationKind::Magnetometer] {
        let end = end_of(&mut rover);
        rover.start_calibration(kind, end - rover.now()).unwrap();
        rover.end_calibration(kind, end - rover.now()).unwrap();
        event_when(&mut rover, "a result", None, |event| {
            matches!(event, HostEvent::ImuBias(_) | HostEvent::MagBias(_))
        });
    }
    let (imu, mag) = (ImuBias::new([12, -7, 3], [-2, 4, 1]), MagBias::new([150, -80, 25]));
    let store = *rover.role_mut().store();
    assert_eq!(store, MemoryStore { imu: Some(imu), mag: Some(mag) });
    // The robot requests its biases until it has them.
    event_when(&mut rover, "asked", None, |event| *event == HostEvent::BiasesSent);

    let now = rover.now();
    rover.role_mut().set_network_state(NetworkState::Connected, now).unwrap();
    board_shows(&mut board, &mut rover, |told| told.at("network") == 3 && told.at("biases") >= 1);

    let end = end_of(&mut rover);
    rover.await_standstill(end - rover.now()).unwrap();
    let now = rover.now();
    rover.role_mut().start_firmware_update(39, now).unwrap();
    let refused = HostEvent::UpdateAnswered(OtaStatus::Forbidden);
    event_when(&mut rover, "refused", None, |event| *event == refused);
    let told = board.report_when("refusing", |report| report.at("updates_refused") > 0);
    assert_eq!((told.at("calibrations"), told.at("updates_refused")), (2, 1));
    told.assert_nothing_lost();
}

#[test]
fn the_robot_shows_the_latest_network_state_also_after_a_higher_one() {
    let Some((mut board, mut rover)) = linked() else { return };
    for (state, number) in [(NetworkState::Connected, 3), (NetworkState::Disconnected, 2)] {
        let now = rover.now();
        rover.role_mut().set_network_state(state, now).unwrap();
        board_shows(&mut board, &mut rover, |told| told.at("network") == number);
    }
}

#[test]
fn the_wheels_turn_from_the_step_on_in_which_a_command_is_taken() {
    let Some(mut board) = Board::start(Program::Robot) else { return };
    let mut wire = Wire::new(board.bus());
    let drive = MotorControl::new(20, 0).unwrap();
    // Requests wait for the next step.
    let pause = std::time::Duration::from_millis(1);
    for _ in 0..5 {
        board.report_when("at rest", |told| told.at("speed") == 0 && told.at("left_rpm") == 0);
        let seen = board.reports().len();
        board.ask_for_a_while(5, pause);
        wire.send(drive.frame(0).as_bytes());
        board.ask_for_a_while(15, pause);
        board.report_when("driving", |told| told.at("speed") == 20);
        let reports = board.reports();
        let told = reports[seen..].iter().find(|told| told.at("speed") == 20).unwrap();
        // A step of 10 ms of 24 rpm, with a time constant of 150 ms.
        assert!(told.at("left_rpm") >= 1 && told.at("right_rpm") >= 1, "{told:?}");
        wire.send(MotorControl::STOP.frame(0).as_bytes());
    }
}

/// Runs the host until the robot's report matches.
pub(crate) fn board_shows(
    board: &mut Board,
    rover: &mut Rover,
    done: impl Fn(&Report) -> bool,
) -> Report {
    let end = end_of(rover);
    loop {
        rover.run_for(Duration::from_millis(20), |_, _, _| {}).unwrap();
        let told = board.report_when("told", |_| true);
        if done(&told) {
            return told;
        }
        assert!(rover.now() < end, "{told:?}");
    }
}
