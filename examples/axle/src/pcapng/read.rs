//! Reads the packets of a capture, pcapng or classic pcap, including damaged and hostile ones.

use std::{
    fmt,
    io::{self, ErrorKind, Read},
    ops::Range,
    path::PathBuf,
};

use super::{
    classic::Classic,
    format::{BYTE_ORDER, Direction, MAGIC, block, option},
};
use crate::failure::Failure;

/// Longest accepted block. Those of `axle record` are much shorter; other programs describe their
/// interfaces in up to a few kilobytes and cut packets at 256 KiB.
const LONGEST_BLOCK: usize = 1 << 20;

/// Major version of the format.
const VERSION: u32 = 1;

/// Most accepted interfaces of one section: each is held in memory, and has streams of its own.
const MOST_INTERFACES: usize = 1024;

/// What is kept of the name of an interface, bytes.
const LONGEST_NAME: usize = 256;

/// The last time that a packet can have, microseconds since 1970: in April 2262. Every form of
/// export can hold it.
pub(crate) const LATEST_US: u64 = i64::MAX as u64 / 1000;

/// An interface of the current section.
#[derive(Clone, Debug)]
pub(crate) struct Interface {
    pub(crate) link_type: u16,
    /// As text, however it was written; the beginning of a very long one.
    pub(crate) name: Option<String>,
    /// Speed, bit/s; 0 if it is not known.
    pub(crate) baud: u32,
    /// Number of interfaces before it in the section that have its name and link type.
    pub(crate) twin: usize,
    /// Packets are cut at this length; 0 is none.
    longest_packet: u32,
    unit: Unit,
    offset_s: i64,
}

/// Unit of time, as coded in the option.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) struct Unit(pub(super) u8);

impl Unit {
    /// A time in this unit, in microseconds.
    pub(super) fn micros(self, time: u64) -> u64 {
        let (time, exponent) = (u128::from(time), u32::from(self.0 & 0x7F));
        let per_second = if self.0 & 0x80 == 0 {
            10_u128.checked_pow(exponent)
        } else {
            1_u128.checked_shl(exponent)
        };
        let micros = per_second.map_or(0, |per_second| time * 1_000_000 / per_second);
        u64::try_from(micros).unwrap_or(u64::MAX)
    }
}

/// Bytes that a line carried, and when.
#[derive(Debug)]
pub(crate) struct Packet<'a> {
    /// Number of the section. The lines of a section end with it.
    pub(crate) section: u64,
    /// Number of the interface, counted through all sections.
    pub(crate) interface: usize,
    /// Its number in the section.
    pub(crate) number: usize,
    pub(crate) described: &'a Interface,
    /// Microseconds since 1970; `None` if the block has no time.
    pub(crate) micros: Option<u64>,
    pub(crate) direction: Option<Direction>,
    pub(crate) bytes: &'a [u8],
}

/// A packet in the body of its block.
struct Found {
    /// Number of the interface in its section.
    interface: usize,
    micros: Option<u64>,
    direction: Option<Direction>,
    /// Where its bytes are.
    bytes: Range<usize>,
}

/// Why reading ends before the end of the file.
#[derive(Debug)]
pub(crate) enum Problem {
    /// The input failed.
    Io(io::Error),
    /// The block or record that begins at this offset is cut off by the end of the file.
    CutOff { what: &'static str, offset: u64 },
    /// The section that begins at this offset has another format.
    Version { offset: u64, major: u32 },
    /// The block or record that begins at this offset is invalid.
    Invalid { what: &'static str, offset: u64, why: &'static str },
}

impl Problem {
    /// The failure of the tool, for a capture in this file; `None` is standard input.
    pub(crate) fn failure(self, path: Option<PathBuf>) -> Failure {
        match self {
            Self::Io(error) => Failure::Read { path, error },
            problem => {
                let path = path.unwrap_or_else(|| "standard input".into());
                Failure::Failed(format!("{path:?}: {problem}"))
            }
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io(error) => error.fmt(f),
            Self::CutOff { what, offset } => {
                write!(f, "the file ends inside the {what} at byte {offset}")
            }
            Self::Version { offset, major } => write!(
                f,
                "the section at byte {offset} has version {major} of pcapng: axle reads version \
                 {VERSION}"
            ),
            Self::Invalid { what, offset, why } => {
                write!(f, "invalid {what} at byte {offset}: {why}")
            }
        }
    }
}

/// Reads a capture block by block; memory use does not depend on its length.
pub(crate) struct Reader<R> {
    input: R,
    /// A classic capture has records instead of blocks.
    is_classic: bool,
    buffer: Vec<u8>,
    /// The unread bytes of `buffer`.
    start: usize,
    end: usize,
    /// Offset of `start` in the file.
    offset: u64,
    is_big_endian: bool,
    /// The interfaces of the current section.
    interfaces: Vec<Interface>,
    /// Number of interfaces in the sections before.
    interfaces_before: usize,
    section: u64,
    /// The text for people in the header of the section.
    comment: Option<String>,
    is_cut_off: bool,
}

impl<R: Read> Reader<R> {
    /// `input` begins as [`is_capture`](super::is_capture) asks.
    pub(crate) fn new(input: R) -> Self {
        Self {
            input,
            is_classic: false,
            buffer: vec![0; 64 * 1024],
            start: 0,
            end: 0,
            offset: 0,
            is_big_endian: false,
            interfaces: Vec::new(),
            interfaces_before: 0,
            section: 0,
            comment: None,
            is_cut_off: false,
        }
    }

