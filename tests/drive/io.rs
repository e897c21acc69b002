//! Readers and writers over ports that fail, end, stall and stutter: nothing received is lost.

use std::{future::Future, pin::pin, task::Poll};

use axlewire::{
    error::EncodeError,
    ikeya::{Response, ToMaster, VelocityResponse},
    io::{
        self, WriteError,
        asynch::{FrameReader, FrameWriter},
    },
    stream::{Event, Framing, Gap, Reason},
    ucp::{
        RawFrame, Ucp,
        message::{ErrorCode, Ping, Pong},
    },
};

use crate::rig::*;

/// Polls once, and drops the future if it is not ready, like a timeout.
fn poll_once<T>(future: impl Future<Output = T>) -> Option<T> {
    match poll(pin!(future)) {
        Poll::Ready(output) => Some(output),
        Poll::Pending => None,
    }
}

/// An event that borrows nothing.
fn owned<F: Framing>(event: Event<F::Frame<'_>>, bytes: impl Fn(F::Frame<'_>) -> Vec<u8>) -> Owned {
    match event {
        Event::Frame(frame) => Owned::Frame(bytes(frame)),
        Event::Skipped(gap) => Owned::Skipped(gap),
    }
}

#[derive(Clone, Debug, Eq, PartialEq)]
enum Owned {
    Frame(Vec<u8>),
    Skipped(Gap),
    Error,
    Cancelled,
    End,
}

fn next_blocking(reader: &mut FrameReader<Port, Ucp, 64>) -> Owned {
    let reader: &mut io::FrameReader<_, _, 64> = reader;
    match reader.read_event() {
        Ok(Some(event)) => owned::<Ucp>(event, |frame| frame.as_bytes().to_vec()),
        Ok(None) => Owned::End,
        Err(Unplugged) => Owned::Error,
    }
}

fn next_async(reader: &mut FrameReader<Port, Ucp, 64>) -> Owned {
    match poll_once(reader.read_event()) {
        Some(Ok(Some(event))) => owned::<Ucp>(event, |frame| frame.as_bytes().to_vec()),
        Some(Ok(None)) => Owned::End,
        Some(Err(Unplugged)) => Owned::Error,
        None => Owned::Cancelled,
    }
}

type NextEvent = fn(&mut FrameReader<Port, Ucp, 64>) -> Owned;

/// Both kinds of call, for scenarios that apply to both.
const CALLS: [NextEvent; 2] = [next_blocking, next_async];

fn ping(index: u8) -> Vec<u8> {
    Ping {}.frame(index).as_bytes().to_vec()
}

fn pong(index: u8) -> Vec<u8> {
    Pong::new(ErrorCode::Fine).frame(index).as_bytes().to_vec()
}

#[test]
fn short_reads_of_every_size_deliver_every_frame() {
    let line: Vec<u8> =
        (0..20).flat_map(|index| [ping(index), pong(index), vec![0x00]].concat()).collect();
    for size in 1..=line.len() {
        for next in CALLS {
            let chunks = line.chunks(size).map(|chunk| Step::Bytes(chunk.to_vec()));
            let mut reader = FrameReader::new(Port::file(chunks));
            for index in 0..20 {
                if index > 0 {
                    let gap = Gap { len: 1, reason: Reason::Header };
                    assert_eq!(next(&mut reader), Owned::Skipped(gap));
                }
                assert_eq!(next(&mut reader), Owned::Frame(ping(index)), "chunks of {size}");
                assert_eq!(next(&mut reader), Owned::Frame(pong(index)), "chunks of {size}");
            }
            assert_eq!(next(&mut reader), Owned::End);
        }
    }
}

#[test]
fn a_read_error_in_the_middle_of_a_frame_loses_nothing() {
    for cut in 1..8 {
        for next in CALLS {
            let (head, tail) = (ping(9)[..cut].to_vec(), ping(9)[cut..].to_vec());
            let steps = [Step::Bytes(head), Step::Error, Step::Error, Step::Bytes(tail)];
            let mut reader = FrameReader::new(Port::file(steps));
            assert_eq!(next(&mut reader), Owned::Error);
            assert_eq!(reader.pending(), cut);
            assert_eq!(next(&mut reader), Owned::Error);
            assert_eq!(next(&mut reader), Owned::Frame(ping(9)));
        }
    }
}

#[test]
fn an_end_of_file_in_the_middle_of_a_frame_loses_nothing_when_the_file_grows() {
    for cut in 1..8 {
        for next in CALLS {
            let (head, tail) = (ping(9)[..cut].to_vec(), ping(9)[cut..].to_vec());
            let steps = [Step::Bytes(head), Step::Zero, Step::Zero, Step::Bytes(tail)];
            let mut reader = FrameReader::new(Port::file(steps));
            assert_eq!((next(&mut reader), reader.pending()), (Owned::End, cut));
            assert_eq!((next(&mut reader), reader.pending()), (Owned::End, cut));
            assert_eq!((next(&mut reader), reader.pending()), (Owned::Frame(ping(9)), 0));
        }
    }
}

