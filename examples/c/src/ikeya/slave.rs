//! A slave of a motor bus.

use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        Slave,
        board::{OneMotor, ThreeMotors},
        slave::{DipSwitch, IdReading, SlaveConfig, SlaveEvent, SlaveStatistics},
    },
};

use super::{
    Motors, axle_ikeya_mode, axle_ikeya_motion, axle_ikeya_position, mode_from, mode_of, node_from,
};
use crate::{
    memory::{Out, enter, get, init, read},
    result::{AXLE_ERROR_VALUE, AXLE_OK, axle_result, of, of_encode},
    stream::axle_counters,
    time::{at, micros, optional, span},
};

/// Settings of a slave. Begin with those of `axle_ikeya_slave_config_direct` or `_usb_adapter`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct axle_ikeya_slave_config {
    /// Speed of the line, bit/s; 0 counts as 500,000.
    pub baud: u32,
    /// Time without a valid command before `AXLE_IKEYA_SLAVE_WATCHDOG`; 0, the default, for none:
    /// a motor then keeps its last command forever.
    pub watchdog_us: u32,
    /// Silence between a request and its answer; with the processing below 50 us (ruling I9).
    pub turnaround_gap_us: u32,
    /// Silence after which an incomplete packet is given up (ruling B3).
    pub idle_us: u32,
    /// Time during which an answer may still be sent (ruling I14).
    pub answer_within_us: u32,
    /// Not 0 if the slaves on this line hear each other's answers, as on RS485 with one pair of
    /// wires; 0, the default, on two pairs (ruling I14).
    pub two_wire: u8,
}
plain!(axle_ikeya_slave_config);

impl From<SlaveConfig> for axle_ikeya_slave_config {
    fn from(config: SlaveConfig) -> Self {
        Self {
            baud: config.baud,
            watchdog_us: micros(config.watchdog),
            turnaround_gap_us: config.turnaround_gap.as_micros(),
            idle_us: config.idle.as_micros(),
            answer_within_us: config.answer_within.as_micros(),
            two_wire: config.two_wire.into(),
        }
    }
}

impl From<axle_ikeya_slave_config> for SlaveConfig {
    fn from(from: axle_ikeya_slave_config) -> Self {
        let mut config = Self::direct();
        config.baud = from.baud;
        config.watchdog = optional(from.watchdog_us);
        config.turnaround_gap = span(from.turnaround_gap_us);
        config.idle = span(from.idle_us);
        config.answer_within = span(from.answer_within_us);
        config.two_wire = from.two_wire != 0;
        config
    }
}

/// Settings for one of the processor's own UARTs at 500 kbit/s.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_slave_config_direct(
    config: *mut axle_ikeya_slave_config,
) -> axle_result {
    Out::new(config).map_or_else(|error| error, |out| out.write(SlaveConfig::direct().into()))
}

/// Settings for a slave on a host: a USB adapter makes pauses of up to 16 ms.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_slave_config_usb_adapter(
    config: *mut axle_ikeya_slave_config,
) -> axle_result {
    Out::new(config).map_or_else(|error| error, |out| out.write(SlaveConfig::usb_adapter().into()))
}

/// An event of a slave.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct axle_ikeya_slave_event {
    /// One of `AXLE_IKEYA_SLAVE_`.
    pub kind: u8,
    /// The command.
    pub motion: axle_ikeya_motion,
}

kinds! {
    /// The name of a kind of event, such as "watchdog"; "?" for another number.
    axle_ikeya_slave_event_name: u8;
    /// A command: `motion`.
    AXLE_IKEYA_SLAVE_COMMAND = 1, c"command";
    /// No valid command for the time of the watchdog: stop the motor.
    AXLE_IKEYA_SLAVE_WATCHDOG = 2, c"watchdog";
    /// An event that is newer than this header.
    AXLE_IKEYA_SLAVE_OTHER = 255, c"other";
}

impl<B: Motors> From<SlaveEvent<B>> for axle_ikeya_slave_event {
    fn from(event: SlaveEvent<B>) -> Self {
        match event {
            SlaveEvent::Command(target) => {
                let motion = axle_ikeya_motion::of_target(target);
                Self { kind: AXLE_IKEYA_SLAVE_COMMAND, motion }
            }
            SlaveEvent::Watchdog => Self { kind: AXLE_IKEYA_SLAVE_WATCHDOG, ..Self::default() },
            _ => Self { kind: AXLE_IKEYA_SLAVE_OTHER, ..Self::default() },
        }
    }
}

