//! A port that disappears while a subcommand uses it: one line, exit code 1, and nothing is lost
//! that was received.

use super::{
    Process, TWO_NODES,
    record::fresh,
    sim,
    support::{file, pcapng::PcapNg},
};

#[test]
fn a_port_that_disappears_ends_each_subcommand_with_one_line() {
    let ping = axlewire::ucp::Body::frame(axlewire::ucp::message::Ping {}, 0);
    let packets = [(0, 2, ping.as_bytes()), (600_000_000, 2, ping.as_bytes())];
    let capture = file("gone.pcapng", &PcapNg::new(149, &packets).0);
    let capture = capture.to_str().unwrap();
    let recording = fresh("gone.pcapng");
    // What its simulation says when it is in use, or what it prints itself.
    let cases = [
        ("ucp", format!("record -P ucp -o {recording} -p PORT"), ""),
        ("ucp", "watch --plain --protocol ucp -p PORT".to_owned(), "report"),
        ("ucp", "ping --for 600 -p PORT".to_owned(), "ms"),
        ("ucp", "send -p PORT --for 600 ucp ping".to_owned(), "pong"),
        ("ucp", format!("replay {capture} --longest-pause 600 -p PORT"), "pong"),
        (TWO_NODES, "send -p PORT --for 600 ikeya read 1".to_owned(), "velocity_response"),
        (TWO_NODES, "watch --json --protocol ikeya -p PORT".to_owned(), "{"),
    ];
    for (simulated, args, says) in cases {
        let (sim, port) = sim(simulated);
        let process = Process::start(&args.replace("PORT", &port));
        if says.is_empty() {
            super::wait_until("a kilobyte", || {
                std::fs::metadata(&recording).is_ok_and(|file| file.len() > 1000)
            });
        } else {
            process.line(says);
        }
        sim.kill();
        let error = process.complaint(1);
        let lost = format!("port {port:?} failed: disconnected");
        assert!(error.starts_with(&lost), "{args}: {error}");
    }
}