#[test]
fn at_a_final_end_of_file_idle_releases_frames_hidden_by_a_false_header() {
    for next in CALLS {
        // Two nested length fields of 64 bytes, followed by a whole ping.
        let mut line = vec![0xFD, 0xFF, 60, 0, 0xFD, 0xFF, 60, 0];
        line.extend(ping(1));
        let mut reader = FrameReader::new(Port::file([Step::Bytes(line)]));
        assert_eq!((next(&mut reader), reader.pending()), (Owned::End, 16));
        reader.idle();
        let gap = Gap { len: 4, reason: Reason::Idle };
        assert_eq!((next(&mut reader), reader.pending()), (Owned::Skipped(gap), 12));
        assert_eq!(next(&mut reader), Owned::End);
        reader.idle();
        assert_eq!(next(&mut reader), Owned::Skipped(gap));
        assert_eq!(next(&mut reader), Owned::Frame(ping(1)));
        assert_eq!((next(&mut reader), reader.pending()), (Owned::End, 0));
        let counters = reader.decoder().counters();
        assert_eq!((counters.received, counters.framed, counters.skipped()), (16, 8, 8));
    }
}

#[test]
fn a_cancelled_read_loses_nothing_wherever_it_is_cancelled() {
    for cut in 0..=17 {
        let line = [ping(1), pong(2)].concat();
        let (head, tail) = (line[..cut].to_vec(), line[cut..].to_vec());
        let steps = [Step::Bytes(head), Step::Stall, Step::Stall, Step::Bytes(tail)];
        let steps =
            steps.into_iter().filter(|step| !matches!(step, Step::Bytes(b) if b.is_empty()));
        let mut reader = FrameReader::new(Port::file(steps));
        let (mut frames, mut cancelled) = (vec![], 0);
        loop {
            match next_async(&mut reader) {
                Owned::Frame(frame) => frames.push(frame),
                Owned::Cancelled => cancelled += 1,
                Owned::End => break,
                other => panic!("{other:?}"),
            }
        }
        assert_eq!((frames, cancelled), (vec![ping(1), pong(2)], 2), "cut at {cut}");
    }
}

#[test]
fn the_reader_serves_the_motor_bus_with_the_smallest_buffer() {
    let response = VelocityResponse::new(NodeId::N4, Rps::ZERO);
    let line = [&[0xAA][..], response.as_bytes(), response.as_bytes()].concat();
    let mut reader = io::FrameReader::<_, ToMaster, 8>::new(Port::file([Step::Bytes(line)]));
    assert!(matches!(reader.read_event(), Ok(Some(Event::Skipped(Gap { len: 1, .. })))));
    for _ in 0..2 {
        let Ok(Some(Event::Frame(Response::Velocity(found)))) = reader.read_event() else {
            panic!()
        };
        assert_eq!(*found, response);
    }
    let (_, decoder) = reader.into_parts();
    assert_eq!((decoder.pending(), decoder.counters().received), (0, 17));
}

type Writer = FrameWriter<Port, 24>;

fn write_blocking(writer: &mut Writer, index: u8) -> Result<(), WriteError<Unplugged>> {
    let writer: &mut io::FrameWriter<_, 24> = writer;
    writer.write(&Ping {}.frame(index))
}

fn write_async(writer: &mut Writer, index: u8) -> Result<(), WriteError<Unplugged>> {
    poll_once(writer.write(&Ping {}.frame(index))).expect("ready")
}

type WritePing = fn(&mut Writer, u8) -> Result<(), WriteError<Unplugged>>;

const WRITES: [WritePing; 2] = [write_blocking, write_async];

#[test]
fn short_writes_of_every_size_send_every_byte_once() {
    for size in 1..=8 {
        for write in WRITES {
            let steps = (0..100).map(|_| Step::Few(size));
            let mut writer = Writer::new(Port::writing(steps));
            for index in 0..10 {
                write(&mut writer, index).unwrap();
                assert!(writer.unsent().is_empty());
            }
            let expected: Vec<u8> = (0..10).flat_map(ping).collect();
            assert_eq!(writer.into_port().written, expected);
        }
    }
}

#[test]
fn a_write_error_in_the_middle_of_a_frame_leaves_the_rest_for_the_next_call() {
    for (failure, error) in
        [(Step::Error, WriteError::Port(Unplugged)), (Step::Zero, WriteError::Zero)]
    {
        for cut in 1..8 {
            for write in WRITES {
                let steps = [Step::Few(cut), failure.clone(), failure.clone()];
                let mut writer = Writer::new(Port::writing(steps));
                assert_eq!(write(&mut writer, 1), Err(error));
                assert_eq!(writer.unsent(), &ping(1)[cut..]);
                // The second frame is refused until the first has been sent.
                assert_eq!(write(&mut writer, 2), Err(error));
                assert_eq!(writer.unsent(), &ping(1)[cut..]);
                assert_eq!(write(&mut writer, 3), Ok(()));
                assert_eq!(writer.into_port().written, [ping(1), ping(3)].concat());
            }
        }
    }
}

