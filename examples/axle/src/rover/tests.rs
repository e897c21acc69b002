//! A rover on a line within the process.

use std::collections::VecDeque;

use axlewire::{
    endpoint::Endpoint,
    time::wire_time,
    ucp::{
        Body,
        message::{ErrorCode, Pong},
    },
};
use serialport::{SerialPort as _, TTYPort};

use super::*;
use crate::{args::PortArgs, clock, played};

#[test]
fn a_positive_turn_is_to_the_right_and_the_text_says_so() {
    for (speed, turn, expected) in [
        (60, 50, "speed 60 %, turn 50 % right"),
        (60, -50, "speed 60 %, turn 50 % left"),
        (-60, 50, "speed -60 %, turn 50 % right (in reverse: the nose swings left)"),
        (-60, -50, "speed -60 %, turn 50 % left (in reverse: the nose swings right)"),
        (0, -100, "speed 0 %, turn 100 % left"),
        (-60, 0, "speed -60 %, turn 0 %"),
    ] {
        let command = motor_control(speed, turn).unwrap();
        assert_eq!((command.speed(), command.angular()), (speed, turn));
        assert_eq!(describe(&command), expected);
    }
    assert!(motor_control(0, 101).is_err() && motor_control(-101, 0).is_err());
}

#[test]
fn a_rover_is_at_rest_once_every_wheel_has_been_still_for_three_reports() {
    let begin = clock::now();
    let line = played::rover(move |rover| {
        let millis = clock::since(begin).as_millis();
        rover.wheels = match millis / 110 {
            0 | 1 => Some([9, 0, 0, 0]),
            2 => Some([0, -9, 0, 0]),
            3 => Some([0, 0, 9, 0]),
            4 => Some([0, 0, 0, -9]),
            5 => Some([9, -9, 9, -9]),
            // Still for one report in three.
            6 | 7 => Some([if millis % 60 < 15 { 0 } else { 9 }; 4]),
            _ => None,
        };
    });
    let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
    assert!(rover.find(|| false).unwrap());
    rover.stop().unwrap();
    assert!(clock::since(begin).as_millis() >= 880, "{:?}", clock::since(begin));
    let commands = &line.state.borrow().commands;
    assert!(commands.len() >= 5 && commands.iter().all(|it| *it == (0, 0)), "{commands:?}");
}

#[test]
fn a_stop_is_heard_before_a_report_counts() {
    let line = played::rover(|_| {});
    let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
    assert!(rover.find(|| false).unwrap());
    let before = line.state.borrow().commands.len();
    rover.stop().unwrap();
    assert!(line.state.borrow().commands.len() >= before + 2, "until the next ping");
    assert!(rover.host().is_stop_sent());
    let text = rover.describe().unwrap();
    assert!(text.starts_with("rpm    0    0    0    0  heading  90 deg  "), "{text}");
}

#[test]
fn reports_from_before_a_stop_was_heard_do_not_show_that_it_stands_still() {
    // It stands still until it has heard of the stop, and then turns.
    let mut pings = None;
    let line = played::rover(move |rover| {
        if rover.commands.len() >= 2 {
            let before = *pings.get_or_insert(rover.pings);
            rover.wheels = (rover.pings > before).then_some([9; 4]);
        }
    });
    let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
    assert!(rover.find(|| false).unwrap());
    assert!(rover.stop().is_err());
    assert_eq!(line.state.borrow().wheels, Some([9; 4]));
}

#[test]
fn reports_from_before_a_stop_was_heard_do_not_count_towards_those_behind_it() {
    // It stands still all the time, but reports nothing from the third stop on, until it has
    // answered three pings: at the second at the latest it is known to have heard.
    let mut played = played::PlayedRover::default();
    let pong = Pong::new(ErrorCode::Fine).frame(0);
    let mut answered = 0;
    let line = played::played(played::RoverState::default(), move |state, bytes| {
        let pings = state.pings;
        let said = played.hear(state, bytes);
        if state.pings > pings && state.is_dumb {
            answered += 1;
            state.is_dumb = answered < 3;
            return pong.as_bytes().to_vec();
        }
        state.is_dumb |= answered == 0 && state.commands.len() >= 3;
        said
    });
    let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
    rover.stop().unwrap();
    assert!(!line.state.borrow().is_dumb, "it has told nothing since");
}

