//! Captures with times: pcapng.

use std::collections::{BTreeMap, btree_map::Entry};

use axlewire::{
    ikeya::{self, three},
    stream::Counters,
    ucp,
};

use super::{Args, Printer, Sheet, Stream, StreamOf, style};
use crate::{
    args::Protocol,
    failure::Failure,
    input::Input,
    pcapng::{self, Direction, Problem, Reader},
};

/// Lists a capture; each interface and each direction is a stream of its own.
pub(super) fn run(args: &Args, mut input: Input, chosen: Option<Protocol>) -> Result<(), Failure> {
    let path = input.path().map(ToOwned::to_owned);
    let mut sheet = Sheet::new(None);
    let mut printer = None;
    let walked = walk(&mut input, chosen, &mut sheet, |protocol, sheet| {
        let printer = printer.get_or_insert_with(|| {
            sheet.style = style(args, protocol, true);
            Printer::new(args.json, sheet.style)
        });
        if sheet.out.0.len() > 32 * 1024 { printer.print_sheet(sheet) } else { Ok(()) }
    })?;
    let mut printer = printer.unwrap_or_else(|| Printer::new(args.json, None));
    printer.print_sheet(&mut sheet)?;
    if let Some(problem) = walked.problem {
        printer.flush()?;
        return Err(problem.failure(path));
    }
    let account = walked.account;
    printer.finish(&account, walked.times_back)?;
    if account.frames == 0 && account.received > 0 {
        let received = account.received;
        let line = format!("no frame in {received} bytes: use --protocol if it is another one");
        return Err(Failure::Failed(line));
    }
    Ok(())
}

/// A capture that has been read.
pub(super) struct Walked {
    pub(super) account: Counters,
    /// Number of packets with a time before that of the packet in front of them.
    times_back: u64,
    /// Why it was not read to its end.
    pub(super) problem: Option<Problem>,
}

/// Lists all packets on a sheet. `go_on` is called in front of each, with its protocol, and may
/// print and empty the sheet.
pub(super) fn walk(
    input: &mut Input,
    chosen: Option<Protocol>,
    sheet: &mut Sheet,
    mut go_on: impl FnMut(Protocol, &mut Sheet) -> Result<(), Failure>,
) -> Result<Walked, Failure> {
    let mut reader = Reader::new(input);
    let mut streams = BTreeMap::<(usize, Option<Direction>), (Protocol, Box<dyn Stream>)>::new();
    let mut walked = Walked { account: Counters::default(), times_back: 0, problem: None };
    let (mut latest, mut bytes) = (0, Vec::new());
    loop {
        let (interface, micros, direction) = match reader.next() {
            Ok(Some(packet)) => {
                // The packet borrows the reader, which knows the interfaces.
                bytes.clear();
                bytes.extend_from_slice(packet.bytes);
                (packet.interface, packet.micros, packet.direction)
            }
            Ok(None) => break,
            Err(problem) => {
                walked.problem = Some(problem);
                break;
            }
        };
        let (protocol, stream) = match streams.entry((interface, direction)) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(new) => {
                let protocol = match chosen {
                    Some(protocol) => protocol,
                    None => protocol_of(&reader, interface).map_err(Failure::Failed)?,
                };
                new.insert((protocol, stream(protocol, interface, direction)))
            }
        };
        go_on(*protocol, sheet)?;
        if let Some(micros) = micros {
            walked.times_back += u64::from(micros < latest);
            latest = micros;
        }
        stream.feed(&bytes, micros, sheet);
    }
    for (_, stream) in streams.values_mut() {
        // Nothing more will come, even if the file was cut off.
        stream.finish(sheet);
        walked.account += stream.counters();
    }
    Ok(walked)
}

pub(super) fn stream(
    protocol: Protocol,
    interface: impl Into<Option<usize>>,
    direction: Option<Direction>,
) -> Box<dyn Stream> {
    let interface = interface.into();
    match protocol {
        Protocol::Ucp => Box::new(StreamOf::<ucp::Ucp>::of_line(interface, direction)),
        Protocol::Ikeya => {
            Box::new(StreamOf::<ikeya::BothDirections>::of_line(interface, direction))
        }
        Protocol::Ikeya3 => {
            Box::new(StreamOf::<three::BothDirections>::of_line(interface, direction))
        }
    }
}

/// The protocol of an interface, by its link type.
fn protocol_of<R: std::io::Read>(reader: &Reader<R>, interface: usize) -> Result<Protocol, String> {
    let interfaces = reader.interfaces();
    let link_type = interfaces.get(interface).map_or(0, |found| found.link_type);
    pcapng::protocol_of(link_type).ok_or_else(|| {
        let name = interfaces.get(interface).and_then(|found| found.name.as_deref());
        let name = name.map(|name| format!(" ({name:?})")).unwrap_or_default();
        format!(
            "interface {interface}{name} has link type {link_type}, not one of axle's 147 to 149: \
             if it is a serial line all the same, use --protocol"
        )
    })
}