/// Counts of a slave.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ikeya_slave_statistics {
    /// READs of this node.
    pub reads: u32,
    /// WRITEs of this node.
    pub writes: u32,
    /// Of these, refused: a speed that is not a finite number (ruling I4).
    pub refused: u32,
    /// Packets of other nodes.
    pub foreign: u32,
    /// Answers of other nodes, on two wires, and its own if it hears them.
    pub answers: u32,
    /// Answers sent.
    pub replies: u32,
    /// Requests that were overtaken by others before they were answered.
    pub overtaken: u32,
    /// Answers that would have come too late, and were not sent.
    pub expired: u32,
    /// How often the watchdog has fired.
    pub watchdog: u32,
    /// Events that were refused because the queue was full.
    pub lost_events: u32,
}

fn statistics_of<B: Motors>(slave: &Slave<B>) -> axle_ikeya_slave_statistics {
    let SlaveStatistics {
        reads,
        writes,
        refused,
        foreign,
        answers,
        replies,
        overtaken,
        expired,
        watchdog,
        ..
    } = *slave.statistics();
    axle_ikeya_slave_statistics {
        reads,
        writes,
        refused,
        foreign,
        answers,
        replies,
        overtaken,
        expired,
        watchdog,
        lost_events: slave.lost_events(),
    }
}

/// The id of the DIP switches is their value plus 1 (ruling I2).
pub const AXLE_IKEYA_ID_VALUE_PLUS_ONE: u8 = 1;
/// The id of the DIP switches is their value (ruling I2).
pub const AXLE_IKEYA_ID_VALUE: u8 = 2;

/// Reads four DIP switches, one bit each: the id of the node and its mode (ruling I2).
///
/// `reading` is `AXLE_IKEYA_ID_VALUE_PLUS_ONE` or `AXLE_IKEYA_ID_VALUE`.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_dip_switches(
    switches: u8,
    reading: u8,
    node: *mut u8,
    mode: *mut axle_ikeya_mode,
) -> axle_result {
    let get = || {
        let (node, mode) = (Out::new(node)?, Out::new(mode)?);
        let reading = match reading {
            AXLE_IKEYA_ID_VALUE_PLUS_ONE => IdReading::ValuePlusOne,
            AXLE_IKEYA_ID_VALUE => IdReading::Value,
            _ => return Err(AXLE_ERROR_VALUE),
        };
        let dip = DipSwitch::from_bits(switches).map_err(of_encode)?;
        let id = dip.node_id(reading).map_err(of_encode)?;
        node.write(id.get());
        Ok(mode.write(mode_of(dip.mode())))
    };
    get().unwrap_or_else(|error| error)
}

object! {
    /// A slave with one motor.
    axle_ikeya_slave, AXLE_IKEYA_SLAVE_SIZE = 360, 45 words of Slave<OneMotor>, b"axS1"
}

object! {
    /// A slave with three motors.
    axle_ikeya3_slave, AXLE_IKEYA3_SLAVE_SIZE = 392, 49 words of Slave<ThreeMotors>, b"axS3"
}

/// The functions of a slave with these names, besides those of every role.
macro_rules! slave {
    ($slave:ident: $init:ident $event:ident $command:ident $mode:ident $set_mode:ident
        $statistics:ident $counters:ident) => {
        /// Makes a slave with this id, 1 to 8, in this mode. `size` is `sizeof *slave`. Never call
        /// it during another call with the same object.
        #[unsafe(no_mangle)]
        pub extern "C" fn $init(
            slave: *mut $slave,
            size: usize,
            node: u8,
            mode: axle_ikeya_mode,
            config: *const axle_ikeya_slave_config,
            now_us: u64,
        ) -> axle_result {
            init(slave, size, || {
                let (node, mode) = (node_from(node)?, mode_from(mode)?);
                Ok(Slave::for_board(node, mode, read(config)?.into(), at(now_us)))
            })
        }

        /// The next event; `AXLE_NONE` if there is none.
        #[unsafe(no_mangle)]
        pub extern "C" fn $event(
            slave: *mut $slave,
            event: *mut axle_ikeya_slave_event,
        ) -> axle_result {
            get(slave, event, |slave| slave.poll_event().map(Into::into))
        }

        /// The command in force; `AXLE_NONE` if there is none, or if it is too old for the
        /// watchdog: the motor must then be at rest. Correct at any time.
        #[unsafe(no_mangle)]
        pub extern "C" fn $command(
            slave: *const $slave,
            now_us: u64,
            command: *mut axle_ikeya_motion,
        ) -> axle_result {
            get(slave, command, |slave| slave.command(at(now_us)).map(axle_ikeya_motion::of_target))
        }

        /// The mode, one of `AXLE_IKEYA_MODE_`.
        #[unsafe(no_mangle)]
        pub extern "C" fn $mode(slave: *const $slave, mode: *mut axle_ikeya_mode) -> axle_result {
            get(slave, mode, |slave| Some(mode_of(slave.mode())))
        }

        /// Changes the mode; the command in force ends.
        #[unsafe(no_mangle)]
        pub extern "C" fn $set_mode(slave: *mut $slave, mode: axle_ikeya_mode) -> axle_result {
            match mode_from(mode) {
                Ok(mode) => of(enter(slave, |slave| slave.set_mode(mode))),
                Err(error) => error,
            }
        }

        /// The counts so far.
        #[unsafe(no_mangle)]
        pub extern "C" fn $statistics(
            slave: *const $slave,
            counts: *mut axle_ikeya_slave_statistics,
        ) -> axle_result {
            get(slave, counts, |slave| Some(statistics_of(slave)))
        }

        /// The account of the bytes received.
        #[unsafe(no_mangle)]
        pub extern "C" fn $counters(
            slave: *const $slave,
            account: *mut axle_counters,
        ) -> axle_result {
            get(slave, account, |slave| Some(slave.counters().into()))
        }
    };
}

