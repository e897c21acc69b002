//! Readers and writers over ports that fail, end, stall and move few bytes, blocking and async,
//! with calls that are dropped: nothing received is lost, no frame is cut, and each is sent once.

mod checks;

use arbitrary::{Arbitrary, Result, Unstructured};
use axlewire::{
    encode::Encode,
    error::EncodeError,
    ikeya::{self, NodeId, Rps},
    io::{FrameReader, FrameWriter, WriteError},
    stream::Event,
    ucp::{self, RawFrame},
};

use super::{
    Tally,
    known_framings::Known,
    oracle,
    port::{Call, Fault, Peer, Port},
    streams::Repair,
};

#[derive(Arbitrary, Debug)]
struct Plan<'a> {
    is_ucp: bool,
    is_file: bool,
    repair: u8,
    bytes: &'a [u8],
    steps: Vec<Step>,
}

#[derive(Arbitrary, Debug)]
struct Step {
    what: What,
    /// Async; dropped after this many polls.
    is_async: bool,
    polls: Option<u8>,
}

#[derive(Arbitrary, Debug)]
enum What {
    Read,
    Idle,
    Fault(Call, Fault),
    Pass(u16),
    Queue { len: u8 },
    Write { len: u8, is_read: bool },
    Flush,
    Discard,
}

/// Nobody answers.
pub(super) struct Nobody;

impl Peer for Nobody {
    fn hear(&mut self, _: u8, _: u64) -> Vec<(u64, u8)> {
        Vec::new()
    }
}

pub(super) fn frame_io(data: &[u8], tally: &mut Tally) {
    let _ = play(&mut Unstructured::new(data), tally);
}

fn play(u: &mut Unstructured<'_>, tally: &mut Tally) -> Result<()> {
    let plan: Plan<'_> = u.arbitrary()?;
    match plan.is_ucp {
        true => run::<ucp::Ucp, 64>(&plan, tally),
        false => run::<ikeya::BothDirections, 11>(&plan, tally),
    }
    Ok(())
}

struct Life<F, const N: usize> {
    port: Port,
    reader: FrameReader<Port, F, N>,
    writer: FrameWriter<Port, 70>,
    /// Bytes that the line brings.
    stream: Vec<u8>,
    events: Vec<oracle::Event>,
    idles: Vec<usize>,
    /// All frames accepted by the writer, one after another, without what was discarded.
    promised: Vec<u8>,
}

fn run<F: Known, const N: usize>(plan: &Plan<'_>, tally: &mut Tally) {
    let mut stream = plan.bytes.to_vec();
    Repair::of(plan.repair).repair::<F>(&mut stream);
    let port = Port::new(0, 20, Nobody);
    port.receive(&stream);
    port.world().is_file = plan.is_file;
    port.world().is_short = true;
    let mut life = Life::<F, N> {
        reader: FrameReader::new(port.clone()),
        writer: FrameWriter::new(port.clone()),
        port,
        stream,
        events: Vec::new(),
        idles: Vec::new(),
        promised: Vec::new(),
    };
    for step in &plan.steps {
        let kind = life.perform(step);
        life.check();
        tally.did(kind);
    }
    // The rest arrives and leaves.
    life.port.heal();
    life.port.world().is_file = true;
    life.port.pass(1 << 20);
    while life.read(false, None) {}
    assert_eq!(life.writer.flush(), Ok(()));
    assert_eq!(life.port.world().taken.len(), life.promised.len());
    life.check();
    life.check_events();
    tally.did_many(12, life.events.len());
}

impl<F: Known, const N: usize> Life<F, N> {
    fn perform(&mut self, step: &Step) -> u8 {
        let polls = if step.is_async { step.polls.map(|polls| polls % 8) } else { None };
        match step.what {
            What::Read => {
                self.read(step.is_async, polls);
                u8::from(step.is_async)
            }
            What::Idle => {
                // The oracle counts a silence when all bytes before it have been judged.
                self.drain();
                self.reader.idle();
                self.idles.push(self.port.world().given as usize);
                self.drain();
                2
            }
            What::Fault(call, fault) => {
                self.port.fault(call, fault);
                3
            }
            What::Pass(units) => {
                self.port.pass(u64::from(units));
                4
            }
            What::Queue { len } => {
                let (body, frame) = raw_frame(len);
                let raw = RawFrame { id: 0x20, index: 1, body: &body };
                self.queued(&frame, |writer| writer.queue(&raw));
                5
            }
            What::Write { len, is_read } => {
                if is_read {
                    let write = ikeya::WriteRequest::velocity(NodeId::N2, Rps::ZERO);
                    self.write(&write, write.as_bytes(), step.is_async, polls);
                } else {
                    let (body, frame) = raw_frame(len);
                    let raw = RawFrame { id: 0x20, index: 1, body: &body };
                    self.write(&raw, &frame, step.is_async, polls);
                }
                6 + u8::from(step.is_async) + 2 * u8::from(is_read)
            }
            What::Flush => {
                let done = match step.is_async {
                    true => self.port.clone().block_on(polls, self.writer.flush_async()),
                    false => Some(self.writer.flush()),
                };
                if done == Some(Ok(())) {
                    assert_eq!(self.writer.unsent(), []);
                    let world = self.port.world();
                    assert_eq!(world.flushed, world.taken.len());
                }
                10
            }
            What::Discard => {
                let rest = self.writer.unsent().len();
                assert_eq!(self.writer.discard(), rest);
                let sent = self.promised.len() - rest;
                self.promised.truncate(sent);
                11
            }
        }
    }

