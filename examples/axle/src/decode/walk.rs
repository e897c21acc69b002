//! All packets of a capture, with times or without, each fed to the stream it belongs to.

use std::{
    collections::{BTreeMap, BTreeSet, btree_map::Entry},
    path::{Path, PathBuf},
    rc::Rc,
};

use axlewire::stream::Counters;

use super::{Choice, Sheet, Stream};
use crate::{
    args::Protocol,
    failure::Failure,
    input::Input,
    listing::Modes,
    pcapng::{self, Direction, LATEST_US, Packet, Reader},
};

/// Maximum number of bytes fed at once: their lines are up to 40 times as long, and are held in
/// memory.
const PIECE: usize = 16 * 1024;

/// Bytes that come next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Next {
    pub(crate) protocol: Protocol,
    /// Number of the interface, if the capture has such.
    pub(crate) interface: Option<usize>,
    /// Microseconds since 1970, if the capture has times.
    pub(crate) micros: Option<u64>,
    /// None come for now: they are the last ones once more.
    pub(crate) waits: bool,
}

/// What was found in a capture.
#[derive(Debug, Default)]
pub(crate) struct Walked {
    pub(crate) account: Counters,
    /// Number of packets with a time before that of the packet in front of them.
    pub(crate) times_back: u64,
    /// Whether one of them was much earlier: the clock was set.
    pub(crate) is_set_back: bool,
    /// The modes of the nodes at the end of the last line.
    pub(crate) modes: Modes,
    /// Packets whose time no clock can have shown, which count as packets without one: how many,
    /// and the number of the first.
    bad_times: (u64, u64),
    /// Why the capture could not be read to its end. What is before that is on the sheet.
    pub(crate) cut: Option<Failure>,
    /// What a program is told, not standard error.
    pub(crate) notes: Option<Vec<String>>,
    /// There are several captures.
    is_collection: bool,
    /// Why the walk was given up. What was read is on the sheet.
    pub(crate) broken: Option<Failure>,
}

/// Packets of two directions may be in the wrong order by this much, microseconds.
pub(crate) const SHORT_STEP_US: u64 = 10_000;

impl Walked {
    /// The time of the packet with this number, if it can be one.
    fn time(&mut self, micros: Option<u64>, packet: u64) -> Option<u64> {
        let (count, first) = &mut self.bad_times;
        if micros? <= LATEST_US {
            return micros;
        }
        if *count == 0 {
            *first = packet;
        }
        *count += 1;
        None
    }

    fn warn(&mut self) {
        let (count, first) = self.bad_times;
        if count > 0 {
            let (packets, have) = if count == 1 { ("packet", "has") } else { ("packets", "have") };
            let line = format!(
                "{count} {packets} {have} an impossible time, which is left out: the first is \
                 packet {first}"
            );
            match &mut self.notes {
                Some(notes) => notes.push(line),
                None => eprintln!("axle: {line}"),
            }
        }
    }

    /// A capture could not be read to its end. The first is told at the end.
    fn miss(&mut self, failure: Failure) {
        match (&self.cut, &mut self.notes) {
            (None, _) => self.cut = Some(failure),
            (Some(_), Some(notes)) => notes.push(failure.to_string()),
            (Some(_), None) => drop(failure.report()),
        }
    }

    /// What is missing of the capture, for whoever has done something with the rest.
    pub(crate) fn missing(self) -> Result<(), Failure> {
        let rest = match self.is_collection {
            true => "all else was taken",
            false => "what is before that was taken",
        };
        self.cut.map_or(Ok(()), |cut| Err(cut.and(rest)))
    }
}

/// Feeds a capture to a sheet; each interface and each direction is a stream of its own. `go_on` is
/// called before every piece, and before a wait for more packets; it may empty the sheet, and tells
/// whether to go on.
pub(crate) fn walk(
    input: &mut Input,
    choice: Choice,
    sheet: &mut Sheet,
    go_on: impl FnMut(Next, &mut Sheet) -> Result<bool, Failure>,
) -> Walked {
    let (lines, mut walked) = (BTreeMap::new(), Walked::default());
    walked.is_collection = input.is_of_a_collection();
    walked.notes = input.is_quiet().then(Vec::new);
    let ports = (walked.is_collection || choice.joins_sections).then(BTreeMap::new);
    input.take_left_out().into_iter().for_each(|failure| walked.miss(failure));
    let foreign = BTreeSet::new();
    let mut walk = Walk { choice, lines, walked, number: 0, latest: 0, ports, foreign, go_on };
    let result = match input.has_times() {
        Ok(true) => walk.packets(input, sheet),
        Ok(false) => walk.raw(input, sheet),
        Err(failure) => Err(failure),
    };
    // Nothing more will come, even if the file was cut off.
    walk.end_lines(sheet);
    walk.walked.broken = result.err();
    walk.walked.warn();
    walk.walked
}

