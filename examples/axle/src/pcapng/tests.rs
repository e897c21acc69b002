//! What is written is read back; whatever else is read ends in a packet or a problem.

use std::{fs::File, io};

use super::{Direction, Reader, Writer, link_type, protocol_of, read::Problem};
use crate::args::Protocol;

/// Time, direction and bytes of each packet, and the problem at the end.
type Seen = Vec<(Option<u64>, Option<Direction>, Vec<u8>)>;

fn read(bytes: &[u8]) -> (Seen, Option<Problem>) {
    let mut reader = Reader::new(bytes);
    let mut seen = Vec::new();
    loop {
        match reader.next() {
            Ok(Some(packet)) => {
                seen.push((packet.micros, packet.direction, packet.bytes.to_vec()));
            }
            Ok(None) => return (seen, None),
            Err(problem) => return (seen, Some(problem)),
        }
    }
}

/// A capture with packets of 0 to 4 bytes, of every direction.
fn capture() -> (Vec<u8>, Seen) {
    let mut writer = Writer::new(Protocol::Ikeya3, "/dev/ttyUSB0", 500_000);
    let packets: Seen = (0..5)
        .map(|len| {
            let direction = [None, Some(Direction::In), Some(Direction::Out)][len % 3];
            (Some(1_700_000_000_123_456 + len as u64), direction, vec![0xA0 + len as u8; len])
        })
        .collect();
    for (micros, direction, bytes) in &packets {
        writer.packet(micros.unwrap(), *direction, bytes);
    }
    (writer.blocks, packets)
}

/// A block of a section in this byte order.
fn block(is_big: bool, kind: u32, body: &[u8]) -> Vec<u8> {
    let word = |number: u32| if is_big { number.to_be_bytes() } else { number.to_le_bytes() };
    let len = body.len() as u32 + 12;
    [&word(kind)[..], &word(len), body, &word(len)].concat()
}

/// A file with one interface that has this option, and a packet at this time.
fn with_option(is_big: bool, code: u16, value: &[u8], time: u64) -> Vec<u8> {
    let word = |number: u32| if is_big { number.to_be_bytes() } else { number.to_le_bytes() };
    let half = |number: u16| if is_big { number.to_be_bytes() } else { number.to_le_bytes() };
    let header = [&word(0x1A2B_3C4D)[..], &half(1), &half(0), &[0xFF; 8]].concat();
    let mut value = value.to_vec();
    let len = value.len() as u16;
    value.resize(value.len().next_multiple_of(4), 0);
    let interface = [&half(149)[..], &[0; 6], &half(code), &half(len), &value].concat();
    let times = [word((time >> 32) as u32), word(time as u32)].concat();
    let packet = [&word(0)[..], &times, &word(3), &word(3), &[1, 2, 3, 0]].concat();
    [block(is_big, 0x0A0D_0D0A, &header), block(is_big, 1, &interface), block(is_big, 6, &packet)]
        .concat()
}

#[test]
fn what_is_written_is_read_back() {
    let (bytes, packets) = capture();
    let (seen, problem) = read(&bytes);
    assert_eq!(seen, packets);
    assert!(problem.is_none());
    let mut reader = Reader::new(&bytes[..]);
    let interface = reader.next().unwrap().unwrap().described;
    assert_eq!(interface.name.as_deref(), Some("/dev/ttyUSB0"));
    assert_eq!(protocol_of(interface.link_type), Some(Protocol::Ikeya3));
}

#[test]
fn a_file_cut_off_anywhere_gives_every_byte_that_is_there() {
    let (bytes, packets) = capture();
    let whole: Vec<u8> = packets.iter().flat_map(|(.., bytes)| bytes.clone()).collect();
    for cut in 0..bytes.len() {
        let (seen, problem) = read(&bytes[..cut]);
        let found: Vec<u8> = seen.into_iter().flat_map(|(.., bytes)| bytes).collect();
        assert!(whole.starts_with(&found), "{cut}");
        // Bytes of a packet are at 28 from the start of its block.
        let mut expected = 0;
        let (mut at, mut is_whole) = (0, cut == 0);
        while at < cut {
            let len = u32::from_le_bytes(bytes[at + 4..at + 8].try_into().unwrap()) as usize;
            if bytes[at] == 6 {
                let count = u32::from_le_bytes(bytes[at + 20..at + 24].try_into().unwrap());
                expected += cut.saturating_sub(at + 28).min(count as usize);
            }
            at += len;
            is_whole = at == cut;
        }
        assert_eq!(found.len(), expected, "{cut}");
        match problem {
            None => assert!(is_whole, "{cut}"),
            Some(Problem::CutOff { offset, .. }) => {
                assert!(!is_whole && offset <= cut as u64, "{cut}");
            }
            Some(other) => panic!("{cut}: {other}"),
        }
    }
}