    /// Takes out events without the port: it is made to fail.
    fn drain(&mut self) {
        let before = self.port.world().given;
        loop {
            self.port.world().fail_next_read();
            if !self.read(false, None) {
                break;
            }
        }
        self.port.world().forget_read_failure();
        assert_eq!(self.port.world().given, before);
    }

    /// Returns whether there was an event.
    fn read(&mut self, is_async: bool, polls: Option<u8>) -> bool {
        let is_ready = self.port.world().is_readable();
        if !is_async && !is_ready && self.reader.pending() == 0 {
            // A blocking read would wait forever.
            return false;
        }
        if !is_async && !is_ready {
            self.port.world().fail_next_read();
        }
        // An async read waits for the rest of a frame, perhaps forever.
        let polls = if is_async { polls.or(Some(8)) } else { polls };
        let begun = self.port.world().calls;
        let found = {
            let event = match is_async {
                true => self.port.clone().block_on(polls, self.reader.read_event_async()),
                false => Some(self.reader.read_event()),
            };
            match event {
                Some(Ok(Some(Event::Frame(frame)))) => {
                    let bytes = F::bytes(&frame).to_vec();
                    Some((bytes.len(), Ok(bytes)))
                }
                Some(Ok(Some(Event::Skipped(gap)))) => Some((gap.len as usize, Err(()))),
                _ => None,
            }
        };
        // At most a read for each byte, and one that gives nothing.
        let calls = self.port.world().calls - begun;
        assert!(calls <= 2 * self.stream.len() as u64 + 16, "{calls} calls of the port");
        let Some((len, what)) = found else { return false };
        let counters = self.reader.decoder().counters();
        let offset = (counters.framed + counters.skipped()) as usize - len;
        self.events.push(match what {
            Ok(bytes) => {
                assert_eq!(bytes, self.stream[offset..offset + len], "not what was received");
                oracle::Event::Frame { offset, len }
            }
            // The reason is compared by `ikeya_stream` and `ucp_stream`.
            Err(()) => oracle::Event::Skipped { offset, len, reason: oracle::Reason::Header },
        });
        true
    }

    fn write(&mut self, frame: &impl Encode, bytes: &[u8], is_async: bool, polls: Option<u8>) {
        let before = self.writer.unsent().len();
        let taken = self.port.world().taken.len();
        let done = match is_async {
            true => self.port.clone().block_on(polls, self.writer.write_async(frame)),
            false => Some(self.writer.write(frame)),
        };
        let moved = self.port.world().taken.len() - taken;
        let rest = self.writer.unsent().len();
        // It is queued only once all bytes before it have left.
        let is_queued = moved + rest > before;
        if is_queued {
            assert_eq!(moved + rest, before + bytes.len());
            self.promised.extend(bytes);
        }
        match done {
            Some(Ok(())) => assert!(rest == 0 && is_queued),
            Some(Err(WriteError::Encode(_))) => assert!(!is_queued && rest == 0),
            Some(Err(_)) => assert!(rest > 0, "an error, yet all was taken"),
            None => {}
        }
    }

    fn queued(
        &mut self,
        frame: &[u8],
        queue: impl FnOnce(&mut FrameWriter<Port, 70>) -> core::result::Result<(), EncodeError>,
    ) {
        let before = self.writer.unsent().len();
        match queue(&mut self.writer) {
            Ok(()) => self.promised.extend(frame),
            Err(EncodeError::BufferTooSmall { needed, available }) => {
                assert!(frame.len() > 70 - before);
                assert_eq!((needed, available), (frame.len(), 70 - before));
            }
            // U2: a body that no robot takes is refused before that.
            Err(EncodeError::BodyTooLong { .. }) => assert!(frame.len() > 64),
            Err(other) => panic!("{other}"),
        }
    }
}

/// A body of this length, and its frame.
fn raw_frame(len: u8) -> (Vec<u8>, Vec<u8>) {
    let len = len % 62;
    let body: Vec<u8> = (0..len).collect();
    let mut frame = [&[0xFD, 0xFF, len + 4, 0, 0x20, 1][..], &body, &[0, 0]].concat();
    oracle::seal(&mut frame);
    (body, frame)
}