    /// The text for people of the section that was read last.
    pub(crate) fn comment(&self) -> Option<&str> {
        self.comment.as_deref()
    }

    /// The next packet; `None` at the end. After a problem there is nothing more to read.
    ///
    /// The bytes of a packet that the end of the file cuts off are returned, followed by
    /// [`Problem::CutOff`].
    pub(crate) fn next(&mut self) -> Result<Option<Packet<'_>>, Problem> {
        if self.offset == 0 {
            self.begin_classic()?;
        }
        if self.is_classic {
            return self.next_record();
        }
        loop {
            if !self.has_next(8)? {
                return Ok(None);
            }
            if self.peek(0) == Some(u32::from_le_bytes(MAGIC)) {
                self.begin_section()?;
            }
            let (kind, len) = (self.peek(0).unwrap_or(0), self.peek(4).unwrap_or(0) as usize);
            if len < 12 || len % 4 != 0 {
                return Err(self.invalid("its length is not a multiple of 4 above 8"));
            }
            if len > LONGEST_BLOCK {
                return Err(self.invalid("it is longer than 1 MiB"));
            }
            let is_whole = self.fill(len)?;
            let held = if is_whole { len } else { self.end - self.start };
            if is_whole && self.peek(len - 4) != Some(len as u32) {
                return Err(self.invalid("its two lengths differ"));
            }
            self.is_cut_off = !is_whole;
            let (from, offset, what) = (self.start, self.offset, self.what());
            let invalid = |why| Problem::Invalid { what, offset, why };
            if is_whole {
                self.skip(len);
            }
            let body = from + 8..from + if is_whole { held - 4 } else { held };
            match kind {
                block::SECTION if is_whole => {
                    let options = self.buffer.get(body).and_then(|body| body.get(16..));
                    let comment = self
                        .options(options.unwrap_or_default())
                        .find(|(code, _)| *code == option::COMMENT)
                        .map(|(_, text)| String::from_utf8_lossy(text).into_owned());
                    self.comment = comment;
                }
                block::INTERFACE if is_whole => {
                    if self.interfaces.len() == MOST_INTERFACES {
                        return Err(invalid("its section has more than 1024 interfaces"));
                    }
                    let Some(mut interface) = self.interface(body) else {
                        return Err(invalid("it is too short for an interface"));
                    };
                    let is_twin = |it: &&Interface| {
                        (it.link_type, &it.name) == (interface.link_type, &interface.name)
                    };
                    interface.twin = self.interfaces.iter().filter(is_twin).count();
                    self.interfaces.push(interface);
                }
                block::PACKET | block::OBSOLETE_PACKET | block::SIMPLE_PACKET
                    if is_whole || body.len() >= header_len(kind) =>
                {
                    let body = self.buffer.get(body).unwrap_or_default();
                    let (found, described) = self.packet(kind, body, is_whole).map_err(invalid)?;
                    return Ok(Some(Packet {
                        section: self.section,
                        interface: self.interfaces_before + found.interface,
                        number: found.interface,
                        described,
                        micros: found.micros,
                        direction: found.direction,
                        bytes: body.get(found.bytes).unwrap_or_default(),
                    }));
                }
                _ => {}
            }
        }
    }

