//! Drivers, readers and writers over ports that fail, end, stall and stutter, in virtual time:
//! nothing is lost, nothing hangs, every error is specific, and everything that is told to stop
//! does stop.

#![cfg(all(feature = "ikeya", feature = "std", feature = "sim"))]
#![cfg(feature = "embedded-io-async")]

#[path = "../harness/dice.rs"]
#[allow(dead_code, reason = "others use more of it")]
mod dice;
#[path = "../harness/port.rs"]
#[allow(dead_code, reason = "others use more of it")]
mod port;
#[cfg(all(unix, feature = "serialport"))]
#[path = "../harness/tty.rs"]
#[allow(dead_code, reason = "ptys uses more of it")]
mod tty;

#[macro_use]
mod rig;
#[cfg_attr(not(feature = "ucp"), allow(dead_code, reason = "a rover uses more of it"))]
mod motor_line;
mod pin;
mod recorder;

mod bus;
mod clocks;
mod cut_off_packets;
mod errors;
mod every_call;
#[cfg(feature = "ucp")]
mod every_rover_call;
mod exact_waits;
mod failed_and_dropped_calls;
mod failing_ports;
mod half_ports;
mod held_requests;
mod held_up;
#[cfg(feature = "ucp")]
mod io;
mod late_slaves;
mod outdated_orders;
mod parts;
mod paused_packets;
mod pin_alone;
mod pin_in_a_driver;
mod rounds;
#[cfg(feature = "ucp")]
mod rover;
#[cfg(feature = "ucp")]
mod rover_faults;
#[cfg(feature = "ucp")]
mod rover_host;
#[cfg(feature = "ucp")]
#[path = "../harness/rover_rig.rs"]
#[allow(dead_code, unused_imports, unused_macros, reason = "host and robot use more of it")]
mod rover_rig;
#[cfg(feature = "ucp")]
mod rover_robot;
#[cfg(feature = "ucp")]
mod rover_standstill;
#[cfg(all(unix, feature = "serialport"))]
mod serial_port;
mod slow_port;
#[cfg(feature = "ucp")]
mod stale_looks;
mod stalled_ports;
mod stops;
mod two_wires;
mod unsent_frames;
mod waiting;
mod waking;
mod withdrawn;
mod wrong_clocks;