#[test]
fn times_of_any_unit_and_byte_order_are_microseconds() {
    for is_big in [false, true] {
        let offset =
            |seconds: i64| if is_big { seconds.to_be_bytes() } else { seconds.to_le_bytes() };
        let (forth, back, far) = (offset(5), offset(-5), offset(3 << 32));
        let cases: [(u16, &[u8], u64, u64); 9] = [
            (1, b"a comment", 7_000_001, 7_000_001), // microseconds unless it says otherwise
            (9, &[6], 7_000_001, 7_000_001),
            (9, &[9], 7_000_001_999, 7_000_001),
            (9, &[0], 7, 7_000_000),
            (9, &[0x80 + 20], 7 << 20, 7_000_000),
            (9, &[0x7F], u64::MAX, 0), // a unit too small to matter
            (14, &forth, 2_000_000, 7_000_000),
            (14, &back, 12_000_000, 7_000_000),
            (14, &far, 1, (3 << 32) * 1_000_000 + 1),
        ];
        for (code, value, time, micros) in cases {
            let (seen, problem) = read(&with_option(is_big, code, value, time));
            assert!(problem.is_none(), "{code} {value:?}");
            assert_eq!(seen, [(Some(micros), None, vec![1, 2, 3])], "{code} {value:?} {is_big}");
        }
    }
}

#[test]
fn a_section_of_another_version_is_refused_by_its_number() {
    for is_big in [false, true] {
        let mut bytes = with_option(is_big, 9, &[6], 1);
        let major = if is_big { 13 } else { 12 };
        bytes[major] = 2;
        let (seen, problem) = read(&bytes);
        assert!(seen.is_empty());
        let says = "the section at byte 0 has version 2 of pcapng: axle reads version 1";
        assert_eq!(problem.unwrap().to_string(), says);
    }
}

#[test]
fn packets_of_later_sections_have_interfaces_of_their_own() {
    let one = with_option(false, 9, &[6], 1);
    let two = with_option(true, 9, &[9], 2000);
    let bytes = [one, two].concat();
    let mut reader = Reader::new(&bytes[..]);
    let first = reader.next().unwrap().unwrap();
    assert_eq!((first.interface, first.section, first.micros), (0, 1, Some(1)));
    let second = reader.next().unwrap().unwrap();
    assert_eq!((second.interface, second.section, second.micros), (1, 2, Some(2)));
    assert!(reader.next().unwrap().is_none());
}

#[test]
fn simple_packets_have_no_time_and_unknown_blocks_are_passed_over() {
    let mut bytes = with_option(false, 9, &[6], 1);
    bytes.extend(block(false, 5, &[0; 8]));
    bytes.extend(block(false, 5, &[]));
    bytes.extend(block(false, 3, &[2, 0, 0, 0, 7, 8, 0, 0]));
    let (seen, problem) = read(&bytes);
    assert!(problem.is_none());
    assert_eq!(seen[1], (None, None, vec![7, 8]));
}

#[test]
fn the_padding_of_a_simple_packet_is_no_part_of_it() {
    // An interface that cuts packets at 5 bytes, and a packet that had 8 on the line.
    let version = [1, 0, 0, 0];
    let head = [&0x1A2B_3C4D_u32.to_le_bytes()[..], &version, &[0xFF; 8]].concat();
    let section = block(false, 0x0A0D_0D0A, &head);
    let interface = block(false, 1, &[149, 0, 0, 0, 5, 0, 0, 0]);
    let start = [section, interface].concat();
    for (len_on_line, expected) in
        [(8, &[1, 2, 3, 4, 5][..]), (5, &[1, 2, 3, 4, 5]), (3, &[1, 2, 3])]
    {
        let packet = block(false, 3, &[len_on_line, 0, 0, 0, 1, 2, 3, 4, 5, 0, 0, 0]);
        let (seen, problem) = read(&[&start[..], &packet].concat());
        assert!(problem.is_none());
        assert_eq!(seen, [(None, None, expected.to_vec())], "{len_on_line}");
    }
    // Cut off by the end of the file.
    let packet = block(false, 3, &[4, 0, 0, 0, 1, 2, 3, 4]);
    let (seen, problem) = read(&[&start[..], &packet[..14]].concat());
    assert_eq!(seen, [(None, None, vec![1, 2])]);
    assert!(matches!(problem, Some(Problem::CutOff { .. })), "{problem:?}");
}

#[test]
fn the_packets_of_old_programs_are_read() {
    for is_big in [false, true] {
        let word = |number: u32| if is_big { number.to_be_bytes() } else { number.to_le_bytes() };
        let half = |number: u16| if is_big { number.to_be_bytes() } else { number.to_le_bytes() };
        let mut bytes = with_option(is_big, 9, &[6], 1);
        // Interface 0; 7 packets were lost before.
        let flags = [&half(2)[..], &half(4), &word(1)].concat();
        let words = [word(0), word(9), word(3), word(3)].concat();
        let packet = [&half(0)[..], &half(7), &words, &[4, 5, 6, 0], &flags].concat();
        bytes.extend(block(is_big, 2, &packet));
        let (seen, problem) = read(&bytes);
        assert!(problem.is_none(), "{problem:?}");
        assert_eq!(seen[1], (Some(9), Some(Direction::In), vec![4, 5, 6]), "{is_big}");
    }
}

