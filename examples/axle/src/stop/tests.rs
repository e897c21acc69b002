//! What a stop says, and whether it is a success.

use super::*;

fn stopped(answered: usize, complaints: &[&str], is_lost: bool) -> Stopped {
    Stopped {
        path: "port".to_owned(),
        answered,
        complaints: complaints.iter().map(|it| (*it).to_owned()).collect(),
        failure: is_lost.then(|| Failure::lost("port", "unplugged")),
        ..Stopped::default()
    }
}

fn says(stopped: Stopped) -> Option<String> {
    stopped.judge().err().map(|failure| failure.to_string())
}

#[test]
fn a_stop_is_a_success_only_if_something_has_answered_and_all_of_it_is_at_rest() {
    assert_eq!(says(stopped(1, &[], false)), None);
    assert_eq!(says(stopped(0, &[], false)).unwrap(), "no node answers on \"port\"");
    let damaged = Stopped { damaged: 1, ..stopped(0, &[], false) };
    let expected = "no node answers on \"port\" (damaged bytes received)";
    assert_eq!(says(damaged).unwrap(), expected);
    assert_eq!(says(stopped(2, &["one", "two"], false)).unwrap(), "one; two");
}

#[test]
fn a_lost_port_is_told_with_what_it_means_for_each_node() {
    let lost = "port \"port\" failed: unplugged";
    assert_eq!(says(stopped(1, &[], true)).unwrap(), lost);
    assert_eq!(says(stopped(1, &["one", "two"], true)).unwrap(), format!("{lost}; one; two"));
    let nothing = format!("{lost}; no node answers on \"port\"");
    assert_eq!(says(stopped(0, &[], true)).unwrap(), nothing);
}

#[test]
fn a_node_and_a_robot_that_were_stopped_are_told_in_both_forms() {
    let node = Some(NodeId::N3);
    let data = Some(OneMotor::data(ikeya::Status::Velocity(0.0)));
    let event = Event::Stopped { node, status: data, text: "0.00 rps".to_owned() };
    assert_eq!(Form::Text.plain(&event), "node 3: 0.00 rps, stopped and confirmed");
    assert_eq!(Form::Json.plain(&event), r#"{"event":"stopped","node":3,"rps":0.0}"#);
    let event = Event::Stopped { node: None, status: None, text: "rpm 0".to_owned() };
    assert_eq!(Form::Text.plain(&event), "robot: rpm 0, stopped");
    assert_eq!(Form::Json.plain(&event), r#"{"event":"stopped"}"#);
    let event = Event::Silent { nodes: vec![NodeId::N1, NodeId::N8] };
    assert_eq!(Form::Text.plain(&event), "silent, not stopped: 1, 8");
    assert_eq!(Form::Json.plain(&event), r#"{"event":"silent","nodes":[1,8]}"#);
}
