use serialport::{SerialPortInfo, SerialPortType, UsbPortInfo};

use super::*;

fn port(port_name: &str, port_type: SerialPortType) -> SerialPortInfo {
    SerialPortInfo { port_name: port_name.to_owned(), port_type }
}

fn adapter(product: &str) -> SerialPortType {
    SerialPortType::UsbPort(UsbPortInfo {
        vid: 0x0403,
        pid: 0x6001,
        serial_number: None,
        manufacturer: None,
        product: Some(product.to_owned()),
    })
}

fn said(say: impl FnOnce(&mut String)) -> String {
    let mut text = String::new();
    say(&mut text);
    text
}

/// The arguments as the tool reads them.
fn args(line: &str) -> Args {
    use clap::{CommandFactory, FromArgMatches};
    let words = ["axle", "extcap"].into_iter().chain(line.split_whitespace());
    let matches = crate::command::Cli::command().try_get_matches_from(words).unwrap();
    match crate::command::Cli::from_arg_matches(&matches).unwrap().command {
        crate::command::Command::Extcap(args) => args,
        other => panic!("{other:?}"),
    }
}

fn refusal(line: &str) -> String {
    match run(&args(line)).unwrap_err() {
        Failure::Usage(line) => line,
        other => panic!("{other:?}"),
    }
}

#[test]
fn each_port_is_an_interface_and_one_more_is_for_any_port() {
    let ports = [
        port("/dev/ttyS0", SerialPortType::Unknown),
        port("/dev/ttyUSB0", adapter("FT232R {USB}\nUART")),
    ];
    let version = env!("CARGO_PKG_VERSION");
    let expected = format!(
        "extcap {{version={version}}}{{display=axle}}\n\
         interface {{value=axle-/dev/ttyS0}}{{display=Serial line}}\n\
         interface {{value=axle-/dev/ttyUSB0}}{{display=Serial line, FT232R  USB  UART}}\n\
         interface {{value=axle}}{{display=Serial line of axle, any port}}\n"
    );
    assert_eq!(said(|out| say::interfaces(out, &ports)), expected);
}

#[test]
fn the_link_types_are_those_of_the_recordings() {
    let expected = "\
dlt {number=147}{name=ikeya}{display=Motor bus, one motor per board}
dlt {number=148}{name=ikeya-3}{display=Motor bus, three motors per board}
dlt {number=150}{name=ucp}{display=Link between the Linux board and the robot of a rover}
";
    assert_eq!(said(say::link_types), expected);
}

#[test]
fn the_port_is_a_setting_of_one_interface_only() {
    let common = "\
arg {number=1}{call=--protocol}{display=Protocol}{tooltip=What the line carries}{type=selector}{required=true}
value {arg=1}{value=ikeya}{display=Motor bus, one motor per board}
value {arg=1}{value=ikeya-3}{display=Motor bus, three motors per board}
value {arg=1}{value=ucp}{display=Link between the Linux board and the robot of a rover}
arg {number=2}{call=--baud}{display=Line speed, bit/s}{tooltip=0 is that of the protocol}{type=unsigned}{range=0,12000000}{default=0}
";
    assert_eq!(said(|out| say::settings(out, false)), common);
    let port = "arg {number=0}{call=--port}{display=Port}\
                {tooltip=Such as /dev/ttyUSB0 or COM3, or tcp:HOST:PORT}{type=string}{required=true}\n";
    assert_eq!(said(|out| say::settings(out, true)), format!("{port}{common}"));
}

#[test]
fn the_port_of_an_interface_is_in_its_name_or_in_the_setting() {
    let port =
        |line: &str| args(line).port().map(ToOwned::to_owned).map_err(|error| error.to_string());
    assert_eq!(port("--extcap-interface axle-/dev/ttyUSB0"), Ok("/dev/ttyUSB0".to_owned()));
    assert_eq!(port("--extcap-interface axle --port tcp:a:1"), Ok("tcp:a:1".to_owned()));
    let expected = Err("the setting Port (--port) is needed".to_owned());
    assert_eq!(port("--extcap-interface axle"), expected);
    for name in ["eth0", "axle-"] {
        let expected = format!("there is no interface {name:?}: see --extcap-interfaces");
        assert_eq!(port(&format!("--extcap-interface {name}")), Err(expected));
    }
}

#[test]
fn what_is_missing_for_a_capture_is_named() {
    assert_eq!(refusal("--extcap-dlts"), "--extcap-interface is needed");
    assert_eq!(refusal("--extcap-config"), "--extcap-interface is needed");
    for question in ["--extcap-config", "--extcap-dlts"] {
        let expected = "there is no interface \"eth0\": see --extcap-interfaces";
        assert_eq!(refusal(&format!("{question} --extcap-interface eth0")), expected);
    }
    assert_eq!(refusal("--capture"), "--extcap-interface is needed");
    let interface = "--capture --extcap-interface axle-X";
    assert_eq!(refusal(interface), "--fifo is needed");
    let fifo = format!("{interface} --fifo /nowhere/pipe");
    assert_eq!(refusal(&fifo), "the setting Protocol (--protocol) is needed");
    let other = format!("{fifo} --protocol modbus");
    assert_eq!(refusal(&other), "there is no protocol \"modbus\": ucp, ikeya or ikeya-3");
    let fast = format!("{fifo} --protocol ucp --baud fast");
    assert_eq!(refusal(&fast), "the line speed \"fast\": invalid digit found in string");
    let filtered = format!("{fifo} --protocol ucp --extcap-capture-filter tcp");
    assert_eq!(refusal(&filtered), "no capture filters, such as \"tcp\": use a display filter");
    assert!(refusal("").starts_with("one of --extcap-interfaces, "));
}