#[test]
fn a_cancelled_write_is_finished_by_the_next_call() {
    let steps = [Step::Few(3), Step::Stall];
    let mut writer = Writer::new(Port::writing(steps));
    assert_eq!(poll_once(writer.write(&Ping {}.frame(1))), None);
    assert_eq!(writer.unsent(), &ping(1)[3..]);
    assert_eq!(poll_once(writer.flush()), Some(Ok(())));
    let port = writer.into_port();
    assert_eq!((port.written, port.flushed), (ping(1), 1));
}

#[test]
fn flush_sends_what_is_queued_and_flushes_the_port() {
    let mut writer = io::FrameWriter::<_, 24>::new(Port::default());
    writer.queue(&Ping {}.frame(1)).unwrap();
    writer.queue(&Ping {}.frame(2)).unwrap();
    assert!(writer.port_mut().written.is_empty());
    writer.flush().unwrap();
    let port = writer.into_port();
    assert_eq!((port.written, port.flushed), ([ping(1), ping(2)].concat(), 1));
}

#[test]
fn a_frame_without_room_is_refused_and_the_queue_stays_as_it_was() {
    let mut writer = io::FrameWriter::<_, 24>::new(Port::default());
    for index in 0..3 {
        writer.queue(&Ping {}.frame(index)).unwrap();
    }
    let error = EncodeError::BufferTooSmall { needed: 8, available: 0 };
    assert_eq!(writer.queue(&Ping {}.frame(3)), Err(error));
    assert_eq!(writer.unsent().len(), 24);
    assert_eq!(writer.discard(), 24);
    let hazard = RawFrame { id: 5, index: 0, body: &[] };
    assert_eq!(writer.write(&hazard), Err(WriteError::Encode(EncodeError::KnownId { id: 5 })));
    assert!(writer.unsent().is_empty());
    let long = RawFrame { id: 99, index: 0, body: &[0; 20] };
    let error = EncodeError::BufferTooSmall { needed: 28, available: 24 };
    assert_eq!(writer.write(&long), Err(WriteError::Encode(error)));
}

#[test]
fn a_write_error_has_the_text_of_the_ports_own_and_its_source() {
    use std::error::Error;
    let error = WriteError::Port(Unplugged);
    assert!(error.source().is_none());
    assert_eq!(error.to_string(), "port failed while sending: unplugged");
    let zero = WriteError::<Unplugged>::Zero;
    assert_eq!((zero.to_string().as_str(), zero.source().is_none()), ("port took no bytes", true));
    let refused = EncodeError::KnownId { id: 5 };
    let error = WriteError::<Unplugged>::from(refused);
    assert_eq!(error.to_string(), format!("frame cannot be encoded: {refused}"));
    assert!(error.source().is_none());
}

#[test]
fn a_reader_and_its_copy_go_on_with_the_bytes_that_it_holds() {
    let bytes = ping(1);
    let mut reader = io::FrameReader::<&[u8], Ucp, 64>::new(&bytes[..5]);
    assert_eq!(reader.read_event(), Ok(None));
    assert_eq!((reader.pending(), reader.decoder().pending()), (5, 5));
    let mut copy = reader.clone();
    for reader in [&mut reader, &mut copy] {
        *reader.port_mut() = &bytes[5..];
        let Ok(Some(Event::Frame(frame))) = reader.read_event() else { panic!("no frame") };
        assert_eq!(frame.as_bytes(), bytes);
        assert_eq!((reader.pending(), reader.decoder().counters().frames), (0, 1));
    }
    // The decoder that is handed out holds what was not framed yet.
    *reader.port_mut() = &bytes[..3];
    assert_eq!(reader.read_event(), Ok(None));
    let (rest, decoder) = reader.into_parts();
    assert_eq!((rest, decoder.pending()), (&[][..], 3));
}

#[test]
fn a_failed_flush_is_an_error_of_the_port_and_the_next_one_goes_on() {
    let port = || Port { flushes: [Step::Error].into(), ..Port::default() };
    let (mut one, mut other) = (io::FrameWriter::<_, 24>::new(port()), Writer::new(port()));
    for (is_first, expected) in [(true, Err(WriteError::Port(Unplugged))), (false, Ok(()))] {
        if is_first {
            one.queue(&Ping {}.frame(1)).unwrap();
            other.queue(&Ping {}.frame(1)).unwrap();
        }
        assert_eq!(one.flush(), expected);
        assert_eq!(poll_once(other.flush()), Some(expected));
        assert!(one.unsent().is_empty() && other.unsent().is_empty());
    }
    assert_eq!((one.into_port().written, other.into_port().written), (ping(1), ping(1)));
}