slave!(axle_ikeya_slave:
    axle_ikeya_slave_init axle_ikeya_slave_poll_event axle_ikeya_slave_get_command
    axle_ikeya_slave_get_mode axle_ikeya_slave_set_mode axle_ikeya_slave_get_statistics
    axle_ikeya_slave_get_counters);
endpoint!(axle_ikeya_slave:
    axle_ikeya_slave_handle_input axle_ikeya_slave_handle_old_input
    axle_ikeya_slave_handle_timeout axle_ikeya_slave_poll_transmit
    axle_ikeya_slave_handle_transmit axle_ikeya_slave_is_outdated
    axle_ikeya_slave_next_deadline axle_ikeya_slave_get_line_rules);
slave!(axle_ikeya3_slave:
    axle_ikeya3_slave_init axle_ikeya3_slave_poll_event axle_ikeya3_slave_get_command
    axle_ikeya3_slave_get_mode axle_ikeya3_slave_set_mode axle_ikeya3_slave_get_statistics
    axle_ikeya3_slave_get_counters);
endpoint!(axle_ikeya3_slave:
    axle_ikeya3_slave_handle_input axle_ikeya3_slave_handle_old_input
    axle_ikeya3_slave_handle_timeout axle_ikeya3_slave_poll_transmit
    axle_ikeya3_slave_handle_transmit axle_ikeya3_slave_is_outdated
    axle_ikeya3_slave_next_deadline axle_ikeya3_slave_get_line_rules);

fn set_velocity<B: Motors>(slave: &mut Slave<B>, rps: [f32; 3]) -> axle_result {
    match B::velocity(rps) {
        Ok(rps) => {
            slave.set_velocity(rps);
            AXLE_OK
        }
        Err(error) => of_encode(error),
    }
}

/// Sets the speed that is measured, turns per second, for the next answers in velocity mode.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_slave_set_velocity(
    slave: *mut axle_ikeya_slave,
    rps: f32,
) -> axle_result {
    enter(slave, |slave| set_velocity(slave, [rps, 0.0, 0.0])).unwrap_or_else(|error| error)
}

/// Sets the position that is measured, for the next answers in position mode.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_slave_set_position(
    slave: *mut axle_ikeya_slave,
    position: axle_ikeya_position,
) -> axle_result {
    of(enter(slave, |slave| slave.set_position(position.into())))
}

/// The same for three motors; `rps` has three elements.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya3_slave_set_velocity(
    slave: *mut axle_ikeya3_slave,
    rps: *const f32,
) -> axle_result {
    match read(rps.cast::<[f32; 3]>()) {
        Ok(rps) => enter(slave, |slave| set_velocity(slave, rps)).unwrap_or_else(|error| error),
        Err(error) => error,
    }
}

/// The same for three motors; `positions` has three elements.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya3_slave_set_position(
    slave: *mut axle_ikeya3_slave,
    positions: *const axle_ikeya_position,
) -> axle_result {
    match read(positions.cast::<[axle_ikeya_position; 3]>()) {
        Ok(to) => of(enter(slave, |slave| slave.set_position(to.map(Into::into)))),
        Err(error) => error,
    }
}