#[test]
fn an_average_from_before_the_robot_had_heard_of_a_stop_does_not_show_that_it_stands_still() {
    // It hears of the stop late. Its average shows half a second after that how its wheels turn.
    let (begin, mut heard_at) = (clock::now(), None);
    let mut played = played::PlayedRover::default();
    let line = played::played(played::RoverState::default(), move |state, bytes| {
        let millis = clock::since(begin).as_millis();
        if millis >= 1300 {
            let heard_at = *heard_at.get_or_insert(clock::now());
            state.wheels = (clock::since(heard_at).as_millis() >= 500).then_some([9; 4]);
        }
        let pings = state.pings;
        let said = played.hear(state, bytes);
        if (100..1300).contains(&millis) && state.pings > pings { Vec::new() } else { said }
    });
    let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
    assert!(rover.find(|| false).unwrap());
    while clock::since(begin).as_millis() < 150 {
        let end = rover.now() + CALL_PERIOD;
        rover.round(end).unwrap();
    }
    assert!(rover.stop().is_err());
    assert_eq!(line.state.borrow().wheels, Some([9; 4]));
}

#[test]
fn from_the_stop_on_a_rover_gets_nothing_but_stops() {
    let line = played::rover(|_| {});
    let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
    assert!(rover.find(|| false).unwrap());
    let now = rover.now();
    rover.host_mut().drive(motor_control(30, 0).unwrap(), now).unwrap();
    while !line.state.borrow().commands.contains(&(30, 0)) {
        let end = rover.now() + CALL_PERIOD;
        rover.round(end).unwrap();
    }
    let (before, begin) = (line.state.borrow().commands.len(), clock::now());
    rover.stop().unwrap();
    let commands = line.state.borrow().commands[before..].to_vec();
    assert!(commands.len() >= 3 && commands.iter().all(|it| *it == (0, 0)), "{commands:?}");
    assert!(clock::since(begin).as_millis() < 1400, "{:?}", clock::since(begin));
}

#[test]
fn the_wheels_of_a_report_are_told_in_their_order() {
    let line = played::rover(|rover| rover.wheels = Some([1, -2, 3, -4]));
    let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
    let end = rover.now() + Duration::from_secs(5);
    while rover.describe().is_none() && rover.now() < end {
        rover.round(end).unwrap();
    }
    let text = rover.describe().unwrap();
    let expected = "rpm    1   -2    3   -4  heading  90 deg  24.3 V  1.56 A  battery 87 %  lost \
                reports 0";
    assert_eq!(text, expected);
}

#[test]
fn a_search_that_is_over_finds_nothing() {
    let line = played::rover(|_| {});
    let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
    assert!(!rover.find(|| true).unwrap());
    assert!(rover.find(|| false).unwrap());
    assert!(!rover.find(|| true).unwrap(), "even if it is heard");
}

#[test]
fn a_search_that_finds_no_robot_tells_what_was_received_and_how_long_it_took() {
    let strays = |count: u32| {
        played::played(count, |left, _| {
            let is_more = *left > 0;
            *left = left.saturating_sub(1);
            vec![0; usize::from(is_more)]
        })
    };
    for (count, heard) in [(0, "nothing"), (5, "5 bytes but no message")] {
        let mut rover = Rover::on(strays(count).line, &PortArgs::new(None));
        let begin = clock::now();
        let Err(Failure::Failed(told)) = rover.find(|| false) else { panic!("found") };
        assert_eq!(told, format!("no robot answers on \"played\": {heard} received in 2 s"));
        assert!(clock::since(begin).as_millis() >= 1999, "{:?}", clock::since(begin));
    }
}

#[test]
fn a_search_is_over_soon_after_it_is_told_so_however_silent_the_line_is() {
    let line = played::rover(|rover| rover.is_dumb = true);
    let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
    let begin = clock::now();
    assert!(!rover.find(|| clock::since(begin).as_millis() >= 300).unwrap());
    assert!(clock::since(begin).as_millis() < 700, "{:?}", clock::since(begin));
}

