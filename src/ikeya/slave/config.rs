//! Settings of a slave.

use crate::{
    ikeya::units::{BAUD, speed},
    time::{Duration, wire_time},
};

/// Settings of a [`Slave`](crate::ikeya::Slave): start from [`direct`](Self::direct) or
/// [`usb_adapter`](Self::usb_adapter) and change what differs.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct SlaveConfig {
    /// Speed of the line, bit/s; 0 counts as 500,000.
    pub baud: u32,
    /// Time without a valid command before [`SlaveEvent::Watchdog`](super::SlaveEvent::Watchdog).
    /// The protocol document defines none, so the default is `None`: **a motor then keeps its last
    /// command forever.**
    pub watchdog: Option<Duration>,
    /// Silence kept between a request and its answer, for transceivers that need it. Together with
    /// the processing time it should stay below 50 µs (ruling I9).
    pub turnaround_gap: Duration,
    /// Silence after which an incomplete packet is given up (ruling B3); less than the time of
    /// five bytes counts as that. Must exceed the longest pause that the port makes inside a
    /// packet.
    pub idle: Duration,
    /// Time during which an answer may still be sent, from the end of the request plus
    /// [`turnaround_gap`](Self::turnaround_gap) (ruling I14): after it the master has given up,
    /// and may be asking another node.
    ///
    /// A driver that has not seen its port empty for this long (at least 4 ms, at most 20 ms)
    /// treats the bytes it finds as received when it last did.
    pub answer_within: Duration,
    /// Whether the slaves on this line hear each other, as on two wires (ruling I14): the slave
    /// then follows answers as well, and finds no request inside one.
    pub two_wire: bool,
}

impl SlaveConfig {
    /// For one of the processor's own UARTs at 500 kbit/s: a pause of five bytes ends a packet.
    #[must_use]
    pub const fn direct() -> Self {
        Self::at(BAUD)
    }

    /// For one of the processor's own UARTs at another speed, bit/s.
    #[must_use]
    pub const fn at(baud: u32) -> Self {
        Self {
            baud,
            watchdog: None,
            turnaround_gap: Duration::ZERO,
            idle: wire_time(5, baud),
            answer_within: Duration::from_micros(500),
            two_wire: false,
        }
    }

    /// The same settings, as a slave can work with them.
    pub(super) fn sane(self) -> Self {
        let baud = speed(self.baud);
        Self { baud, idle: self.idle.max(wire_time(5, baud)), ..self }
    }

    /// For a slave on a host: a USB adapter makes pauses of up to 16 ms.
    #[must_use]
    pub const fn usb_adapter() -> Self {
        let pause = Duration::from_millis(20);
        Self { idle: pause, answer_within: pause, ..Self::direct() }
    }
}

/// Same as [`direct`](SlaveConfig::direct).
impl Default for SlaveConfig {
    fn default() -> Self {
        Self::direct()
    }
}