struct Walk<G> {
    choice: Choice,
    /// Those of a section, by the number of the interface.
    lines: BTreeMap<usize, Line>,
    walked: Walked,
    /// Packets so far, and the time of the last one.
    number: u64,
    latest: u64,
    /// In a collection, or if sections are joined: what each interface is. The numbers of the
    /// files do not tell the lines apart.
    ports: Option<BTreeMap<usize, Port>>,
    /// Those of them that are no lines of a known protocol.
    foreign: BTreeSet<usize>,
    go_on: G,
}

/// An interface of a collection. Two of one name in a file are two lines, and so are those of files
/// in different folders.
struct Port {
    /// As its files describe it.
    described: Described,
    /// What tells it apart from the others.
    name: Rc<str>,
    /// The modes of its nodes at the end of a file: the next one goes on with them.
    modes: Modes,
}

/// Folder and name, link type, and the number among those of one name; of those without a name,
/// the number in the section.
type Described = (PathBuf, Option<String>, u16, usize);

/// What an interface was connected to.
struct Line {
    protocol: Protocol,
    interface: Option<usize>,
    /// What tells it apart in a collection.
    name: Rc<str>,
    /// Both directions have the same nodes.
    modes: Modes,
    streams: BTreeMap<Option<Direction>, Box<dyn Stream>>,
}

impl<G: FnMut(Next, &mut Sheet) -> Result<bool, Failure>> Walk<G> {
    fn packets(&mut self, input: &mut Input, sheet: &mut Sheet) -> Result<(), Failure> {
        while self.packets_of_one(input, sheet)? && input.advance()? {
            // The next file may be of another line.
            self.end_lines(sheet);
        }
        Ok(())
    }

    /// The packets of a file; returns whether to go on.
    fn packets_of_one(&mut self, input: &mut Input, sheet: &mut Sheet) -> Result<bool, Failure> {
        let (path, folder) = (input.path().map(ToOwned::to_owned), input.folder());
        let mut reader = Reader::new(input);
        let (mut section, mut last, is_collection) = (0, None, self.walked.is_collection);
        // By the number in the file: it is looked up once, not for each packet.
        let mut numbers = BTreeMap::new();
        // Lines are recorded at the same time.
        self.latest = 0;
        loop {
            self.number += 1;
            match last.filter(|_| reader.waits()) {
                Some(last) if !(self.go_on)(Next { waits: true, ..last }, sheet)? => {
                    return Ok(false);
                }
                Some(_) | None => {}
            }
            let packet = match reader.next() {
                Ok(Some(packet)) => packet,
                Ok(None) => return Ok(true),
                Err(problem) => {
                    self.walked.miss(problem.failure(path));
                    return Ok(true);
                }
            };
            if packet.section != section {
                section = packet.section;
                self.end_lines(sheet);
            }
            let interface = match &mut self.ports {
                Some(ports) => *numbers.entry(packet.interface).or_insert_with(|| {
                    let new = if is_collection { ports.len() } else { packet.interface };
                    number_of(ports, new, &folder, &packet)
                }),
                None => packet.interface,
            };
            match self.choice.interface {
                Some(wanted) if wanted == packet.interface && wanted != interface => {
                    return Err(Failure::Failed(format!(
                        "interface {wanted} is one line with interface {interface}: choose that"
                    )));
                }
                Some(wanted) if wanted != interface => continue,
                _ => {}
            }
            let line = match self.lines.entry(interface) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(new) => {
                    let protocol = match self.choice.protocol {
                        Some(protocol) => protocol,
                        None => match protocol_of(&packet) {
                            Ok(protocol) => protocol,
                            Err(failure) if is_collection => {
                                // Told once.
                                if self.foreign.insert(interface) {
                                    let path = path.as_deref().unwrap_or(Path::new(""));
                                    self.walked.miss(failure.in_file(path));
                                }
                                continue;
                            }
                            Err(failure) => return Err(failure),
                        },
                    };
                    self.choice.permits(protocol)?;
                    let port = self.ports.as_ref().and_then(|ports| ports.get(&interface));
                    new.insert(Line::new(protocol, Some(interface), port))
                }
            };
            let micros = self.walked.time(packet.micros, self.number);
            if let Some(micros) = micros {
                self.walked.times_back += u64::from(micros < self.latest);
                self.walked.is_set_back |= micros + SHORT_STEP_US < self.latest;
                self.latest = micros;
            }
            let (protocol, interface) = (line.protocol, Some(interface));
            let next = Next { protocol, interface, micros, waits: false };
            last = Some(next);
            for piece in packet.bytes.chunks(PIECE) {
                if !(self.go_on)(next, sheet)? {
                    return Ok(false);
                }
                line.feed(self.choice, packet.direction, piece, micros, sheet);
                if sheet.is_full() {
                    return Ok(false);
                }
            }
        }
    }

    fn raw(&mut self, input: &mut Input, sheet: &mut Sheet) -> Result<(), Failure> {
        let Some(protocol) = self.choice.protocol else {
            let line = "--protocol is needed for a capture of raw bytes";
            return Err(Failure::Usage(line.to_owned()));
        };
        self.choice.permits(protocol)?;
        if self.choice.interface.is_some() {
            let line = "--interface is for captures with interfaces: raw bytes are one line";
            return Err(Failure::Usage(line.to_owned()));
        }
        let line = self.lines.entry(0).or_insert_with(|| Line::new(protocol, None, None));
        loop {
            let bytes = match input.read() {
                Ok([]) => return Ok(()),
                Ok(bytes) => bytes,
                Err(failure) => {
                    self.walked.cut = Some(failure);
                    return Ok(());
                }
            };
            for piece in bytes.chunks(PIECE) {
                if !(self.go_on)(
                    Next { protocol, interface: None, micros: None, waits: false },
                    sheet,
                )? {
                    return Ok(());
                }
                line.feed(self.choice, None, piece, None, sheet);
                // At once: on a pipe, the next piece may take long.
                if sheet.is_full() {
                    return Ok(());
                }
            }
        }
    }

    /// Lists what is left of all lines: nothing more will come on them.
    fn end_lines(&mut self, sheet: &mut Sheet) {
        let walked = &mut self.walked;
        for (interface, mut line) in core::mem::take(&mut self.lines) {
            walked.account += line.finish(sheet);
            walked.modes = line.modes;
            if let Some(port) = self.ports.as_mut().and_then(|ports| ports.get_mut(&interface)) {
                port.modes = line.modes;
            }
        }
    }
}

