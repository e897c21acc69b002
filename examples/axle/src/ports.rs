//! `axle ports`: lists the serial ports of this machine.

use std::{
    fmt,
    io::{self, Write},
};

use serde::Serialize;
use serialport::{SerialPortInfo, SerialPortType};

use crate::{failure::Failure, help::EXIT_CODES, report::Form};

/// List the serial ports of this machine
///
/// For a USB adapter also its vendor and product id, and its names and serial number where the
/// system knows them. Opens no port. Pseudo-terminals are not listed. Finding no port is not a
/// failure.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    /// Print one JSON object per line
    #[arg(short, long)]
    json: bool,
}

/// One line of output.
#[derive(Debug, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Record {
    Port {
        path: String,
        /// Kind of its connection: usb, pci, bluetooth or unknown.
        connection: &'static str,
        #[serde(flatten)]
        usb: Option<Usb>,
    },
    Summary {
        ports: usize,
    },
}

/// What a USB adapter says about itself.
#[derive(Debug, PartialEq, Serialize)]
struct Usb {
    /// Four hex digits each.
    vendor_id: String,
    product_id: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    manufacturer: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    product: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    serial_number: Option<String>,
}

impl From<SerialPortInfo> for Record {
    fn from(info: SerialPortInfo) -> Self {
        let path = info.port_name;
        match info.port_type {
            SerialPortType::UsbPort(usb) => {
                let usb = Usb {
                    vendor_id: format!("{:04x}", usb.vid),
                    product_id: format!("{:04x}", usb.pid),
                    manufacturer: usb.manufacturer,
                    product: usb.product,
                    serial_number: usb.serial_number,
                };
                Self::Port { path, connection: "usb", usb: Some(usb) }
            }
            SerialPortType::PciPort => Self::Port { path, connection: "pci", usb: None },
            SerialPortType::BluetoothPort => {
                Self::Port { path, connection: "bluetooth", usb: None }
            }
            SerialPortType::Unknown => Self::Port { path, connection: "unknown", usb: None },
        }
    }
}

impl fmt::Display for Record {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Port { path, connection, usb } => {
                write!(f, "{path:<20}  {connection}")?;
                let Some(usb) = usb else { return Ok(()) };
                write!(f, " {}:{}", usb.vendor_id, usb.product_id)?;
                for name in [&usb.manufacturer, &usb.product].into_iter().flatten() {
                    write!(f, "  {}", name.escape_debug())?;
                }
                match &usb.serial_number {
                    Some(number) => write!(f, "  serial number {}", number.escape_debug()),
                    None => Ok(()),
                }
            }
            Self::Summary { ports: 0 } => f.write_str("No serial ports."),
            Self::Summary { ports: 1 } => f.write_str("1 serial port."),
            Self::Summary { ports } => write!(f, "{ports} serial ports."),
        }
    }
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let ports = available()?;
    let summary = Record::Summary { ports: ports.len() };
    let (form, mut out) = (Form::of(args.json), io::stdout().lock());
    for record in ports.into_iter().map(Record::from).chain([summary]) {
        writeln!(out, "{}", form.plain(&record)).map_err(Failure::Write)?;
    }
    out.flush().map_err(Failure::Write)
}

/// The ports of this machine, by name.
pub(crate) fn available() -> Result<Vec<SerialPortInfo>, Failure> {
    let mut ports = serialport::available_ports()
        .map_err(|error| Failure::Failed(format!("cannot list the ports: {error}")))?;
    ports.sort_by(|a, b| a.port_name.cmp(&b.port_name));
    Ok(ports)
}

#[cfg(test)]
mod tests {
    use serialport::UsbPortInfo;

    use super::*;

    fn port(port_type: SerialPortType) -> Record {
        Record::from(SerialPortInfo { port_name: "/dev/ttyUSB0".to_owned(), port_type })
    }

    fn adapter() -> UsbPortInfo {
        UsbPortInfo {
            vid: 0x0403,
            pid: 0x6001,
            serial_number: Some("A5\n".to_owned()),
            manufacturer: Some("FTDI".to_owned()),
            product: None,
        }
    }

    #[test]
    fn a_usb_adapter_is_listed_with_its_ids_on_one_line() {
        let record = port(SerialPortType::UsbPort(adapter()));
        let expected = r"/dev/ttyUSB0          usb 0403:6001  FTDI  serial number A5\n";
        assert_eq!(record.to_string(), expected);
        let expected = concat!(
            r#"{"event":"port","path":"/dev/ttyUSB0","connection":"usb","vendor_id":"0403","#,
            r#""product_id":"6001","manufacturer":"FTDI","serial_number":"A5\n"}"#
        );
        assert_eq!(Form::Json.plain(&record), expected);
    }

    #[test]
    fn other_ports_are_listed_with_their_connection() {
        for (kind, name) in [
            (SerialPortType::PciPort, "pci"),
            (SerialPortType::BluetoothPort, "bluetooth"),
            (SerialPortType::Unknown, "unknown"),
        ] {
            let record = port(kind);
            assert_eq!(record.to_string(), format!("/dev/ttyUSB0          {name}"));
            let expected =
                format!(r#"{{"event":"port","path":"/dev/ttyUSB0","connection":"{name}"}}"#);
            assert_eq!(Form::Json.plain(&record), expected);
        }
    }

    #[test]
    fn the_summary_counts_the_ports() {
        let texts = [0, 1, 2].map(|ports| Record::Summary { ports }.to_string());
        assert_eq!(texts, ["No serial ports.", "1 serial port.", "2 serial ports."]);
    }
}
