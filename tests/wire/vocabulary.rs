//! One vocabulary: what the four roles have in common has the same name and the same shape in each.
#![cfg(all(feature = "ikeya", feature = "ucp"))]

use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        Master, Slave,
        master::{MasterConfig, MasterEvent, MasterStatistics},
        slave::{SlaveConfig, SlaveEvent, SlaveStatistics},
    },
    ucp::{
        Host, Robot,
        host::{HostConfig, HostEvent, HostStatistics},
        robot::{RobotConfig, RobotEvent, RobotStatistics},
    },
};

use crate::rig::*;

const NOW: Instant = Instant::from_micros(7);

/// Compiles only if each role has these calls. A new role is silent about all of them.
macro_rules! speaks_the_common_words {
    ($($test:ident: $role:ty = $new:expr, $config:ident, $event:ident, $statistics:ident;)+) => {$(
        #[test]
        fn $test() {
            let mut role: $role = $new;
            let config: fn(&$role) -> &$config = <$role>::config;
            let statistics: fn(&$role) -> &$statistics = <$role>::statistics;
            let counters: fn(&$role) -> Counters = <$role>::counters;
            let lost_events: fn(&$role) -> u32 = <$role>::lost_events;
            let event: Option<$event> = role.poll_event();
            assert_eq!(event, None);
            assert_eq!(*config(&role), $config::default());
            assert_eq!(*statistics(&role), $statistics::default());
            assert_eq!((counters(&role), lost_events(&role)), (Counters::default(), 0));
            // For a UART of the processor itself, and for one that hands bytes in late.
            let (direct, late) = ($config::direct(), $config::usb_adapter());
            assert_ne!(direct, late);
            assert!([direct, late].contains(&$config::default()));
            assert_eq!(direct.baud, late.baud);
        }
    )+};
}

speaks_the_common_words! {
    a_master_has_the_common_calls:
        Master = Master::new(MasterConfig::default(), NOW),
        MasterConfig, MasterEvent, MasterStatistics;
    a_slave_has_the_common_calls:
        Slave = Slave::new(NodeId::N1, Mode::Velocity, SlaveConfig::default(), NOW),
        SlaveConfig, SlaveEvent, SlaveStatistics;
    a_host_has_the_common_calls:
        Host = Host::new(HostConfig::default(), NOW),
        HostConfig, HostEvent, HostStatistics;
    a_robot_has_the_common_calls:
        Robot = Robot::new(RobotConfig::default(), NOW),
        RobotConfig, RobotEvent, RobotStatistics;
}

#[test]
fn what_commands_has_a_dead_man_and_what_obeys_has_a_watchdog() {
    let _: (Option<Duration>, Duration) =
        (MasterConfig::default().dead_man, HostConfig::default().dead_man);
    let _: (Option<Duration>, Duration) =
        (SlaveConfig::default().watchdog, RobotConfig::default().watchdog);
    let _: (Duration, Duration) =
        (HostConfig::default().idle_margin, RobotConfig::default().idle_margin);
    let _: (MasterEvent, HostEvent) = (MasterEvent::DeadMan, HostEvent::DeadMan);
    let _: (SlaveEvent, RobotEvent) = (SlaveEvent::Watchdog, RobotEvent::Watchdog);
    let dead_man = (MasterStatistics::default().dead_man, HostStatistics::default().dead_man);
    let watchdog = (SlaveStatistics::default().watchdog, RobotStatistics::default().watchdog);
    assert_eq!((dead_man, watchdog), ((0, 0), (0, 0)));
}
