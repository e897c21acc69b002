//! Frames at their times, without a line: bytes and time go in, bytes come out.

use axlewire::{
    ikeya::{Position, PositionResponse, ReadRequest, Rps, WriteRequest},
    ucp::message::Ping,
};

use super::{super::effect, *};
use crate::listing::TimeColumn;

const ONE: NodeId = NodeId::N1;

fn at(millis: u64) -> Instant {
    Instant::from_micros(millis * 1000)
}

fn due(protocol: Protocol, after_ms: u64, bytes: &[u8]) -> Due {
    let (_, effect) = effect::of(protocol, bytes).unwrap();
    Due { after_us: after_ms * 1000, bytes: bytes.into(), meant: None, effect }
}

fn read(node: NodeId) -> [u8; 4] {
    *ReadRequest::new(node).as_bytes()
}

fn write(rps: f32) -> [u8; 8] {
    *WriteRequest::velocity(ONE, Rps::new(rps).unwrap()).as_bytes()
}

fn part(protocol: Protocol, frames: &[(u64, &[u8])]) -> Part {
    let due = frames.iter().map(|(after_ms, bytes)| due(protocol, *after_ms, bytes)).collect();
    let (holds_rover, has_echo) = (false, false);
    let modes = Modes::default();
    Part { protocol, baud: 9600, due, linger_us: 300_000, holds_rover, has_echo, modes }
}

fn player(part: Part) -> Player {
    Player::new(part, Style::text("node", TimeColumn::None), at(0))
}

/// What is sent at this time, all of it.
fn sent(player: &mut Player, millis: u64) -> Vec<Vec<u8>> {
    let mut all = Vec::new();
    while let Some(bytes) = player.poll_transmit(at(millis)) {
        all.push(bytes.to_vec());
    }
    all
}

#[test]
fn a_frame_leaves_at_its_time_once_the_line_has_carried_the_one_before() {
    let mut player =
        player(part(Protocol::Ikeya, &[(0, &write(1.0)), (0, &read(ONE)), (50, &write(2.0))]));
    assert_eq!(sent(&mut player, 0), [write(1.0)]);
    // 8 bytes of 10 bits at 9600 bit/s; a board with one motor does not answer a WRITE.
    assert_eq!(player.poll_timeout(), Some(Instant::from_micros(8334)));
    assert_eq!(sent(&mut player, 8), [[0; 0]; 0]);
    assert_eq!(sent(&mut player, 9), [read(ONE)]);
    assert_eq!(player.poll_timeout(), Some(at(50)));
    assert_eq!((player.left(), sent(&mut player, 49).len()), (1, 0));
    assert_eq!(sent(&mut player, 50), [write(2.0)]);
    assert_eq!((player.left(), player.poll_timeout()), (0, None));
}

#[test]
fn the_line_is_left_to_the_answer_of_a_question_and_of_a_command_to_three_motors() {
    let mut one = player(part(Protocol::Ikeya, &[(0, &read(ONE)), (0, &read(ONE))]));
    assert_eq!(sent(&mut one, 0).len(), 1);
    // 4 bytes and 8 of the answer, and the pause in between.
    assert_eq!(one.poll_timeout(), Some(Instant::from_micros(12_500 + 200)));
    let speeds = [Rps::ZERO; 3];
    let write = three::WriteRequest::velocity(ONE, speeds);
    let frames: [(u64, &[u8]); 2] = [(0, write.as_bytes()), (0, write.as_bytes())];
    let mut board = player(part(Protocol::Ikeya3, &frames));
    assert_eq!(sent(&mut board, 0).len(), 1);
    let answer = three::VelocityResponse::new(ONE, speeds);
    let time = wire_time(write.as_bytes().len() + answer.as_bytes().len(), 9600) + TURNAROUND;
    assert_eq!(board.poll_timeout(), Some(at(0) + time));
}

