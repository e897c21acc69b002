//! `axle extcap`: live capture for Wireshark, in the protocol that it speaks with such programs.
//!
//! Wireshark asks for the interfaces, for the link types and the settings of one, and then runs the
//! capture, which writes pcapng to a pipe until a signal stops it or the pipe is closed.
//! Requests come as arguments, and the answers are lines on standard output.

mod say;

use std::{
    fs::File,
    io::{self, Write},
    mem,
    path::{Path, PathBuf},
};

use clap::ValueEnum;

use crate::{
    args::Protocol, failure::Failure, help::EXIT_CODES, line::Line, pcapng::Recording, ports,
    record::record_line, signals::Signals,
};
use say::{ANY_PORT, PREFIX};

/// Live capture for Wireshark, which runs this itself
///
/// examples/wireshark/install.sh makes the serial ports of this machine interfaces of Wireshark and
/// tshark. One more interface, `axle`, has the port as a setting, for pseudo-terminals and tcp:. A
/// capture is that of `axle record`, and sends nothing. Its times are those at which this program
/// got the bytes from the system; behind a USB adapter, that can be 16 ms after they were on the
/// line.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    /// List the interfaces
    #[arg(long)]
    extcap_interfaces: bool,

    /// The interface to which the other options apply
    #[arg(long, value_name = "NAME")]
    extcap_interface: Option<String>,

    /// List the link types of an interface
    #[arg(long)]
    extcap_dlts: bool,

    /// List the settings of an interface
    #[arg(long)]
    extcap_config: bool,

    /// Capture
    #[arg(long)]
    capture: bool,

    /// The pipe to write to
    #[arg(long, value_name = "PATH")]
    fifo: Option<PathBuf>,

    /// Version of Wireshark; it makes no difference
    #[arg(long, value_name = "VERSION")]
    extcap_version: Option<String>,

    /// A capture filter; not supported, use display filters
    #[arg(long, value_name = "FILTER")]
    extcap_capture_filter: Option<String>,

    /// The port, for the interface `axle`: such as /dev/ttyUSB0 or COM3; or tcp:HOST:PORT
    #[arg(short, long, value_name = "PATH")]
    port: Option<String>,

    /// Line speed, bit/s; 0 is that of the protocol
    // Text, like the protocol: a bad value is a failure that the pipe must be told.
    #[arg(short, long, value_name = "BAUD", default_value = "0")]
    baud: String,

    /// Protocol of the line: ucp, ikeya or ikeya-3
    #[arg(short = 'P', long, value_name = "PROTOCOL")]
    protocol: Option<String>,
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let mut text = String::new();
    if args.extcap_interfaces {
        // Without a list, the interface for any port is left.
        say::interfaces(&mut text, &ports::available().unwrap_or_default());
    } else if args.extcap_dlts {
        args.known_interface()?;
        say::link_types(&mut text);
    } else if args.extcap_config {
        say::settings(&mut text, args.known_interface()? == ANY_PORT);
    } else if args.capture {
        return capture(args);
    } else if args.filter().is_some() {
        // Wireshark asks whether it is valid, and treats any answer as "no".
        say::no_filter(&mut text);
    } else {
        let line = "one of --extcap-interfaces, --extcap-dlts, --extcap-config and --capture is \
                    needed: Wireshark runs this subcommand itself";
        return Err(Failure::Usage(line.to_owned()));
    }
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::Write)
}

impl Args {
    fn interface(&self) -> Result<&str, Failure> {
        self.extcap_interface.as_deref().ok_or_else(|| needs("--extcap-interface"))
    }

    fn filter(&self) -> Option<&str> {
        self.extcap_capture_filter.as_deref().filter(|filter| !filter.trim().is_empty())
    }

    /// The interface, if its name is one of ours.
    fn known_interface(&self) -> Result<&str, Failure> {
        let interface = self.interface()?;
        if interface == ANY_PORT || interface.strip_prefix(PREFIX).is_some_and(|it| !it.is_empty())
        {
            return Ok(interface);
        }
        let line = format!("there is no interface {interface:?}: see --extcap-interfaces");
        Err(Failure::Usage(line))
    }

    /// The port of the interface.
    fn port(&self) -> Result<&str, Failure> {
        match self.known_interface()?.strip_prefix(PREFIX) {
            Some(port) => Ok(port),
            None => self
                .port
                .as_deref()
                .filter(|port| !port.is_empty())
                .ok_or_else(|| needs("the setting Port (--port)")),
        }
    }

    /// The setting of the protocol.
    fn protocol(&self) -> Result<Protocol, Failure> {
        let name =
            self.protocol.as_deref().ok_or_else(|| needs("the setting Protocol (--protocol)"))?;
        Protocol::from_str(name, false).map_err(|_| {
            let line = format!("there is no protocol {name:?}: ucp, ikeya or ikeya-3");
            Failure::Usage(line)
        })
    }

    /// The setting of the speed, bit/s.
    fn baud(&self, protocol: Protocol) -> Result<u32, Failure> {
        match self.baud.parse() {
            Ok(0) => Ok(protocol.default_baud()),
            Ok(baud) => Ok(baud),
            Err(error) => {
                let line = format!("the line speed {:?}: {error}", self.baud);
                Err(Failure::Usage(line))
            }
        }
    }
}

fn needs(what: &str) -> Failure {
    Failure::Usage(format!("{what} is needed"))
}

fn capture(args: &Args) -> Result<(), Failure> {
    let prepared = prepare(args);
    if let (Err(_), Some(fifo)) = (&prepared, &args.fifo) {
        // Wireshark waits until something has opened the pipe and closed it again. It is closed
        // with the process, once the failure is told.
        mem::forget(File::options().write(true).open(fifo));
    }
    let (line, fifo, protocol, baud) = prepared?;
    // Waits for a reader; a signal ends the process then, because nothing listens yet.
    let file = Recording::to_pipe(fifo, protocol, line.path(), baud)?;
    let signals = Signals::listen()?;
    record_line(line, file, None, &signals).outcome
}

/// The open line, the pipe, the protocol and the speed.
fn prepare(args: &Args) -> Result<(Line, &Path, Protocol, u32), Failure> {
    let port = args.port()?;
    let fifo = args.fifo.as_deref().ok_or_else(|| needs("--fifo"))?;
    let protocol = args.protocol()?;
    if let Some(filter) = args.filter() {
        let line = format!("no capture filters, such as {filter:?}: use a display filter");
        return Err(Failure::Usage(line));
    }
    let baud = args.baud(protocol)?;
    Ok((Line::connect(port, baud)?, fifo, protocol, baud))
}

#[cfg(test)]
mod tests;