impl Line {
    fn new(protocol: Protocol, interface: Option<usize>, port: Option<&Port>) -> Self {
        let (name, modes) =
            port.map(|port| (Rc::clone(&port.name), port.modes)).unwrap_or_default();
        Self { protocol, interface, name, modes, streams: BTreeMap::new() }
    }

    fn feed(
        &mut self,
        choice: Choice,
        direction: Option<Direction>,
        bytes: &[u8],
        micros: Option<u64>,
        sheet: &mut Sheet,
    ) {
        let stream = self
            .streams
            .entry(direction)
            .or_insert_with(|| choice.stream(self.protocol, self.interface, direction));
        core::mem::swap(&mut self.modes, &mut sheet.modes);
        sheet.turn_to(&self.name);
        stream.feed(bytes, micros, sheet);
        core::mem::swap(&mut self.modes, &mut sheet.modes);
    }

    /// Lists what is left, and returns the account.
    fn finish(&mut self, sheet: &mut Sheet) -> Counters {
        let mut account = Counters::default();
        core::mem::swap(&mut self.modes, &mut sheet.modes);
        sheet.turn_to(&self.name);
        for stream in self.streams.values_mut() {
            stream.finish(sheet);
            account += stream.counters();
        }
        core::mem::swap(&mut self.modes, &mut sheet.modes);
        account
    }
}

/// The number of its port; this one, if the port is new.
fn number_of(
    ports: &mut BTreeMap<usize, Port>,
    new: usize,
    folder: &Path,
    packet: &Packet<'_>,
) -> usize {
    let Packet { described, number, .. } = packet;
    let apart = if described.name.is_some() { described.twin } else { *number };
    let key = (folder.to_owned(), described.name.clone(), described.link_type, apart);
    let known = ports.iter().find(|(_, port)| port.described == key);
    known.map(|(number, _)| *number).unwrap_or_else(|| {
        let port = match &described.name {
            // Readers of exports would take it for a number, and 007 for 7.
            Some(name) if name.bytes().all(|byte| byte.is_ascii_digit()) => format!("port {name}"),
            Some(name) => name.strip_prefix("/dev/").unwrap_or(name).to_owned(),
            None => format!("interface {number}"),
        };
        let parts = folder.iter().map(|part| part.to_string_lossy().into_owned());
        let mut name = parts.chain([port]).collect::<Vec<_>>().join("/");
        if described.name.is_some() && described.twin > 0 {
            name.push_str(&format!(" (interface {number})"));
        }
        // What is written alike may be different all the same.
        let is_taken = |name: &str| ports.values().any(|known| *known.name == *name);
        if is_taken(&name) {
            name.push_str(&format!(" (line {})", ports.len() + 1));
        }
        ports.insert(new, Port { described: key, name: name.into(), modes: Modes::default() });
        new
    })
}

/// The protocol of a packet, by the link type of its interface.
fn protocol_of(packet: &Packet<'_>) -> Result<Protocol, Failure> {
    let Packet { interface, described, .. } = packet;
    let link_type = described.link_type;
    pcapng::protocol_of(link_type).ok_or_else(|| {
        let name = described.name.as_deref().map(|name| format!(" ({name:?})")).unwrap_or_default();
        Failure::Failed(format!(
            "interface {interface}{name} has link type {link_type}, not one of axle's 147 to 150: \
             if it is a serial line all the same, use --protocol"
        ))
    })
}