    /// Reads the header of a classic capture: it has one interface.
    fn begin_classic(&mut self) -> Result<(), Problem> {
        self.fill(4)?;
        let Some(classic) = self.peek(0).and_then(Classic::of) else { return Ok(()) };
        (self.is_classic, self.is_big_endian) = (true, classic.is_big_endian);
        if !self.fill(24)? {
            return Err(self.cut_off());
        }
        // The upper half of the link type tells of check sums.
        let (longest_packet, link_type) = (self.peek(16).unwrap_or(0), self.peek(20).unwrap_or(0));
        let (name, unit) = (None, Unit(classic.unit));
        let link_type = link_type as u16;
        let interface =
            Interface { link_type, name, baud: 0, twin: 0, longest_packet, unit, offset_s: 0 };
        self.interfaces.push(interface);
        self.section = 1;
        self.skip(24);
        Ok(())
    }

    /// The next packet of a classic capture.
    fn next_record(&mut self) -> Result<Option<Packet<'_>>, Problem> {
        if !self.has_next(16)? {
            return Ok(None);
        }
        let word = |at| self.peek(at).unwrap_or(0);
        let (seconds, fraction, len) = (word(0), word(4), word(8) as usize);
        if len > LONGEST_BLOCK {
            return Err(self.invalid("its packet is longer than 1 MiB"));
        }
        self.is_cut_off = !self.fill(16 + len)?;
        let bytes = self.start + 16..self.end.min(self.start + 16 + len);
        if !self.is_cut_off {
            self.skip(16 + len);
        }
        let described =
            self.interfaces.first().ok_or_else(|| self.invalid("it has no interface"))?;
        Ok(Some(Packet {
            section: self.section,
            interface: 0,
            number: 0,
            described,
            micros: Some(u64::from(seconds) * 1_000_000 + described.unit.micros(fraction.into())),
            direction: None,
            bytes: self.buffer.get(bytes).unwrap_or_default(),
        }))
    }

    /// Whether a block or record follows, of at least this length; `false` at the end.
    fn has_next(&mut self, least: usize) -> Result<bool, Problem> {
        if self.is_cut_off || !self.fill(least)? && self.start < self.end {
            return Err(self.cut_off());
        }
        Ok(self.start < self.end)
    }

    /// Whether `next` waits for the input.
    pub(crate) fn waits(&self) -> bool {
        let (held, header, at) = match self.is_classic {
            true => (self.end - self.start, 16, 8),
            false => (self.end - self.start, 0, 4),
        };
        held < at + 4 || self.peek(at).is_none_or(|len| held < header + len as usize)
    }

    const fn skip(&mut self, len: usize) {
        self.start += len;
        self.offset += len as u64;
    }

    /// Learns the byte order of a new section.
    fn begin_section(&mut self) -> Result<(), Problem> {
        if !self.fill(12)? {
            return Err(self.cut_off());
        }
        self.is_big_endian = false;
        if self.peek(8) != Some(BYTE_ORDER) {
            self.is_big_endian = true;
        }
        if self.peek(8) != Some(BYTE_ORDER) {
            return Err(self.invalid("it has no byte-order mark"));
        }
        if !self.fill(16)? {
            return Err(self.cut_off());
        }
        let versions = self.peek(12).unwrap_or(0);
        let major = if self.is_big_endian { versions >> 16 } else { versions & 0xFFFF };
        if major != VERSION {
            return Err(Problem::Version { offset: self.offset, major });
        }
        // Their numbers begin anew, and nothing refers to those before.
        self.interfaces_before += self.interfaces.len();
        self.interfaces.clear();
        self.section += 1;
        Ok(())
    }

    fn interface(&self, body: Range<usize>) -> Option<Interface> {
        let body = self.buffer.get(body)?;
        let (link_type, options) = (self.u16(body.get(..2)?)?, body.get(8..)?);
        let longest_packet = self.u32(body.get(4..8)?)?;
        let mut interface = Interface {
            link_type,
            name: None,
            baud: 0,
            twin: 0,
            longest_packet,
            unit: Unit(6),
            offset_s: 0,
        };
        for (code, value) in self.options(options) {
            match (code, value) {
                (option::INTERFACE_NAME, name) => {
                    let name = name.get(..LONGEST_NAME).unwrap_or(name);
                    interface.name = Some(String::from_utf8_lossy(name).into_owned());
                }
                (option::SPEED, value) => {
                    let baud = self.u64(value).and_then(|baud| baud.try_into().ok());
                    interface.baud = baud.unwrap_or(0);
                }
                (option::TIME_UNIT, &[unit]) => interface.unit = Unit(unit),
                (option::TIME_OFFSET, value) => {
                    interface.offset_s = self.u64(value)? as i64;
                }
                _ => {}
            }
        }
        Some(interface)
    }

    /// The packet in the body of a block, and its interface.
    fn packet(
        &self,
        kind: u32,
        body: &[u8],
        is_whole: bool,
    ) -> Result<(Found, &Interface), &'static str> {
        const SHORT: &str = "it is too short for a packet";
        let word = |at| self.u32(body.get(at..at + 4).ok_or(SHORT)?).ok_or(SHORT);
        let interface = match kind {
            block::SIMPLE_PACKET => 0,
            // In half a word; the other half counts packets lost.
            block::OBSOLETE_PACKET => self.u16(body.get(..2).ok_or(SHORT)?).ok_or(SHORT)?.into(),
            _ => word(0)? as usize,
        };
        let described = self.interfaces.get(interface).ok_or("it names no interface")?;
        let (begin, has_time) = (header_len(kind), kind != block::SIMPLE_PACKET);
        let len = match (kind, described.longest_packet) {
            // These name the length on the line only; padding may follow.
            (block::SIMPLE_PACKET, longest @ 1..) => word(0)?.min(longest),
            (block::SIMPLE_PACKET, 0) => word(0)?,
            _ => word(12)?,
        };
        let (len, held) = (len as usize, body.len().saturating_sub(begin));
        if is_whole && held < len {
            return Err("its packet is longer than the block");
        }
        let bytes = begin..begin + held.min(len);
        let mut found = Found { interface, micros: None, direction: None, bytes };
        if has_time {
            let time = u64::from(word(4)?) << 32 | u64::from(word(8)?);
            let offset_us = described.offset_s.saturating_mul(1_000_000);
            // Before 1970 is a time that no clock can have shown, as is the far future.
            let micros = described.unit.micros(time).checked_add_signed(offset_us);
            found.micros = Some(micros.unwrap_or(u64::MAX));
            let options = body.get(begin + len.next_multiple_of(4)..).unwrap_or_default();
            let flags = self.options(options).find(|(code, _)| *code == option::FLAGS);
            let flags = flags.and_then(|(_, flags)| self.u32(flags));
            found.direction = flags.and_then(Direction::from_flags);
        }
        Ok((found, described))
    }

    /// Code and value of each option, up to the first that is cut off.
    fn options<'a>(&self, bytes: &'a [u8]) -> impl Iterator<Item = (u16, &'a [u8])> {
        let mut rest = bytes;
        core::iter::from_fn(move || {
            let code = self.u16(rest.get(..2)?)?;
            let len = usize::from(self.u16(rest.get(2..4)?)?);
            let value = rest.get(4..4 + len)?;
            rest = rest.get(4 + len.next_multiple_of(4)..).unwrap_or_default();
            (code != option::END).then_some((code, value))
        })
    }

    fn u16(&self, bytes: &[u8]) -> Option<u16> {
        let bytes = bytes.try_into().ok()?;
        Some(if self.is_big_endian { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    }

    fn u32(&self, bytes: &[u8]) -> Option<u32> {
        let bytes = bytes.try_into().ok()?;
        Some(if self.is_big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    fn u64(&self, bytes: &[u8]) -> Option<u64> {
        let (first, second) = bytes.split_at_checked(4)?;
        let (high, low) = if self.is_big_endian { (first, second) } else { (second, first) };
        Some(u64::from(self.u32(high)?) << 32 | u64::from(self.u32(low)?))
    }

    /// The number at this place of the unread bytes.
    fn peek(&self, at: usize) -> Option<u32> {
        self.u32(self.buffer.get(self.start + at..self.start + at + 4)?)
    }

    /// Reads until `count` bytes are unread; `false` if the input ends before.
    fn fill(&mut self, count: usize) -> Result<bool, Problem> {
        if self.buffer.len() - self.start < count {
            self.buffer.copy_within(self.start..self.end, 0);
            (self.start, self.end) = (0, self.end - self.start);
            if self.buffer.len() < count {
                self.buffer.resize(count, 0);
            }
        }
        while self.end - self.start < count {
            let room = self.buffer.get_mut(self.end..).unwrap_or_default();
            match self.input.read(room) {
                Ok(0) => return Ok(false),
                Ok(read) => self.end += read,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(Problem::Io(error)),
            }
        }
        Ok(true)
    }

    /// What begins at the current offset.
    const fn what(&self) -> &'static str {
        if self.is_classic { "pcap record" } else { "pcapng block" }
    }

    const fn invalid(&self, why: &'static str) -> Problem {
        Problem::Invalid { what: self.what(), offset: self.offset, why }
    }

    const fn cut_off(&self) -> Problem {
        Problem::CutOff { what: self.what(), offset: self.offset }
    }
}

/// Number of bytes in front of those of a packet.
const fn header_len(kind: u32) -> usize {
    if kind == block::SIMPLE_PACKET { 4 } else { 20 }
}
