//! A motor whose cable is pulled out while it turns is stopped when it is back (I12).

use axlewire::sim::MotorNode;

use crate::rig::*;

/// A bus in virtual time on which node 1 turns at 10 rps.
fn at_10_rps() -> Line<Master, MotorNode> {
    let mut line = Line::new(500_000, 1, Master::new(MasterConfig::direct(), Instant::default()));
    line.add(MotorNode::new(NodeId::N1, Mode::Velocity));
    let now = line.now();
    line.head_mut().discover(now);
    line.run_for(MS(50)).unwrap();
    let now = line.now();
    line.head_mut().set_velocity(NodeId::N1, rps(10.0), now).unwrap();
    line.run_for(MS(500)).unwrap();
    assert!(line.tail(0).motor().velocity().get() > 9.9);
    line
}

fn pull_out(line: &mut Line<Master, MotorNode>, is_out: bool) {
    line.stub_mut(Who::Tail(0)).unplugged = is_out;
}

/// Node 1 comes back after it was abnormal; its speed five seconds later.
fn rps_after_its_return(mut line: Line<Master, MotorNode>) -> f32 {
    line.run_for(MS(100)).unwrap();
    assert_eq!(line.head().health(NodeId::N1), Some(Health::Abnormal));
    pull_out(&mut line, false);
    line.run_for(MS(5000)).unwrap();
    assert_eq!(line.head().health(NodeId::N1), Some(Health::Online));
    line.tail(0).motor().velocity().get()
}

#[test]
fn a_stop_that_a_pulled_cable_has_swallowed_is_given_again_when_the_node_is_back() {
    let mut line = at_10_rps();
    pull_out(&mut line, true);
    let now = line.now();
    line.head_mut().stop(NodeId::N1, now);
    let rps = rps_after_its_return(line);
    assert!(rps.abs() < 0.05, "the stop is forgotten, and the motor keeps running");
}

#[test]
fn a_node_that_became_abnormal_under_a_set_point_is_stopped_when_it_is_back() {
    let mut line = at_10_rps();
    pull_out(&mut line, true);
    let rps = rps_after_its_return(line);
    assert!(rps.abs() < 0.05, "the motor keeps running without a command");
}
