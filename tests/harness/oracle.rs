//! The slow oracle: the expected result for a stream, written from the rulings alone (B1 to B4, I1,
//! I10, U1, U2).
//!
//! It sees the whole history of a line, tries every start, and shares no code with the library:
//! neither the checksum nor the types.

/// Why a byte belongs to no frame (ruling B4).
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Reason {
    Header,
    Length,
    Id,
    Crc,
    Idle,
}

/// The result for the stream, by position in the history.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Event {
    Frame { offset: usize, len: usize },
    Skipped { offset: usize, len: usize, reason: Reason },
}

/// What counts as a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Rules {
    /// `long` is the length of everything but a READ: 8, or 16 on three-motor boards (I10).
    Ikeya { to_slave: bool, to_master: bool, long: usize },
    /// `cap` is the largest length field (U2).
    Ucp { cap: usize },
}

/// The result for a whole history.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub(crate) struct Answer {
    /// Frames, and the gaps that have ended.
    pub(crate) events: Vec<Event>,
    /// Bytes of the gap that has not ended.
    pub(crate) open: usize,
    /// Bytes of the candidate cut off at the end of the history.
    pub(crate) pending: usize,
    /// Bytes skipped, by [`Reason`] in its order.
    pub(crate) skipped: [usize; 5],
    /// Number of gaps begun.
    pub(crate) gaps: usize,
}

impl Answer {
    /// Position and length of every frame.
    pub(crate) fn frames(&self) -> Vec<(usize, usize)> {
        let frame = |event: &Event| match *event {
            Event::Frame { offset, len } => Some((offset, len)),
            Event::Skipped { .. } => None,
        };
        self.events.iter().filter_map(frame).collect()
    }

    /// Moves all events by this many bytes.
    pub(crate) fn move_by(&mut self, bytes: usize) {
        for event in &mut self.events {
            let (Event::Frame { offset, .. } | Event::Skipped { offset, .. }) = event;
            *offset += bytes;
        }
    }

    /// Merges gaps separated only by a silence.
    pub(crate) fn join_gaps(&mut self) {
        let before = self.events.len();
        self.events.dedup_by(|next, gap| match (gap, next) {
            (Event::Skipped { len, .. }, Event::Skipped { len: more, .. }) => {
                *len += *more;
                true
            }
            _ => false,
        });
        self.gaps -= before - self.events.len();
    }
}

/// The result for `bytes` when the line goes quiet after each of `idles`, byte counts in order.
///
/// Two equal counts mean that the first silence has been read before the second is noticed.
pub(crate) fn answer(rules: Rules, bytes: &[u8], idles: &[usize]) -> Answer {
    let mut walk = Walk { rules, at: 0, gap: None, answer: Answer::default() };
    for &idle in idles {
        walk.search(&bytes[..idle]);
        if walk.at < idle {
            walk.skip(Reason::Idle);
            walk.search(&bytes[..idle]);
        }
        walk.close_gap();
    }
    walk.search(bytes);
    walk.answer.open = walk.gap.map_or(0, |(offset, _)| walk.at - offset);
    walk.answer.pending = bytes.len() - walk.at;
    walk.answer
}

struct Walk {
    rules: Rules,
    at: usize,
    /// Where the open gap began, and why.
    gap: Option<(usize, Reason)>,
    answer: Answer,
}

impl Walk {
    fn search(&mut self, known: &[u8]) {
        while self.at < known.len() {
            match claim(self.rules, &known[self.at..]) {
                Claim::Wait => return,
                Claim::Refuse { reason, len } => (0..len).for_each(|_| self.skip(reason)),
                Claim::Frame { len } => {
                    self.close_gap();
                    self.answer.events.push(Event::Frame { offset: self.at, len });
                    self.at += len;
                }
            }
        }
    }

    fn skip(&mut self, reason: Reason) {
        if self.gap.is_none() {
            self.gap = Some((self.at, reason));
            self.answer.gaps += 1;
        }
        self.answer.skipped[reason as usize] += 1;
        self.at += 1;
    }

    fn close_gap(&mut self) {
        if let Some((offset, reason)) = self.gap.take() {
            self.answer.events.push(Event::Skipped { offset, len: self.at - offset, reason });
        }
    }
}

/// The verdict on the bytes at one position.
enum Claim {
    Frame { len: usize },
    Refuse { reason: Reason, len: usize },
    Wait,
}

fn claim(rules: Rules, bytes: &[u8]) -> Claim {
    let len = match promised_len(rules, bytes) {
        Ok(Some(len)) if len <= bytes.len() => len,
        Ok(_) => return Claim::Wait,
        Err(reason) => return Claim::Refuse { reason, len: 1 },
    };
    let (body, field) = bytes[..len].split_at(len - 2);
    if crc(body).to_le_bytes() != field {
        return Claim::Refuse { reason: Reason::Crc, len: 1 };
    }
    // I1: a packet of a node that cannot exist is skipped whole.
    if matches!(rules, Rules::Ikeya { .. }) && !(1..=8).contains(&bytes[1]) {
        return Claim::Refuse { reason: Reason::Id, len };
    }
    Claim::Frame { len }
}

/// Length of the frame announced by the first bytes, `None` while it is not yet known.
pub(crate) fn promised_len(rules: Rules, bytes: &[u8]) -> Result<Option<usize>, Reason> {
    match rules {
        Rules::Ikeya { to_slave, to_master, long } => match bytes[0] {
            0xAA if to_slave => Ok(Some(4)),
            0xBB if to_slave => Ok(Some(long)),
            0x55 | 0x56 if to_master => Ok(Some(long)),
            _ => Err(Reason::Header),
        },
        Rules::Ucp { cap } => {
            let known = bytes.len().min(4);
            let starts = |len: usize| {
                let start = [0xFD, 0xFF, len as u8, (len >> 8) as u8];
                bytes[..known] == start[..known]
            };
            if bytes[0] != 0xFD || (known > 1 && bytes[1] != 0xFF) {
                Err(Reason::Header)
            } else if !(4..=cap).any(starts) {
                Err(Reason::Length)
            } else if known < 4 {
                Ok(None)
            } else {
                Ok((4..=cap).find(|&len| starts(len)).map(|len| len + 4))
            }
        }
    }
}

/// Writes the correct CRC into the last two bytes of `frame`.
pub(crate) fn seal(frame: &mut [u8]) {
    let (body, field) = frame.split_at_mut(frame.len() - 2);
    field.copy_from_slice(&crc(body).to_le_bytes());
}

/// CRC-16/MODBUS, bit by bit (B1).
pub(crate) fn crc(bytes: &[u8]) -> u16 {
    let mut crc = 0xFFFF;
    for &byte in bytes {
        crc ^= u16::from(byte);
        for _ in 0..8 {
            let out = crc & 1;
            crc >>= 1;
            if out == 1 {
                crc ^= 0xA001;
            }
        }
    }
    crc
}