#[test]
fn a_rover_is_told_to_stop_first_and_every_100_ms_until_its_first_motor_command() {
    let (ping, stop) = (Ping {}.frame(7).as_bytes().to_vec(), MotorControl::STOP.frame(0));
    let drive = MotorControl::new(10, 0).unwrap().frame(3);
    let frames: [(u64, &[u8]); 3] = [(50, &ping), (350, drive.as_bytes()), (700, &ping)];
    let mut part = part(Protocol::Ucp, &frames);
    (part.holds_rover, part.baud) = (true, 115_200);
    let mut player = player(part);
    assert_eq!(player.poll_timeout(), Some(at(0)));
    assert_eq!(sent(&mut player, 0), [stop.as_bytes()]);
    assert_eq!((player.poll_timeout(), sent(&mut player, 50)), (Some(at(50)), vec![ping.clone()]));
    assert_eq!(player.poll_timeout(), Some(at(100)), "before the next frame");
    for millis in [100, 200, 300] {
        assert_eq!(sent(&mut player, millis), [stop.as_bytes()], "{millis}");
    }
    assert_eq!(sent(&mut player, 350), [drive.as_bytes()]);
    assert_eq!(player.poll_timeout(), Some(at(700)), "no stop of ours any more");
    assert_eq!(sent(&mut player, 700), [ping]);
}

#[test]
fn three_questions_to_a_commanded_node_without_an_answer_are_the_end_after_a_tenth_of_a_second() {
    let frames = |node: NodeId| {
        let read = read(node);
        let frames: [(u64, &[u8]); 6] = [
            (0, &write(1.0)),
            (10, &read),
            (30, &read),
            (60, &read),
            (105, &write(1.0)),
            (115, &write(1.0)),
        ];
        player(part(Protocol::Ikeya, &frames))
    };
    let mut silent = frames(ONE);
    let left: Vec<_> = [0, 10, 30, 60, 105].map(|time| sent(&mut silent, time).len()).into();
    assert_eq!(left, [1; 5], "not before");
    silent.check(at(109)).unwrap();
    assert_eq!(sent(&mut silent, 115).len(), 0);
    let error = silent.check(at(115)).unwrap_err().to_string();
    assert_eq!(error, "no answer to 3 READs: no more commands are sent");

    let mut answering = frames(ONE);
    for time in [0, 10, 30, 60] {
        sent(&mut answering, time);
    }
    let answer = PositionResponse::new(ONE, Position::new(0, 0));
    answering.handle_input(answer.as_bytes(), at(70));
    let later: Vec<_> = [105, 115].map(|time| sent(&mut answering, time).len()).into();
    assert_eq!(later, [1; 2]);
    // Noise is no answer.
    let mut noisy = frames(ONE);
    for time in [0, 10, 30, 60] {
        sent(&mut noisy, time);
        noisy.handle_input(&[0], at(time + 1));
    }
    assert_eq!([105, 115].map(|time| sent(&mut noisy, time).len()), [1, 0]);
    // Those to others do not count.
    let mut others = frames(NodeId::N2);
    let left: Vec<_> = [0, 10, 30, 60, 105, 115].map(|time| sent(&mut others, time).len()).into();
    assert_eq!(left, [1; 6]);
}

#[test]
fn what_was_due_during_an_absence_is_not_sent() {
    let mut player = player(part(Protocol::Ikeya, &[(0, &write(1.0)), (100, &write(2.0))]));
    assert_eq!(sent(&mut player, 0).len(), 1);
    assert_eq!(sent(&mut player, 600).len(), 0);
    let error = player.check(at(600)).unwrap_err().to_string();
    assert_eq!(error, "the tool did not run for 0.6 s (suspended?)");
    assert_eq!(player.left(), 1);
}

#[test]
fn it_is_over_when_the_last_frame_was_sent_and_the_time_to_listen_is_up() {
    let mut player = player(part(Protocol::Ikeya, &[(0, &read(ONE)), (100, &read(ONE))]));
    sent(&mut player, 0);
    assert!(!player.is_over(at(400)), "one is missing");
    sent(&mut player, 120);
    assert!(!player.is_over(at(419)) && player.is_over(at(420)));
    assert_eq!(player.lost, 0);
    player.handle_unsent(Unsent::CutOff, at(421));
    assert_eq!(player.lost, 1);
}

