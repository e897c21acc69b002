//! Foreign framings: one that breaks its contract hangs nothing, one that asks for more than it
//! needs loses nothing.

use axlewire::stream::{Decoder, Event, Frames, Framing, OneByOne, Reason, Verdict};

/// A framing that breaks its contract: a frame longer than its bytes, a candidate that needs
/// nothing, a rejection of more bytes than there are.
struct Liar<const LIE: u8>;

impl<const LIE: u8> Framing for Liar<LIE> {
    type Frame<'a> = &'a [u8];
    type Batch = OneByOne;
    const MIN_LEN: usize = 1;
    const MAX_LEN: usize = 4;

    fn judge(bytes: &[u8]) -> Verdict {
        match LIE {
            _ if bytes.is_empty() => Verdict::Partial { need: 1 },
            0 => Verdict::Frame { len: bytes.len() + 1 },
            1 => Verdict::Partial { need: 0 },
            2 => Verdict::Reject { reason: Reason::Crc, more: bytes.len() + 5 },
            _ => Verdict::Partial { need: usize::MAX },
        }
    }

    fn view(frame: &[u8]) -> Option<&[u8]> {
        Some(frame)
    }
}

#[test]
fn a_framing_that_lies_hangs_nothing() {
    fn feed<const LIE: u8>() {
        let mut decoder = Decoder::<Liar<LIE>, 4>::new();
        let mut most = 1000;
        let mut drain = |decoder: &mut Decoder<Liar<LIE>, 4>, mut input: &[u8]| {
            while decoder.decode(&mut input).is_some() || decoder.poll().is_some() {
                most -= 1;
                assert!(most > 0, "lie {LIE} repeats forever");
            }
        };
        drain(&mut decoder, &[1; 10]);
        for byte in 0..9 {
            decoder.push(byte);
            drain(&mut decoder, &[]);
        }
        decoder.spare().fill(3);
        decoder.commit(4);
        drain(&mut decoder, &[4; 3]);
        decoder.idle();
        drain(&mut decoder, &[5; 9]);
        assert!(Frames::<Liar<LIE>>::new(&[6; 9]).take(10).count() <= 1);
    }
    feed::<0>();
    feed::<1>();
    feed::<2>();
    feed::<3>();
}

/// Frames of three bytes that begin with F, but are judged only when eight bytes are available.
struct Patient;

impl Framing for Patient {
    type Frame<'a> = &'a [u8];
    type Batch = OneByOne;
    const MIN_LEN: usize = 3;
    const MAX_LEN: usize = 8;

    fn judge(bytes: &[u8]) -> Verdict {
        match bytes {
            [b'F', ..] | [] if bytes.len() < 8 => Verdict::Partial { need: 8 },
            [b'F', ..] => Verdict::Frame { len: 3 },
            _ => Verdict::Reject { reason: Reason::Header, more: 0 },
        }
    }

    fn view(frame: &[u8]) -> Option<&[u8]> {
        Some(frame)
    }
}

#[test]
fn a_framing_that_asks_for_more_than_it_needs_loses_nothing() {
    let stream = b"F12F34-F56F78F90--------";
    let wanted: [&[u8]; 5] = [b"F12", b"F34", b"F56", b"F78", b"F90"];
    let (mut pushed, mut decoded) = (Vec::new(), Vec::new());
    let mut decoder = Decoder::<Patient, 8>::new();
    for &byte in stream {
        decoder.push(byte);
        while let Some(event) = decoder.poll() {
            if let Event::Frame(frame) = event {
                pushed.push(frame.to_vec());
            }
        }
    }
    assert_eq!(decoder.counters().header, 9);
    let mut decoder = Decoder::<Patient, 8>::new();
    for mut piece in stream.chunks(5) {
        while let Some(event) = decoder.decode(&mut piece) {
            if let Event::Frame(frame) = event {
                decoded.push(frame.to_vec());
            }
        }
    }
    assert_eq!(decoder.counters().header, 9);
    assert_eq!(
        (pushed, decoded),
        (wanted.map(<[u8]>::to_vec).into(), wanted.map(<[u8]>::to_vec).into())
    );
}
