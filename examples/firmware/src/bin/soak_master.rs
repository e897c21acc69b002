//! The master of a motor bus as fast as the line allows, for `soak.sh`: turns node 1, reads it
//! again and again, and prints its counts once a second.
//!
//! A strike is a READ whose answer did not come in time; three in a row make the node abnormal.

#![no_std]
#![no_main]

use axlewire::{
    drive::{Clock as _, Driver, Rs485},
    ikeya::{
        self, Master, NodeId, Rps,
        master::{Health, MasterEvent, Polling},
    },
    time::Duration,
};
use axlewire_firmware::{
    board::Board, clock::milliseconds, on_panic, serve_usarts, text_line::TextLine,
};

on_panic!();
serve_usarts!();

/// The node, and its speed, rps.
const NODE: NodeId = NodeId::N1;
const SPEED: f32 = 2.0;

/// Interval between lines of text.
const REPORT: Duration = Duration::from_secs(1);

#[cortex_m_rt::entry]
fn main() -> ! {
    if let Some(board) = Board::take(ikeya::BAUD) {
        run(board);
    }
    loop {
        cortex_m::asm::wfi();
    }
}

fn run(mut board: Board) {
    let mut config = board.configs.master();
    config.nodes = [NODE].into_iter().collect();
    config.polling = Polling::Fastest;
    let Ok(port) = Rs485::new(board.bus, board.driver_enable);
    let mut report_at = board.clock.now();
    let mut driver = Driver::master(config, port, board.clock);
    let (mut exchanges, mut abnormal) = (0u32, 0u32);
    let now = driver.now();
    driver.role_mut().discover(now);
    loop {
        // Neither the port nor the pin can fail.
        if let Ok(Some(event)) = driver.next_event(report_at - driver.now()) {
            let now = driver.now();
            match event {
                MasterEvent::Status { .. } => exchanges = exchanges.wrapping_add(1),
                MasterEvent::Health { health: Health::Abnormal, .. } => {
                    abnormal = abnormal.wrapping_add(1);
                }
                MasterEvent::Discovered { node, .. } | MasterEvent::Stopped { node } => {
                    let speed = Rps::new(SPEED).unwrap_or(Rps::ZERO);
                    // Refused only if the node is gone again.
                    let _ = driver.role_mut().set_velocity(node, speed, now);
                }
                MasterEvent::DiscoveryDone { online: 0 } => driver.role_mut().discover(now),
                _ => {}
            }
        }
        let asked = board.text.poll_byte().is_some();
        let now = driver.now();
        if asked || now >= report_at {
            let mut line = TextLine::new("master");
            report(&mut line, driver.role(), exchanges);
            line.count("abnormal", abnormal).bus_losses().count("ms", milliseconds(now));
            board.text.try_send(line.end());
            if !asked {
                report_at = now + REPORT;
            }
        }
    }
}

/// Everything that has to add up.
fn report(line: &mut TextLine, master: &Master, exchanges: u32) {
    let (all, node) = (master.statistics(), master.node_statistics(NODE));
    let counters = master.counters();
    line.count("reads", all.reads)
        .count("writes", all.writes)
        .count("requests", node.requests)
        .count("replies", node.replies)
        .count("strikes", node.timeouts)
        .count("crc_errors", node.crc_errors)
        .count("late", node.late)
        .count("early", node.early)
        .count("exchanges", exchanges)
        .count("lost_events", master.lost_events())
        .count("stale", all.stale_bytes)
        .count("received", counters.received as u32)
        .count("framed", counters.framed as u32)
        .count("skipped", counters.skipped() as u32);
}
