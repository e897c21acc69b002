//! Which protocol a stream of bytes is.

use core::fmt;

use axlewire::{
    ikeya::{self, three},
    stream::{Counters, Framing},
    ucp,
};

use super::{account, framing::Choice};
use crate::{args::Protocol, failure::Failure, input::Input};

/// Share of some bytes that belongs to frames of a protocol.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) struct Share {
    pub(crate) protocol: Protocol,
    pub(crate) framed: u64,
    pub(crate) frames: u64,
}

/// The likely protocol of raw bytes, judged by their beginning.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Guess {
    /// The largest first.
    pub(super) shares: [Share; 3],
    /// Number of bytes that were looked at.
    pub(super) len: usize,
}

impl Guess {
    pub(super) const fn protocol(&self) -> Protocol {
        let [best, ..] = &self.shares;
        best.protocol
    }

    /// The first line of a listing as JSON.
    pub(crate) fn json(&self) -> String {
        let share = |share: &Share| format!("\"{}\":{}", share.protocol.name(), share.framed);
        format!(
            "{{\"event\":\"protocol\",\"protocol\":\"{}\",\"received\":{},\"framed\":{{{}}}}}",
            self.protocol().name(),
            self.len,
            self.shares.each_ref().map(share).join(",")
        )
    }
}

/// The same for people.
impl fmt::Display for Guess {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [best, others @ ..] = &self.shares;
        let (name, framed, len) = (best.protocol.name(), best.framed, self.len);
        let share = |share: &Share| format!("{} {}", share.protocol.name(), share.framed);
        let others = others.each_ref().map(share).join(", ");
        write!(f, "protocol {name}: {framed} of the first {len} bytes are in its frames ({others})")
    }
}

/// Maximum number of bytes to look at.
pub(super) const SAMPLE_LEN: usize = 64 * 1024;

/// Number of frames that make a guess reliable.
const SURE_FRAMES: u64 = 3;

/// The share of each protocol in `sample`, the largest first. Its end counts as a quiet line, as
/// the end of the input does: a false header in a short input hides no frame (ruling B3).
pub(crate) fn shares(sample: &[u8]) -> [Share; 3] {
    let mut shares = [
        share::<ucp::Ucp>(Protocol::Ucp, sample),
        share::<ikeya::BothDirections>(Protocol::Ikeya, sample),
        share::<three::BothDirections>(Protocol::Ikeya3, sample),
    ];
    // Stable: of equals, the first is the likelier.
    shares.sort_by_key(|share| core::cmp::Reverse(share.framed));
    shares
}

/// Whether more bytes would hardly change the result: several frames, in most of the bytes.
pub(super) fn is_sure(shares: &[Share; 3], sample_len: usize) -> bool {
    let [best, next, _] = shares;
    best.frames >= SURE_FRAMES
        && 2 * best.framed >= sample_len as u64
        && best.framed > 2 * next.framed
}

fn share<F: Framing>(protocol: Protocol, sample: &[u8]) -> Share {
    let counters = account::of_bytes::<F>(sample);
    Share { protocol, framed: counters.framed, frames: counters.frames }
}

/// What to say if there was no frame of `protocol`.
pub(super) fn no_frame(protocol: Protocol, account: &Counters, shares: &[Share; 3]) -> String {
    let (name, received) = (protocol.name(), account.received);
    let plain = format!("no {name} frame in {received} bytes");
    match shares.first() {
        Some(best) if best.framed > 0 => {
            let (found, frames) = (best.protocol.name(), best.frames);
            format!("{plain}, but {frames} of {found}: use --protocol {found}")
        }
        _ => format!("{plain}: the wrong protocol, the wrong baud rate, or noise"),
    }
}

/// The same for a capture that says its protocols; `named` is on the command line instead.
pub(super) fn no_frame_with_times(named: Option<Protocol>, received: u64) -> String {
    match named.map(|protocol| protocol.name()) {
        Some(name) => {
            format!(
                "no frame in {received} bytes as {name}: without --protocol, the capture says it"
            )
        }
        None => format!("no frame in {received} bytes: use --protocol if it is another one"),
    }
}

/// Finds out the protocol of raw bytes.
pub(super) fn guess(choice: Choice, input: &mut Input) -> Result<Guess, Failure> {
    let sample = input.peek(SAMPLE_LEN, |sample| is_sure(&shares(sample), sample.len()))?;
    let guess = Guess { shares: shares(sample), len: sample.len() };
    let [best, ..] = guess.shares;
    if best.framed == 0 && guess.len > 0 {
        let line = format!("no frame of any protocol in the first {} bytes", guess.len);
        let hint = if guess.len < SAMPLE_LEN { "" } else { ": use --protocol to decode them all" };
        return Err(Failure::Failed(line + hint));
    }
    choice.permits(best.protocol)?;
    Ok(guess)
}

#[cfg(test)]
mod tests {
    use axlewire::ikeya::{NodeId, ReadRequest, Rps, VelocityResponse};

    use super::*;

    const UCP: &[u8] = include_bytes!("../../../captures/ucp.bin");
    const IKEYA: &[u8] = include_bytes!("../../../captures/ikeya.bin");

    #[test]
    fn captures_are_recognised() {
        for (bytes, protocol) in [(UCP, Protocol::Ucp), (IKEYA, Protocol::Ikeya)] {
            let shares = shares(bytes);
            assert_eq!(shares[0].protocol, protocol);
            assert!(is_sure(&shares, bytes.len()), "{shares:?}");
        }
        let one = three::VelocityResponse::new(NodeId::N1, [Rps::ZERO; 3]);
        let shares = shares(&one.as_bytes().repeat(4));
        assert_eq!((shares[0].protocol, shares[0].framed), (Protocol::Ikeya3, 64));
        assert_eq!(shares[1].framed, 0);
    }

    #[test]
    fn requests_alone_do_not_tell_the_boards_apart() {
        let reads = ReadRequest::new(NodeId::N1).as_bytes().repeat(10);
        let found = shares(&reads);
        assert_eq!((found[0].protocol, found[1].protocol), (Protocol::Ikeya, Protocol::Ikeya3));
        assert!(!is_sure(&found, reads.len()));
        let answer = VelocityResponse::new(NodeId::N1, Rps::ZERO);
        let more = [reads, answer.as_bytes().repeat(12)].concat();
        assert!(is_sure(&shares(&more), more.len()));
    }

    #[test]
    fn it_takes_some_frames_in_half_of_the_bytes_and_twice_those_of_any_other() {
        let is_sure = |frames, framed, others| {
            let share = |protocol, framed, frames| Share { protocol, framed, frames };
            let others = share(Protocol::Ikeya, others, 9);
            is_sure(&[share(Protocol::Ucp, framed, frames), others, others], 200)
        };
        assert!(is_sure(SURE_FRAMES, 100, 49));
        assert!(!is_sure(SURE_FRAMES - 1, 100, 49));
        assert!(!is_sure(SURE_FRAMES, 99, 49));
        assert!(!is_sure(SURE_FRAMES, 100, 50));
    }

    #[test]
    fn noise_is_no_protocol() {
        let noise: Vec<u8> = (0..2000_u32).map(|at| (at * at % 251) as u8).collect();
        let shares = shares(&noise);
        assert_eq!(shares[0].framed, 0);
        assert!(!is_sure(&shares, noise.len()) && !is_sure(&super::shares(&[]), 0));
    }
}
