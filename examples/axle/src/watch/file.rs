//! A capture instead of a line: the table of its messages.

use std::{collections::BTreeMap, io};

use axlewire::{
    ikeya::{self, three},
    stream::{Counters, Decoder, Framing},
    time::Instant,
    ucp,
};

use super::{Args, table::Table};
use crate::{
    args::Protocol,
    decode::BUFFER_LEN,
    failure::Failure,
    input::Input,
    listing::Shown,
    pcapng::{self, Direction, Reader},
};

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let mut input = Input::open(args.from.file.as_deref())?;
    let protocol = match args.protocol {
        Some(protocol) => protocol,
        None if input.is_pcapng()? => protocol_of(args)?,
        None => {
            let line = "raw bytes do not name their protocol: use --protocol";
            return Err(Failure::Usage(line.to_owned()));
        }
    };
    match protocol {
        Protocol::Ucp => sum_up::<ucp::Ucp>(args, input, protocol),
        Protocol::Ikeya => sum_up::<ikeya::BothDirections>(args, input, protocol),
        Protocol::Ikeya3 => sum_up::<three::BothDirections>(args, input, protocol),
    }
}

/// The protocol of the first packet in a file.
fn protocol_of(args: &Args) -> Result<Protocol, Failure> {
    let unknown = || {
        let line = "the capture does not name its protocol: use --protocol";
        Failure::Usage(line.to_owned())
    };
    let path = args.from.file.as_deref().filter(|path| *path != "-").ok_or_else(unknown)?;
    let mut input = Input::open(Some(path))?;
    let mut reader = Reader::new(&mut input);
    let interface = match reader.next() {
        Ok(packet) => packet.map_or(0, |packet| packet.interface),
        Err(problem) => return Err(problem.failure(args.from.file.clone())),
    };
    let link_type = reader.interfaces().get(interface).map(|found| found.link_type);
    link_type.and_then(pcapng::protocol_of).ok_or_else(unknown)
}

/// The messages of a capture.
struct Sum<F> {
    table: Table,
    /// One per interface and direction.
    decoders: BTreeMap<(usize, Option<Direction>), Decoder<F, BUFFER_LEN>>,
}

impl<F> Sum<F>
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    fn take(&mut self, stream: (usize, Option<Direction>), bytes: &[u8]) {
        let decoder = self.decoders.entry(stream).or_default();
        self.table.take(decoder, bytes);
    }

    /// Nothing will follow, so truncated frames are no frames (ruling B3). Returns the account.
    fn finish(&mut self) -> Counters {
        let mut counters = Counters::default();
        for decoder in self.decoders.values_mut() {
            loop {
                decoder.idle();
                self.table.take(decoder, &[]);
                if decoder.pending() == 0 {
                    break;
                }
            }
            counters += decoder.counters();
        }
        counters
    }

    fn frames(&self) -> u64 {
        self.decoders.values().map(|decoder| decoder.counters().frames).sum()
    }
}

fn sum_up<F>(args: &Args, mut input: Input, protocol: Protocol) -> Result<(), Failure>
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    // The times of a capture, microseconds; raw bytes have none.
    let (mut first, mut last) = (None, 0);
    let table = Table::new(protocol, Instant::from_micros(0));
    let mut sum = Sum::<F> { table, decoders: BTreeMap::new() };
    let is_enough = |frames| args.count.is_some_and(|count| frames >= count);
    let mut broken = Ok(());
    if input.is_pcapng()? {
        let mut reader = Reader::new(&mut input);
        while !is_enough(sum.frames()) {
            match reader.next() {
                Ok(Some(packet)) => {
                    if let Some(micros) = packet.micros {
                        let first = *first.get_or_insert(micros);
                        last = micros.saturating_sub(first);
                        if args.micros.is_some_and(|limit| last > limit) {
                            break;
                        }
                    }
                    sum.take((packet.interface, packet.direction), packet.bytes);
                }
                Ok(None) => break,
                Err(problem) => {
                    broken = Err(problem.failure(args.from.file.clone()));
                    break;
                }
            }
        }
    } else {
        while !is_enough(sum.frames()) {
            let bytes = input.read()?;
            if bytes.is_empty() {
                break;
            }
            sum.take((0, None), bytes);
        }
    }
    let counters = sum.finish();
    let (mut out, end) = (io::stdout().lock(), Instant::from_micros(last));
    let told = if args.json {
        sum.table.measure_all(end);
        sum.table.print_json(&mut out, "summary", &counters, end)
    } else if counters.received == 0 {
        crate::listing::print_summary(&mut out, &counters, 0, false)
    } else {
        sum.table.finish(&mut out, &counters, 0, end)
    };
    told.map_err(Failure::Write)?;
    broken
}