#[test]
fn a_node_that_answers_in_another_mode_is_told_with_both() {
    let mut part = part(Protocol::Ikeya, &[(0, &write(1.0))]);
    part.modes.learn(ONE, Mode::Velocity);
    let mut player = player(part);
    assert_eq!(player.turncoat(), None);
    let answer = PositionResponse::new(ONE, Position::new(0, 0));
    player.handle_input(answer.as_bytes(), at(1));
    assert_eq!(player.turncoat(), Some((ONE, Mode::Position, Mode::Velocity)));
    assert_eq!(player.seen().of(ONE), Some(Mode::Position));
}

#[test]
fn an_echo_is_taken_out_once_and_an_answer_behind_it_is_shown() {
    for has_echo in [true, false] {
        let mut part = part(Protocol::Ikeya, &[(0, &read(ONE))]);
        part.has_echo = has_echo;
        let mut player = player(part);
        sent(&mut player, 0);
        let answer = PositionResponse::new(ONE, Position::new(0, 0));
        player.handle_input(&read(ONE), at(5));
        player.handle_input(answer.as_bytes(), at(10));
        let lines = [player.poll_event(), player.finish()];
        let text: String = lines.into_iter().flatten().collect();
        let count = |name: &str| text.matches(name).count();
        let reads = if has_echo { 1 } else { 2 };
        assert_eq!((count("read_request"), count("position_response")), (reads, 1), "{text}");
    }
}

#[test]
fn an_echo_may_come_in_pieces() {
    let mut part = part(Protocol::Ikeya, &[(0, &read(ONE))]);
    part.has_echo = true;
    let mut player = player(part);
    sent(&mut player, 0);
    player.handle_input(&read(ONE)[..2], at(5));
    player.handle_input(&read(ONE)[2..], at(6));
    let lines = player.finish().unwrap();
    assert_eq!(lines.lines().count(), 2, "the titles and what was sent: {lines}");
}

#[test]
fn the_echo_behind_a_damaged_one_or_a_lost_frame_is_taken_out_again() {
    // What comes back of the first frame: damaged, or the part that has left.
    let [first, second] = [read(ONE), read(NodeId::N2)];
    let damaged = [first[0], !first[1], first[2], first[3]];
    for (comes_back, is_lost) in [(&damaged[..], false), (&first[..2], true)] {
        let mut part = part(Protocol::Ikeya, &[(0, &first), (50, &second)]);
        part.has_echo = true;
        let mut player = player(part);
        sent(&mut player, 0);
        if is_lost {
            player.handle_unsent(Unsent::CutOff, at(3));
        }
        player.handle_input(comes_back, at(5));
        assert_eq!(sent(&mut player, 50), [second]);
        player.handle_input(&second, at(55));
        let lines = [player.poll_event(), player.finish()];
        let text: String = lines.into_iter().flatten().collect();
        assert_eq!(text.matches("read_request").count(), 2, "those sent: {text}");
    }
}

#[test]
fn each_line_has_its_time_and_the_last_one_comes_at_the_end() {
    let style = Style::text("node", TimeColumn::Relative);
    let mut player = Player::new(part(Protocol::Ikeya, &[]), style, at(0));
    let answer = PositionResponse::new(ONE, Position::new(0, 0));
    player.handle_input(answer.as_bytes(), at(10));
    player.handle_input(answer.as_bytes(), at(35));
    player.handle_input(&[0x55, 1, 2], at(40));
    let lines = [player.poll_event().unwrap(), player.finish().unwrap()].join("\n");
    let times: Vec<_> = lines.lines().map(|line| line.split_whitespace().next()).collect();
    let expected = ["time", "0.000000", "0.025000", "0.030000"];
    assert_eq!(times, expected.map(Some), "{lines}");
}
