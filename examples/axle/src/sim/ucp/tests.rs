//! What a simulated rover tells of its host's requests.

use axlewire::ucp::robot::UpdateSource;

use super::*;

#[test]
fn a_request_for_an_update_is_told_and_ignored() {
    let now = Instant::from_micros(0);
    let mut robot = Robot::new(RobotConfig::default(), now);
    let asked = RobotEvent::UpdateRequested { version: 40, by: UpdateSource::Request };
    let told = react(&mut robot, asked, now).unwrap().to_string();
    assert_eq!(told, "firmware update to version 40 requested and ignored");
    assert!(react(&mut robot, RobotEvent::ImuBiasTaken, now).is_none());
}
