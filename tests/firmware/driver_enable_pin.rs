//! The driver-enable pin, from QEMU's log of every access to a register: the images as shipped.

/// The relevant kinds of access.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Access {
    /// PA8, the driver-enable pin.
    PinOn,
    PinOff,
    /// A byte is written to the data register of USART1.
    Sent(u8),
    /// The interrupt has nothing left to send, or is asked to send.
    Fed,
    /// The status of USART1 is read: has the last stop bit left?
    Status,
    /// The alarm is set, before a sleep.
    Sleep,
}

impl Access {
    /// Parses a line such as
    /// `memory_region_ops_write cpu 0 mr 0x.. addr 0x40011004 value 0x55 size 4`.
    fn parse(line: &str) -> Option<Self> {
        let mut words = line.split_ascii_whitespace();
        let is_write = match words.next()? {
            "memory_region_ops_write" => true,
            "memory_region_ops_read" => false,
            _ => return None,
        };
        let mut number = |name| {
            words.find(|&word| word == name)?;
            u64::from_str_radix(words.next()?.strip_prefix("0x")?, 16).ok()
        };
        let (address, value) = (number("addr")?, number("value")?);
        match (address, is_write) {
            // The lower half sets pins, the upper half resets them.
            (0x4002_0018, true) if value & 1 << 8 != 0 => Some(Self::PinOn),
            (0x4002_0018, true) if value & 1 << 24 != 0 => Some(Self::PinOff),
            (0x4001_1004, true) => Some(Self::Sent(value as u8)),
            (0x4001_100C, true) => Some(Self::Fed),
            (0x4001_1000, false) => Some(Self::Status),
            (0xE000_E014, true) => Some(Self::Sleep),
            _ => None,
        }
    }
}

/// The bytes sent each time the pin was on.
///
/// # Panics
///
/// If the pin was off while a byte was sent, on while nothing was sent, went off before the USART
/// was asked whether the last stop bit had left, or was still on when the processor went to sleep.
pub(crate) fn bursts(log: &str) -> Vec<Vec<u8>> {
    let mut bursts = Vec::new();
    let (mut burst, mut is_asked, mut sleeps) = (None, false, 0);
    for access in log.lines().filter_map(Access::parse) {
        match (access, &mut burst) {
            (Access::PinOn, None) => (burst, is_asked) = (Some(Vec::new()), false),
            (Access::PinOn, Some(sent)) => panic!("switched on again after {sent:02X?}"),
            (Access::Sent(byte), Some(sent)) => sent.push(byte),
            (Access::Sent(byte), None) => panic!("{byte:02X} sent with the pin off"),
            (Access::Fed, _) => is_asked = false,
            (Access::Status, _) => is_asked = true,
            (Access::PinOff, Some(sent)) => {
                assert!(!sent.is_empty(), "on without a byte, after {} bursts", bursts.len());
                assert!(is_asked, "off without checking the last stop bit of {sent:02X?}");
                bursts.push(burst.take().unwrap());
            }
            // Once, when the port is created.
            (Access::PinOff, None) => assert!(bursts.is_empty(), "off twice"),
            (Access::Sleep, None) => sleeps += 1,
            (Access::Sleep, Some(sent)) => panic!("asleep with the pin on after {sent:02X?}"),
        }
    }
    // Cut off when QEMU ended, at most inside one burst.
    assert!(sleeps > 0, "the log is empty");
    bursts
}
