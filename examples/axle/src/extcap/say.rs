//! The lines that Wireshark reads: `kind {key=value}{key=value}`.

use std::fmt::Write;

use clap::ValueEnum;
use serialport::{SerialPortInfo, SerialPortType};

use crate::{args::Protocol, pcapng};

/// The interface whose port is a setting.
pub(super) const ANY_PORT: &str = "axle";

/// What precedes the path of a port in the name of its interface.
pub(super) const PREFIX: &str = "axle-";

const PROTOCOLS: [Protocol; 3] = [Protocol::Ikeya, Protocol::Ikeya3, Protocol::Ucp];

/// The program, one interface for each port, and one for any other port.
pub(super) fn interfaces(out: &mut String, ports: &[SerialPortInfo]) {
    let version = env!("CARGO_PKG_VERSION");
    line(out, "extcap", &[("version", version), ("display", "axle")]);
    for port in ports {
        let (value, display) = (format!("{PREFIX}{}", port.port_name), title(port));
        line(out, "interface", &[("value", &value), ("display", &display)]);
    }
    let display = "Serial line of axle, any port";
    line(out, "interface", &[("value", ANY_PORT), ("display", display)]);
}

/// What the adapter is called, if it says so.
fn title(port: &SerialPortInfo) -> String {
    let product = match &port.port_type {
        SerialPortType::UsbPort(usb) => usb.product.as_deref(),
        _ => None,
    };
    product.map_or_else(|| "Serial line".to_owned(), |product| format!("Serial line, {product}"))
}

/// The link types of the protocols. The capture itself says which one it uses.
pub(super) fn link_types(out: &mut String) {
    for protocol in PROTOCOLS {
        let number = pcapng::link_type(protocol).to_string();
        let display = meaning(protocol);
        line(out, "dlt", &[("number", &number), ("name", protocol.name()), ("display", &display)]);
    }
}

/// The settings of a capture. `has_port` is for the interface whose port is one of them.
pub(super) fn settings(out: &mut String, has_port: bool) {
    if has_port {
        argument(
            out,
            &[
                ("number", "0"),
                ("call", "--port"),
                ("display", "Port"),
                ("tooltip", "Such as /dev/ttyUSB0 or COM3, or tcp:HOST:PORT"),
                ("type", "string"),
                ("required", "true"),
            ],
        );
    }
    argument(
        out,
        &[
            ("number", "1"),
            ("call", "--protocol"),
            ("display", "Protocol"),
            ("tooltip", "What the line carries"),
            ("type", "selector"),
            ("required", "true"),
        ],
    );
    for protocol in PROTOCOLS {
        let display = meaning(protocol);
        line(out, "value", &[("arg", "1"), ("value", protocol.name()), ("display", &display)]);
    }
    argument(
        out,
        &[
            ("number", "2"),
            ("call", "--baud"),
            ("display", "Line speed, bit/s"),
            ("tooltip", "0 is that of the protocol"),
            ("type", "unsigned"),
            ("range", "0,12000000"),
            ("default", "0"),
        ],
    );
}

/// The answer to a capture filter.
pub(super) fn no_filter(out: &mut String) {
    out.push_str("There are no capture filters: use a display filter.\n");
}

/// What `--help` says of a protocol.
fn meaning(protocol: Protocol) -> String {
    let help = protocol.to_possible_value().and_then(|value| Some(value.get_help()?.to_string()));
    help.unwrap_or_else(|| protocol.name().to_owned())
}

fn argument(out: &mut String, values: &[(&str, &str)]) {
    line(out, "arg", values);
}

/// Removes braces and control characters, which would end a value or the line.
fn line(out: &mut String, kind: &str, values: &[(&str, &str)]) {
    out.push_str(kind);
    out.push(' ');
    for (key, value) in values {
        let clean = |c: char| if c.is_control() || matches!(c, '{' | '}') { ' ' } else { c };
        let value: String = value.chars().map(clean).collect();
        // A string takes all.
        let _ = write!(out, "{{{key}={value}}}");
    }
    out.push('\n');
}
