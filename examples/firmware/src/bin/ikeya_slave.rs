//! A slave of a motor bus with a simulated motor.
//!
//! Answers requests, turns as commanded, and stops half a second after the last command. Text port:
//! one line per second, and one for each received byte.

#![no_std]
#![no_main]

use axlewire::{
    drive::{Clock as _, Driver, Rs485},
    ikeya::{
        self, Mode, NodeId, Slave, Target,
        slave::{DipSwitch, IdReading, SlaveStatistics},
    },
    time::{Duration, Instant},
};
use axlewire_firmware::{
    board::Board, clock::milliseconds, motor::Motor, on_panic, serve_usarts, text_line::TextLine,
};

on_panic!();
serve_usarts!();

/// Replaces a board's four DIP switches: `0000` is node 1 in velocity mode (ruling I2).
const DIP: u8 = 0b0000;
const READING: IdReading = IdReading::ValuePlusOne;

/// Step of the motor model; the answers change with it.
const STEP: Duration = Duration::from_millis(5);

/// Interval between lines of text.
const REPORT: Duration = Duration::from_secs(1);

#[cortex_m_rt::entry]
fn main() -> ! {
    // The DIP constant is valid, and the board is taken only once.
    if let (Some(board), Ok(dip)) = (Board::take(ikeya::BAUD), DipSwitch::from_bits(DIP))
        && let Ok(node) = dip.node_id(READING)
    {
        run(board, node, dip.mode());
    }
    loop {
        cortex_m::asm::wfi();
    }
}

fn run(mut board: Board, node: NodeId, mode: Mode) {
    let config = board.configs.slave();
    let mut motor = Motor::new();
    let mut slave = Slave::new(node, mode, config, Instant::from_micros(0));
    slave.set_position(motor.position());
    let Ok(port) = Rs485::new(board.bus, board.driver_enable);
    let mut last = board.clock.now();
    let mut driver = Driver::new(slave, port, board.clock);
    let (mut report_at, mut stops) = (last, 0u32);
    loop {
        // Answers are sent in here, right after wake-up and before anything else. Neither the port
        // nor the pin can fail.
        let until = last + STEP;
        let _ = driver.run_for(until - driver.now(), |_, event, _| {
            if event == ikeya::slave::SlaveEvent::Watchdog {
                stops = stops.wrapping_add(1);
            }
        });
        let now = driver.now();
        let slave = driver.role_mut();
        motor.obey(slave.command(now), mode);
        motor.step(now - last);
        slave.set_velocity(motor.velocity());
        slave.set_position(motor.position());
        last = now;

        let asked = board.text.poll_byte().is_some();
        if asked || now >= report_at {
            let mut line = TextLine::new("slave");
            report(&mut line, slave, &motor, stops, now);
            line.count("stack", board.stack.used()).count("ms", milliseconds(now));
            // Requests that come faster than lines can be sent are dropped.
            board.text.try_send(line.end());
            if !asked {
                report_at = now + REPORT;
            }
        }
    }
}

/// All values that a test or a user may want to see.
fn report(line: &mut TextLine, slave: &Slave, motor: &Motor, stops: u32, now: Instant) {
    let SlaveStatistics { reads, writes, refused, foreign, replies, overtaken, expired, .. } =
        *slave.statistics();
    line.count("node", slave.node().get().into());
    match slave.command(now) {
        Some(Target::Velocity(to)) => line.thousandths("target_mrps", to.get()),
        Some(Target::Position(to)) => line.number("target_counts", to.counts()),
        None => line.word("target none"),
    }
    .thousandths("mrps", motor.velocity().get())
    .number("counts", motor.position().counts())
    .count("reads", reads)
    .count("writes", writes)
    .count("replies", replies)
    .count("refused", refused)
    .count("foreign", foreign)
    .count("overtaken", overtaken)
    .count("expired", expired)
    .count("stops", stops)
    .count("skipped", slave.counters().skipped() as u32)
    .bus_losses();
}
