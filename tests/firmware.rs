//! The roles on a Cortex-M4: the programs of `examples/firmware` in QEMU, against the roles on this
//! machine and against each other, over sockets and in real time.
//!
//! Order and content are asserted, never durations: QEMU shares this machine with other work. Waits
//! end after 30 s. If the machine halts QEMU for 100 ms inside a packet, the packet is lost, as on
//! a real line; so one test runs at a time, and a test that fails while the machine was busy is run
//! again.
//!
//! Needs QEMU and a compiler for thumbv7em; see `examples/firmware/README.md`. Without them the
//! tests say so and pass, unless `AXLEWIRE_FIRMWARE=required` is set. An image that cannot be built
//! fails them.

#![cfg(all(unix, feature = "ikeya", feature = "ucp", feature = "sim"))]

/// How the programs configure their roles: the file of the firmware.
#[path = "../examples/firmware/src/config.rs"]
#[allow(unreachable_pub, reason = "public in the firmware")]
mod config;
/// What the firmware counts.
#[path = "firmware/counts.rs"]
mod counts;
/// The driver-enable pin, from the log of QEMU.
#[path = "firmware/driver_enable_pin.rs"]
mod driver_enable_pin;
/// The firmware master.
#[path = "firmware/master.rs"]
mod master;
/// What they use of the library.
#[path = "firmware/names.rs"]
mod names;
/// The firmware on a noisy wire.
#[path = "firmware/noise.rs"]
mod noise;
/// What the programs do that QEMU cannot show.
#[path = "firmware/programs.rs"]
mod programs;
/// A board in QEMU.
#[path = "firmware/qemu.rs"]
mod qemu;
/// What a line of text tells of a role: the file of the firmware.
#[path = "../examples/firmware/src/report.rs"]
#[allow(unreachable_pub, reason = "public in the firmware")]
mod report;
/// The firmware robot.
#[path = "firmware/robot.rs"]
mod robot;
/// The registers that the firmware sets up.
#[path = "firmware/setup.rs"]
mod setup;
/// The firmware slave.
#[path = "firmware/slave.rs"]
mod slave;
/// A line of text: the file of the firmware.
#[path = "../examples/firmware/src/text_line.rs"]
#[allow(unreachable_pub, dead_code, reason = "public in the firmware")]
mod text_line;
/// The USART of the firmware.
#[path = "firmware/uart.rs"]
mod uart;
/// The wire to a board.
#[path = "firmware/wire.rs"]
mod wire;
