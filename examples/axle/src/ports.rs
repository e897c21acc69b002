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
                write!(f, "{:<20}  {connection}", path.escape_debug().to_string())?;
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

/// The ports as lines for people who do not own them: without serial numbers.
pub(crate) fn without_serial_numbers(ports: Vec<SerialPortInfo>) -> Vec<String> {
    let line = |mut info: SerialPortInfo| {
        info.port_name = short_name(&info.port_name);
        if let SerialPortType::UsbPort(usb) = &mut info.port_type {
            let number = usb.serial_number.take().filter(|number| !number.is_empty());
            for name in [&mut usb.manufacturer, &mut usb.product] {
                name.take_if(|name| number.as_ref().is_some_and(|it| name.contains(it)));
            }
        }
        Record::from(info).to_string()
    };
    ports.into_iter().map(line).collect()
}

/// The last part of a path, up to what is neither a letter nor a digit: some systems and links put
/// the serial number of an adapter behind that, or the name of a person or a machine.
pub(crate) fn short_name(port: &str) -> String {
    let name = port.rsplit(['/', '\\']).next().unwrap_or_default();
    name.chars().take_while(char::is_ascii_alphanumeric).take(32).collect()
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

    #[test]
    fn for_others_a_port_has_no_serial_number_no_owner_and_no_control_sequence() {
        let bad = |text: &str| Some(text.to_owned());
        let (serial_number, manufacturer) = (bad("A5\x1b7"), bad("F\x1b[2J\nTDI"));
        let product = bad("UART A5\x1b7");
        let usb = UsbPortInfo { serial_number, manufacturer, product, ..adapter() };
        let ports = [
            ("/dev/cu.usbserial-A5\x1b7", SerialPortType::UsbPort(usb)),
            ("/dev/cu.Janes-iPhone", SerialPortType::BluetoothPort),
            ("\x1b[2J", SerialPortType::Unknown),
            ("COM3", SerialPortType::Unknown),
        ];
        let ports =
            ports.map(|(name, port_type)| SerialPortInfo { port_name: name.to_owned(), port_type });
        let expected = [
            r"cu                    usb 0403:6001  F\u{1b}[2J\nTDI",
            "cu                    bluetooth",
            "                      unknown",
            "COM3                  unknown",
        ];
        assert_eq!(without_serial_numbers(ports.into()), expected);
        assert_eq!(short_name("tcp:jane.example:2000"), "tcp");
    }
}
