//! `axle extcap`: what Wireshark runs to capture live.

use std::{
    fs::{self, File},
    io::{self, Read},
    process::Command,
    thread,
    time::Duration,
};

use super::{
    Process, TWO_NODES,
    record::{decoded, fresh},
    sim,
    support::axle,
};

/// A pipe of the name that Wireshark would choose.
fn fifo() -> String {
    let path = fresh("fifo");
    assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
    path
}

fn capture(port: &str, protocol: &str, fifo: &str) -> Process {
    Process::start(&format!(
        "extcap --capture --extcap-interface axle --port {port} --protocol {protocol} --baud 0 \
         --fifo {fifo}"
    ))
}

/// All that is written to the pipe until it is closed, in a file.
fn drained(fifo: &str) -> thread::JoinHandle<String> {
    let (fifo, path) = (fifo.to_owned(), fresh("live.pcapng"));
    thread::spawn(move || {
        io::copy(&mut File::open(fifo).unwrap(), &mut File::create(&path).unwrap()).unwrap();
        path
    })
}

#[test]
fn a_live_capture_has_every_frame_until_it_is_stopped() {
    let (_sim, port) = sim("ucp");
    let fifo = fifo();
    let reader = drained(&fifo);
    let capture = capture(&port, "ucp", &fifo);
    thread::sleep(Duration::from_millis(700));
    capture.signal("TERM");
    assert_eq!(capture.success(), Vec::<String>::new());
    let path = reader.join().unwrap();
    let (events, summary) = decoded(&path);
    let reports = events.iter().filter(|event| event["message"] == "report").count();
    assert!(reports > 10, "{reports} reports");
    assert_eq!(summary["skipped"], 0);
    // The name that Wireshark shows, and by which the dissector knows whose times they are.
    let file = fs::read(path).unwrap();
    assert!(file.windows(port.len()).any(|bytes| bytes == port.as_bytes()));
}

#[test]
fn a_capture_ends_well_when_wireshark_closes_the_pipe() {
    let (_sim, port) = sim("ucp");
    let fifo = fifo();
    let name = fifo.clone();
    let reader = thread::spawn(move || {
        let mut first = [0; 200];
        File::open(name).unwrap().read_exact(&mut first).unwrap();
    });
    let capture = capture(&port, "ucp", &fifo);
    reader.join().unwrap();
    assert_eq!(capture.success(), Vec::<String>::new());
}

#[test]
fn a_silent_line_has_the_head_of_its_capture_at_once() {
    let (_sim, port) = sim(TWO_NODES);
    let fifo = fifo();
    let capture = capture(&port, "ikeya", &fifo);
    let mut head = [0; 28];
    File::open(&fifo).unwrap().read_exact(&mut head).unwrap();
    assert_eq!(head[..4], [0x0A, 0x0D, 0x0D, 0x0A]);
    capture.signal("TERM");
    assert_eq!(capture.success(), Vec::<String>::new());
}

#[test]
fn a_capture_of_a_silent_line_ends_when_wireshark_closes_the_pipe() {
    let (_sim, port) = sim(TWO_NODES);
    let fifo = fifo();
    let capture = capture(&port, "ikeya", &fifo);
    let mut head = [0; 28];
    File::open(&fifo).unwrap().read_exact(&mut head).unwrap();
    assert_eq!(capture.success(), Vec::<String>::new());
}

#[test]
fn the_pipe_of_a_capture_that_fails_is_opened_and_closed() {
    let (_sim, port) = sim("ucp");
    for (settings, code) in [
        ("--extcap-interface eth0 --protocol ucp".to_owned(), 2),
        ("--extcap-interface axle-/dev/no-such-port --protocol ucp".to_owned(), 1),
        (format!("--extcap-interface axle-{port}"), 2),
        (format!("--extcap-interface axle-{port} --protocol modbus"), 2),
        (format!("--extcap-interface axle-{port} --protocol ucp --baud fast"), 2),
        (format!("--extcap-interface axle-{port} --protocol ucp --extcap-capture-filter tcp"), 2),
    ] {
        let fifo = fifo();
        let reader = drained(&fifo);
        let ended = Process::start(&format!("extcap --capture --fifo {fifo} {settings}")).end();
        assert_eq!((ended.code, ended.stderr.len()), (Some(code), 1), "{settings}: {ended:?}");
        assert_eq!(fs::read(reader.join().unwrap()).unwrap(), b"", "{settings}");
    }
}

#[test]
fn a_port_that_is_not_there_and_a_pipe_that_is_not_there_are_told() {
    let ended = capture("/dev/no-such-port", "ucp", "/no/such/pipe").end();
    assert_eq!(ended.code, Some(1));
    assert_eq!(ended.stderr.len(), 1, "{ended:?}");
    assert!(ended.stderr[0].contains("/dev/no-such-port"), "{ended:?}");

    let (_sim, port) = sim("ucp");
    let ended = capture(&port, "ucp", "/no/such/pipe").end();
    assert_eq!(ended.code, Some(1));
    let expected = "axle: cannot open \"/no/such/pipe\": No such file or directory (os error 2)";
    assert_eq!(ended.stderr, [expected]);
}

#[test]
fn a_signal_ends_the_wait_for_a_reader() {
    let (_sim, port) = sim("ucp");
    let capture = capture(&port, "ucp", &fifo());
    thread::sleep(Duration::from_millis(300));
    capture.signal("TERM");
    let ended = capture.end();
    assert_eq!((ended.code, ended.stdout.len(), ended.stderr.len()), (None, 0, 0), "{ended:?}");
}

#[test]
fn wireshark_is_told_the_interfaces_and_their_settings() {
    let lines = Process::start("extcap --extcap-interfaces --extcap-version=4.0").success();
    assert!(lines[0].starts_with("extcap {version="), "{lines:?}");
    assert_eq!(
        lines.last().unwrap(),
        "interface {value=axle}{display=Serial line of axle, any port}"
    );
    let lines = Process::start("extcap --extcap-interface axle --extcap-dlts").success();
    assert_eq!(lines.len(), 3);
    let lines = Process::start("extcap --extcap-interface axle --extcap-config").success();
    assert!(lines[0].starts_with("arg {number=0}{call=--port}"), "{lines:?}");
    let ended = Process::spawn(&mut axle(&["extcap"])).unwrap().end();
    assert_eq!((ended.code, ended.stderr.len()), (Some(2), 1), "{ended:?}");
}
