//! Readers and writers over ports that fail, end, stall and move few bytes, blocking and async,
//! with calls that are dropped: nothing received is lost, no frame is cut, and each is sent once.

mod checks;

use arbitrary::{Arbitrary, Result, Unstructured};
use axlewire::{
    encode::Encode,
    error::EncodeError,
    ikeya::{self, NodeId, Rps},
    io::{FrameReader, FrameWriter, WriteError, asynch},
    stream::Event,
    ucp::{self, RawFrame},
};

use super::{
    Tally,
    fault::{Call, Fault},
    known_framings::Known,
    oracle,
    port::{Empty, Port, Step, World},
    streams::Repair,
};

#[derive(Arbitrary, Debug)]
struct Plan<'a> {
    is_ucp: bool,
    is_file: bool,
    repair: u8,
    bytes: &'a [u8],
    steps: Vec<Action>,
}

#[derive(Arbitrary, Debug)]
struct Action {
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
    world: World,
    reader: asynch::FrameReader<Port, F, N>,
    writer: asynch::FrameWriter<Port, 70>,
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
    let world = World::default();
    let mut reading = Port::new(&world, 20);
    reading.receive(&stream);
    reading.empty = if plan.is_file { Empty::Ends } else { Empty::Fails };
    let mut life = Life::<F, N> {
        reader: asynch::FrameReader::new(reading),
        writer: asynch::FrameWriter::new(Port { drains: true, ..Port::new(&world, 20) }),
        world,
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
    life.reader.port_mut().reads.clear();
    life.reader.port_mut().empty = Empty::Ends;
    life.writer.port_mut().writes.clear();
    life.writer.port_mut().flushes.clear();
    life.world.step(1 << 20);
    while life.read(false, None) {}
    assert_eq!(life.blocking_writer().flush(), Ok(()));
    assert_eq!(life.writer.port_mut().written.len(), life.promised.len());
    life.check();
    life.check_events();
    tally.did_many(12, life.events.len());
}

impl<F: Known, const N: usize> Life<F, N> {
    fn perform(&mut self, step: &Action) -> u8 {
        let polls =
            if step.is_async { step.polls.map(|polls| usize::from(polls % 8)) } else { None };
        match step.what {
            What::Read => {
                self.read(step.is_async, polls);
                u8::from(step.is_async)
            }
            What::Idle => {
                // The oracle counts a silence when all bytes before it have been judged.
                self.drain();
                self.reader.idle();
                self.idles.push(self.reader.port_mut().given as usize);
                self.drain();
                2
            }
            What::Fault(call, fault) => {
                let (reading, writing) = (self.reader.port_mut(), self.writer.port_mut());
                match call {
                    Call::Read => reading.reads.push_back(fault.step()),
                    Call::Write => writing.writes.push_back(fault.step()),
                    Call::Flush => writing.flushes.push_back(fault.step()),
                    Call::Pin => {}
                }
                3
            }
            What::Pass(units) => {
                self.world.step(units.into());
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
                    true => self.world.run(polls, self.writer.flush()),
                    false => Some(self.blocking_writer().flush()),
                };
                if done == Some(Ok(())) {
                    assert!(self.writer.unsent().is_empty());
                    let port = self.writer.port_mut();
                    assert_eq!(port.flushed_bytes, port.written.len());
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
        let before = self.reader.port_mut().given;
        loop {
            self.fail_next_read();
            if !self.read(false, None) {
                break;
            }
        }
        let port = self.reader.port_mut();
        if let Some(Step::Error) = port.reads.front() {
            port.reads.pop_front();
        }
        assert_eq!(port.given, before);
    }

    /// The next read fails, whatever was planned.
    fn fail_next_read(&mut self) {
        let port = self.reader.port_mut();
        if !matches!(port.reads.front(), Some(Step::Error)) {
            port.reads.push_front(Step::Error);
        }
    }

    /// Returns whether there was an event.
    fn read(&mut self, is_async: bool, polls: Option<usize>) -> bool {
        let is_ready = self.reader.port_mut().is_readable();
        if !is_async && !is_ready && self.reader.pending() == 0 {
            // A blocking read would wait forever.
            return false;
        }
        if !is_async && !is_ready {
            self.fail_next_read();
        }
        // An async read waits for the rest of a frame, perhaps forever.
        let polls = if is_async { polls.or(Some(8)) } else { polls };
        let begun = self.world.calls();
        let found = {
            let event = match is_async {
                true => self.world.run(polls, self.reader.read_event()),
                false => Some(self.blocking_reader().read_event()),
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
        let calls = self.world.calls() - begun;
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

    /// The reader, with blocking calls.
    fn blocking_reader(&mut self) -> &mut FrameReader<Port, F, N> {
        &mut self.reader
    }

    /// The writer, with blocking calls.
    fn blocking_writer(&mut self) -> &mut FrameWriter<Port, 70> {
        &mut self.writer
    }

    fn write(&mut self, frame: &impl Encode, bytes: &[u8], is_async: bool, polls: Option<usize>) {
        let before = self.writer.unsent().len();
        let taken = self.writer.port_mut().written.len();
        let done = match is_async {
            true => self.world.run(polls, self.writer.write(frame)),
            false => Some(self.blocking_writer().write(frame)),
        };
        let moved = self.writer.port_mut().written.len() - taken;
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
