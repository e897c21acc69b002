//! The robot behind a driver: which command is in force.

use axlewire::drive::Driver;
use embedded_io::Write;

use crate::{
    port::{Port, World},
    rover_rig::*,
};

/// A robot whose application drives at 50 and was then held up for 400 ms, during which twenty
/// commands arrived, then this one.
fn held_up(last: i16) -> (World, Driver<Robot, Port, World>, Port) {
    let world = World::default();
    let (near, mut far) = Port::pair(&world, 87);
    let robot = Robot::new(RobotConfig::default(), world.now());
    let mut robot = Driver::new(robot, near, world.clone());
    far.write(&bytes(go(50))).unwrap();
    let command = robot.next_command(ms(100)).unwrap();
    assert_eq!(command.map(|command| command.speed()), Some(50));
    for speed in 60..80 {
        far.write(&bytes(go(speed))).unwrap();
        world.step(20_000);
    }
    far.write(&bytes(go(last))).unwrap();
    world.step(5000);
    (world, robot, far)
}

#[test]
fn the_command_that_is_handed_out_after_a_pause_is_the_one_in_force() {
    let (world, mut robot, _far) = held_up(33);
    let deadline = world.now() + Duration::from_millis(100);
    let command = robot.next_command(deadline).unwrap().map(|command| command.speed());
    assert_eq!(robot.role().command(world.now()).speed(), 33);
    assert_eq!(command, Some(33), "a replaced command is handed out");
}

#[test]
fn a_stop_is_handed_out_however_many_commands_came_before_it() {
    for is_async in [false, true] {
        let (world, mut robot, mut far) = held_up(0);
        let mut speed = 50;
        for _ in 0..30 {
            far.write(&bytes(go(0))).unwrap();
            let deadline = world.now() + Duration::from_millis(100);
            let command = match is_async {
                true => world.block_on(robot.next_command_async(deadline)),
                false => robot.next_command(deadline),
            };
            speed = command.unwrap().map_or(speed, |command| command.speed());
        }
        assert_eq!(robot.role().command(world.now()).speed(), 0);
        assert_eq!(speed, 0, "the application keeps driving after a stop");
    }
}
