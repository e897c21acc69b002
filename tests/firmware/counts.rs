//! Whatever the firmware counts is compared with what was sent and heard here. The counters of the
//! USART, which QEMU never moves, are those of `uart.rs`.

use axlewire::crc16;

use crate::{master::Nodes, names::*};

#[test]
fn a_slave_counts_what_it_heard_what_it_refused_and_what_it_answered() {
    let Some(mut board) = Board::start(Program::Slave) else { return };
    let mut wire = Wire::new(board.bus());
    let mut no_number = vec![0xBB, NODE.get(), 0, 0, 0xC0, 0x7F];
    no_number.extend(crc16::compute(&no_number).to_le_bytes());
    wire.send(&no_number.repeat(3));
    wire.send(&packet(&ReadRequest::new(NodeId::N5)).repeat(5));
    wire.send(&packet(&WriteRequest::velocity(NODE, rps(1.5))).repeat(2));
    wire.send(&[0; 7]);
    wire.send(&packet(&ReadRequest::new(NODE)));
    let heard = (0..8).filter(|_| wire.receive(PATIENCE).is_some()).count();
    assert_eq!(heard, 8, "an answer");
    let told = board.report_when("answered", |told| told.at("replies") == 1);
    let names = ["node", "reads", "writes", "refused", "foreign", "skipped", "overtaken"];
    assert_eq!(names.map(|name| told.at(name)), [1, 1, 5, 3, 5, 7, 0], "{told:?}");
    assert_eq!((told.at("expired"), told.at("target_mrps")), (0, 1500), "{told:?}");
    // The model moves on between the two, by less than its whole way.
    let told = board.report_when("stopped", |told| told.at("stops") == 1);
    assert!((1..=16384).contains(&told.at("counts")), "{told:?}");
}

#[test]
fn a_robot_counts_pings_pongs_and_the_reports_that_it_could_not_send() {
    const PINGS: u8 = 20;
    let Some(mut board) = Board::start(Program::Robot) else { return };
    let mut wire = Wire::new(board.bus());
    for index in 0..PINGS {
        wire.send(Ping {}.frame(index).as_bytes());
        let due = i64::from(index) + 1;
        board.report_when("answered", |told| told.at("pongs") == due);
    }
    wire.send(&[0; 9]);
    let told = board.report_when("noise", |told| told.at("skipped") == 9);
    let all = i64::from(PINGS);
    assert_eq!([told.at("pings"), told.at("pongs")], [all; 2], "{told:?}");
    assert_eq!(["commands", "stops"].map(|name| told.at(name)), [0, 0], "{told:?}");

    // 50 reports a second are due, of which it sends none while it is halted.
    let late = told.at("late");
    board.halt(std::time::Duration::from_millis(600));
    let told = board.report_when("late", |told| told.at("late") >= late + 20);
    assert!(told.at("reports") > 0 && told.at("ms") >= 600, "{told:?}");
}

#[test]
fn a_master_counts_the_requests_that_its_nodes_hear_and_the_answers_that_they_send() {
    let Some(mut board) = Board::start(Program::Master) else { return };
    let wire = Wire::new(board.bus());
    let clock = wire.clock();
    let mut bus = Driver::new(Nodes::new(), wire, clock);
    bus.run_for(Duration::from_millis(3000), |_, _, _| {}).unwrap();
    let told = board.report_when("told", |_| true);
    let [one, other] = bus.role().nodes.each_ref().map(|node| *node.slave().statistics());
    let requests = told.at("reads") + told.at("writes");
    let heard = i64::from(one.reads + one.writes + one.foreign);
    let answered = i64::from(one.replies + other.replies);
    let writes = i64::from(one.writes + other.writes);
    assert!(told.at("reads") > 100 && told.at("writes") > 100, "{told:?}");
    // What is on its way while nobody listens here, and what was lost to a busy machine.
    let near = |a: i64, b: i64| a.abs_diff(b) <= 10;
    assert!(near(requests, heard), "{told:?} {one:?}");
    assert!(near(told.at("writes"), writes), "{told:?} {one:?} {other:?}");
    assert!(near(told.at("exchanges"), answered), "{told:?} {one:?} {other:?}");
    assert_eq!(told.at("lost_events"), 0, "{told:?}");
}

/// The programs share what tells them. They take a byte of the text port now and then.
#[test]
fn the_losses_that_are_told_are_those_of_the_line_and_not_of_the_text_port() {
    let Some(mut board) = Board::start(Program::Slave) else { return };
    board.flood_text();
    board.report_when("told", |told| told.at("ms") > 300).assert_nothing_lost();
}
