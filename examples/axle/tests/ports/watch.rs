//! `axle watch`: shows the traffic on a line, without sending anything.

use super::{Process, played::parrot, sim, undisturbed};

#[test]
fn watch_counts_the_messages_of_a_rover() {
    undisturbed(|| {
        let (sim, port) = sim("ucp");
        let watch = Process::start(&format!("watch --port {port} --protocol ucp"));
        let line = watch.line("id 5 report");
        assert!(line.contains("skipped 0") || line.contains(", 0 skipped"), "{line}");
        watch.signal("INT");
        let lines = watch.success();
        let row =
            lines.iter().find(|line| line.starts_with("   5  report")).expect("the last table");
        assert!(row.contains("battery  99 %") || row.contains("battery 100 %"), "{row}");
        assert!(lines.last().unwrap().contains("0 skipped"), "{lines:?}");
        drop(sim);
    });
}

#[test]
fn watch_sends_nothing_and_names_the_noise() {
    undisturbed(|| {
        let line = parrot(&[]);
        let mut watch = vec![];
        for protocol in ["ikeya", "ikeya-3"] {
            let process =
                Process::start(&format!("watch --port {} --protocol {protocol}", line.path));
            process.line("0 bytes");
            process.signal("INT");
            watch.extend(process.success());
        }
        assert!(watch.last().unwrap().starts_with("Nothing was heard"), "{watch:?}");
        assert!(line.lock().is_empty());

        let (sim, port) = sim("ucp --noise 0.01");
        let watch = Process::start(&format!("watch --port {port} --protocol ucp"));
        watch.line("crc ");
        sim.kill();
        let ended = watch.end();
        assert_eq!((ended.code, ended.stderr.len()), (Some(1), 1), "{ended:?}");
        assert!(ended.stderr[0].contains("disconnected"), "{ended:?}");
        let is_summed_up = ended.stdout.iter().any(|line| line.contains(" skipped: "));
        assert!(is_summed_up, "what was heard is not lost: {ended:?}");
    });
}