#[test]
fn the_dead_man_of_the_host_is_noticed() {
    let line = played::rover(|_| {});
    let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
    assert!(rover.find(|| false).unwrap());
    let now = rover.now();
    rover.host_mut().drive(motor_control(20, 0).unwrap(), now).unwrap();
    let end = rover.now() + Duration::from_millis(700);
    while rover.now() < end {
        rover.round(end).unwrap();
    }
    assert!(rover.has_dead_man_fired);
    assert_eq!(line.state.borrow().commands.last(), Some(&(0, 0)));
}

#[test]
fn a_late_pong_does_not_tell_that_a_later_ping_was_heard() {
    let late = Span::from_millis(700);
    let (mut played, mut waiting) = (played::PlayedRover::default(), VecDeque::new());
    let line = played::played(played::RoverState::default(), move |state, bytes| {
        let said = played.hear(state, bytes);
        if !said.is_empty() {
            waiting.push_back((clock::now() + late, said));
        }
        let mut due = Vec::new();
        while waiting.front().is_some_and(|(at, _)| *at <= clock::now()) {
            due.extend(waiting.pop_front().map(|(_, said)| said).unwrap_or_default());
        }
        due
    });
    let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
    assert!(rover.find(|| false).unwrap());
    let (mark, begin) = (rover.mark(), clock::now());
    // All pings are young: each may be answered yet, also those of the first round.
    let seen = rover.host().statistics();
    assert_eq!(mark.open, Some(seen.pings - pongs(seen)));
    assert_ne!(mark.open, Some(0));
    while !rover.has_heard(&mark) && clock::since(begin) < 5 * late {
        let end = rover.now() + CALL_PERIOD;
        rover.round(end).unwrap();
    }
    assert!((late..3 * late).contains(&clock::since(begin)), "{:?}", clock::since(begin));
}

#[test]
fn pings_of_others_make_every_pong_doubtful() {
    let line = played::rover(|_| {});
    for has_others in [false, true] {
        let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
        assert!(rover.find(|| false).unwrap());
        if has_others {
            rover.others_have_pinged();
        }
        let mark = rover.mark();
        assert!(!rover.has_heard(&mark));
        let end = rover.now() + Duration::from_millis(700);
        while rover.now() < end && !rover.has_heard(&mark) {
            rover.round(end).unwrap();
        }
        assert_eq!(rover.has_heard(&mark), !has_others);
    }
}

#[test]
fn the_host_of_a_rover_has_the_speed_of_its_line() {
    let (_ours, theirs) = TTYPort::pair().unwrap();
    for (baud, expected) in [(None, 115_200), (Some(57_600), 57_600)] {
        let args = PortArgs { port: theirs.name().unwrap(), ..PortArgs::new(baud) };
        let opened = Rover::open(&args).unwrap();
        for rover in [opened, Rover::on(played::silence(true), &args)] {
            assert_eq!(rover.host().line_rules().wire_time(100), wire_time(100, expected));
        }
    }
}

#[test]
fn commands_from_before_a_stop_are_no_stops() {
    // With each report comes a pong, as if it had heard everything at once.
    let mut played = played::PlayedRover::default();
    let pong = Pong::new(ErrorCode::Fine).frame(0);
    let line = played::played(played::RoverState::default(), move |state, bytes| {
        let said = played.hear(state, bytes);
        if said.is_empty() { said } else { [&said, pong.as_bytes()].concat() }
    });
    let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
    assert!(rover.find(|| false).unwrap());
    while line.state.borrow().commands.len() < 6 {
        let now = rover.now();
        rover.host_mut().drive(motor_control(30, 0).unwrap(), now).unwrap();
        rover.round(now + CALL_PERIOD).unwrap();
    }
    let before = line.state.borrow().commands.len();
    rover.stop().unwrap();
    let stops = line.state.borrow().commands[before..].to_vec();
    assert!(!stops.is_empty() && stops.iter().all(|it| *it == (0, 0)), "{stops:?}");
}

#[test]
fn pings_that_are_lost_do_not_stay_open() {
    let line = played::rover(|rover| rover.is_dumb = true);
    let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
    let begin = clock::now();
    assert!(!rover.find(|| clock::since(begin).as_millis() >= 1700).unwrap());
    let (mark, pings) = (rover.mark(), rover.host().statistics().pings);
    assert!(mark.open.is_some_and(|open| (1..pings).contains(&open)), "{pings} {:?}", mark.open);
}
