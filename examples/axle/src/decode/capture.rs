//! Captures with times: pcapng.

use std::collections::BTreeMap;

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
    pcapng::{self, Direction, Packet, Problem, Reader},
};

/// Lists a capture; each interface and each direction is a stream of its own.
pub(super) fn run(args: &Args, mut input: Input, chosen: Option<Protocol>) -> Result<(), Failure> {
    let path = input.path().map(ToOwned::to_owned);
    let mut reader = Reader::new(&mut input);
    let mut streams = BTreeMap::<(usize, u8), Box<dyn Stream>>::new();
    let (mut lister, mut latest, mut times_back) = (None::<(Sheet, Printer)>, 0, 0);
    let problem = loop {
        let packet = match reader.next() {
            Ok(None) => break None,
            Err(problem) => break Some(problem),
            // The packet borrows the reader, which knows the interfaces.
            Ok(Some(Packet { interface, micros, direction, bytes })) => {
                (interface, micros, direction, bytes.to_vec())
            }
        };
        let (interface, micros, direction, bytes) = packet;
        let key = (interface, direction.map_or(0, |direction| direction as u8 + 1));
        if !streams.contains_key(&key) {
            let protocol = match chosen {
                Some(protocol) => protocol,
                None => protocol_of(&reader, interface).map_err(Failure::Failed)?,
            };
            streams.insert(key, stream(protocol, interface, direction));
            lister.get_or_insert_with(|| {
                let style = style(args, protocol, true);
                (Sheet::new(style), Printer::new(args.json, style))
            });
        }
        let (Some((sheet, printer)), Some(stream)) = (&mut lister, streams.get_mut(&key)) else {
            continue;
        };
        if let Some(micros) = micros {
            times_back += u64::from(micros < latest);
            latest = micros;
        }
        stream.feed(&bytes, micros, sheet);
        if sheet.out.0.len() > 32 * 1024 {
            printer.print_sheet(sheet)?;
        }
    };
    let (mut sheet, mut printer) =
        lister.unwrap_or_else(|| (Sheet::new(None), Printer::new(args.json, None)));
    let mut account = Counters::default();
    for stream in streams.values_mut() {
        // What is cut off is not the end of the line, but nothing more will come.
        stream.finish(&mut sheet);
        account += stream.counters();
    }
    printer.print_sheet(&mut sheet)?;
    if let Some(problem) = problem {
        printer.flush()?;
        return Err(match problem {
            Problem::Io(error) => Failure::Read { path, error },
            problem => {
                let path = path.unwrap_or_else(|| "standard input".into());
                Failure::Failed(format!("{path:?}: {problem}"))
            }
        });
    }
    printer.finish(&account, times_back)?;
    if account.frames == 0 && account.received > 0 {
        let received = account.received;
        let line = format!("no frame in {received} bytes: use --protocol if it is another one");
        return Err(Failure::Failed(line));
    }
    Ok(())
}

fn stream(protocol: Protocol, interface: usize, direction: Option<Direction>) -> Box<dyn Stream> {
    match protocol {
        Protocol::Ucp => Box::new(StreamOf::<ucp::Ucp>::of_interface(interface, direction)),
        Protocol::Ikeya => {
            Box::new(StreamOf::<ikeya::BothDirections>::of_interface(interface, direction))
        }
        Protocol::Ikeya3 => {
            Box::new(StreamOf::<three::BothDirections>::of_interface(interface, direction))
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
