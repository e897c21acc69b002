//! Ports behind a TCP server that passes the bytes on as they are, as ser2net's `raw` does.

use std::{
    io::{Read, Write},
    net::{Shutdown, TcpListener, TcpStream},
    sync::mpsc::{self, Sender},
    thread,
    time::Duration,
};

use serialport::{SerialPort, TTYPort};

use super::{Process, TWO_NODES, sim};

/// A server for one connection at a time to a serial port. It closes the connection when it is told
/// to, and takes the next one after that time, if ever.
struct Server {
    address: String,
    close: Sender<Option<Duration>>,
}

impl Server {
    fn start(port: &str) -> Self {
        let mut tty = TTYPort::open(&serialport::new(port, 500_000)).unwrap();
        tty.set_timeout(Duration::from_millis(1)).unwrap();
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("tcp:{}", listener.local_addr().unwrap());
        let (close, closed) = mpsc::channel();
        thread::spawn(move || {
            'next: loop {
                let mut stream: TcpStream = listener.accept().unwrap().0;
                stream.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
                let mut buffer = [0; 256];
                loop {
                    if let Ok(pause) = closed.try_recv() {
                        stream.shutdown(Shutdown::Both).unwrap();
                        let Some(pause) = pause else { return };
                        thread::sleep(pause);
                        continue 'next;
                    }
                    match stream.read(&mut buffer) {
                        Ok(0) => break,
                        Ok(len) => tty.write_all(&buffer[..len]).unwrap(),
                        Err(_) => {}
                    }
                    let len = tty.read(&mut buffer).unwrap_or(0);
                    if stream.write_all(&buffer[..len]).is_err() {
                        break;
                    }
                }
            }
        });
        Self { address, close }
    }
}

#[test]
fn a_port_of_a_tcp_server_is_a_port() {
    let (sim, port) = sim(TWO_NODES);
    let server = Server::start(&port);
    let scan = Process::start(&format!("scan --port {}", server.address)).success();
    assert_eq!(scan.last().unwrap(), "2 nodes answer.", "{scan:?}");
    let spin = format!("spin --port {} --node 1 --rps 2 --for 1", server.address);
    let lines = Process::start(&spin).success();
    assert!(lines.last().unwrap().ends_with("stopped and confirmed"), "{lines:?}");
    sim.line("node 1: command 2.00 rps");
    sim.line("node 1: at rest");
}

#[test]
fn a_tcp_server_that_goes_away_is_told_with_what_may_be_moving() {
    let (sim, port) = sim(TWO_NODES);
    let server = Server::start(&port);
    let spin = Process::start(&format!("spin -p {} --node 1 --rps 2 --for 600", server.address));
    sim.line("node 1: command 2.00 rps");
    server.close.send(None).unwrap();
    let error = spin.complaint(1);
    let lost = format!("port {:?} failed: disconnected (", server.address);
    assert!(error.starts_with(&lost) && error.ends_with("it may be moving"), "{error}");
}

#[test]
fn a_tcp_server_that_closes_the_connection_and_takes_another_is_told_and_what_moves_is_stopped() {
    let (bus, rover) = ("spin --node 1 --rps 2", "drive --speed 50");
    for (device, command, moves, rests, pauses) in [
        (TWO_NODES, bus, "node 1: command 2.00 rps", "node 1: at rest", [0, 500]),
        ("ucp", rover, "command: speed 50 %, turn 0 %", "at rest after", [0, 3000]),
    ] {
        for pause in pauses {
            let (sim, port) = sim(device);
            let server = Server::start(&port);
            let process = Process::start(&format!("{command} --for 600 -p {}", server.address));
            sim.line(moves);
            server.close.send(Some(Duration::from_millis(pause))).unwrap();
            let error = process.complaint(1);
            let lost = format!("port {:?} failed: disconnected (", server.address);
            assert!(error.starts_with(&lost), "{error}");
            assert!(error.ends_with("; it was stopped and is at rest"), "{error}");
            sim.line(rests);
        }
    }
}

#[test]
fn a_tcp_server_that_is_not_there_is_named() {
    // A port that was free a moment ago.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp:{}", listener.local_addr().unwrap());
    drop(listener);
    let error = Process::start(&format!("scan -p {address}")).complaint(1);
    assert!(error.starts_with(&format!("cannot use port {address:?}: ")), "{error}");
    for (port, why) in [("tcp:nowhere", ""), ("tcp:127.0.0.1", ""), ("tcp:127.0.0.1:x", "")] {
        let error = Process::start(&format!("scan -p {port}")).complaint(1);
        assert!(error.starts_with(&format!("cannot use port {port:?}: {why}")), "{error}");
    }
}