#[test]
fn a_section_has_a_limited_number_of_interfaces_and_names() {
    let interface = block(false, 1, &[149, 0, 0, 0, 0, 0, 0, 0]);
    let start = with_option(false, 2, &[b'x'; 60_000], 1);
    let mut reader = Reader::new(&start[..]);
    let name = reader.next().unwrap().unwrap().described.name.clone();
    assert_eq!(name.unwrap().len(), 256);
    let most = [&start[..], &interface.repeat(1023)].concat();
    assert!(read(&most).1.is_none());
    // Those of other sections do not count.
    assert!(read(&most.repeat(2)).1.is_none());
    let (seen, problem) = read(&[&most[..], &interface].concat());
    assert_eq!(seen.len(), 1);
    let expected = "its section has more than 1024 interfaces";
    assert!(matches!(problem, Some(Problem::Invalid { why, .. }) if why == expected));
}

#[test]
fn rovers_have_a_link_type_that_other_programs_give_no_meaning() {
    assert_eq!(link_type(Protocol::Ucp), 150);
    // Of captures before that.
    assert_eq!(protocol_of(149), Some(Protocol::Ucp));
    for protocol in [Protocol::Ucp, Protocol::Ikeya, Protocol::Ikeya3] {
        assert_eq!(protocol_of(link_type(protocol)), Some(protocol));
    }
}

#[test]
fn an_invalid_block_is_named_with_its_offset() {
    let start = with_option(false, 9, &[6], 1);
    let packet = |interface: u8, len: u8| {
        [&[interface, 0, 0, 0][..], &[0; 8], &[len, 0, 0, 0, len, 0, 0, 0, 9, 9, 9, 9]].concat()
    };
    let mut odd = block(false, 6, &packet(0, 4));
    odd[4] += 1;
    let mut two_lengths = block(false, 6, &packet(0, 4));
    *two_lengths.last_mut().unwrap() = 1;
    let cases = [
        (block(false, 6, &packet(1, 4)), "it names no interface"),
        (block(false, 6, &packet(0, 5)), "its packet is longer than the block"),
        (block(false, 6, &[0; 8]), "it is too short for a packet"),
        (block(false, 3, &[5, 0, 0, 0, 9, 9, 9, 9]), "its packet is longer than the block"),
        (block(false, 1, &[0; 4]), "it is too short for an interface"),
        (block(false, 0x0A0D_0D0A, &[0; 16]), "it has no byte-order mark"),
        (odd, "its length is not a multiple of 4 above 8"),
        (two_lengths, "its two lengths differ"),
        ([6, 0, 0, 0, 0, 0, 0, 0x7F].to_vec(), "it is longer than 1 MiB"),
    ];
    for (bad, expected) in cases {
        let (seen, problem) = read(&[&start[..], &bad].concat());
        assert_eq!(seen.len(), 1, "{expected}");
        match problem {
            Some(Problem::Invalid { offset, why, .. }) => {
                assert_eq!((offset, why), (start.len() as u64, expected));
            }
            other => panic!("{expected}: {other:?}"),
        }
    }
}

#[test]
fn damage_never_panics_nor_loops() {
    let (bytes, _) = capture();
    let mut state = 1_u64;
    for _ in 0..20_000 {
        let mut bytes = bytes.clone();
        for _ in 0..3 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let at = (state >> 33) as usize % bytes.len();
            bytes[at] = (state >> 20) as u8;
        }
        let (seen, _) = read(&bytes);
        let found: usize = seen.iter().map(|(.., bytes)| bytes.len()).sum();
        assert!(found <= bytes.len());
    }
}

/// Gives up to 1000 bytes at a time, each time after an interruption as by a signal.
struct Interrupted<'a>(&'a [u8], bool);

impl io::Read for Interrupted<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.1 = !self.1;
        if self.1 {
            return Err(io::ErrorKind::Interrupted.into());
        }
        let len = buffer.len().min(1000);
        self.0.read(&mut buffer[..len])
    }
}

#[test]
fn blocks_up_to_1_mib_are_read_whole_through_all_interruptions() {
    const HEADER: usize = 20;
    let start = with_option(false, 9, &[6], 1);
    let packet = |len: usize| {
        let lens = (len as u32).to_le_bytes().repeat(2);
        block(false, 6, &[&[0; 12][..], &lens, &vec![7; len]].concat())
    };
    let longest = (1 << 20) - 12 - HEADER;
    let bytes = [&start[..], &packet(70_000), &packet(longest), &packet(longest + 4)].concat();
    let mut reader = Reader::new(Interrupted(&bytes, false));
    for len in [3, 70_000, longest] {
        assert_eq!(reader.next().unwrap().unwrap().bytes.len(), len);
    }
    let why = "it is longer than 1 MiB";
    assert!(matches!(reader.next(), Err(Problem::Invalid { why: is, .. }) if is == why));
}

#[test]
fn a_read_error_is_a_problem() {
    let mut reader = Reader::new(File::open(std::env::temp_dir()).unwrap());
    assert!(matches!(reader.next(), Err(Problem::Io(_))));
}
