//! The host of a rover.

use axlewire::{
    endpoint::Endpoint,
    ucp::{
        Host, MotorControl,
        host::{
            CalibrationFailure, CalibrationStep, FailureCause, HostConfig, HostEvent, Link,
            MemoryStore, ReceivedReport, StopProgress,
        },
    },
};

use super::values::{
    axle_ucp_calibration, axle_ucp_err, axle_ucp_imu_bias, axle_ucp_mag_bias, axle_ucp_motor,
    axle_ucp_network_state, axle_ucp_ota_status, axle_ucp_telemetry,
};
use crate::{
    ikeya::axle_latency,
    memory::{Out, enter, get, init, read},
    result::{axle_result, of, of_encode, of_host},
    stream::axle_counters,
    time::{at, micros, optional, span},
};

/// Settings of a host. Begin with those of `axle_ucp_host_config_direct` or `_usb_adapter`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct axle_ucp_host_config {
    /// Speed of the line, bit/s; 115,200. Not less than it really is.
    pub baud: u32,
    /// Period at which the latest motor command is repeated (ruling U10); 100 ms.
    pub command_period_us: u32,
    /// Shortest pause between two different motor commands; 20 ms, at most 50.
    pub command_gap_us: u32,
    /// Silence of the application after which a robot is told to stand still (ruling U10); 500 ms.
    pub dead_man_us: u32,
    /// Period of pings; 200 ms, 0 for none.
    pub ping_period_us: u32,
    /// Time after which a ping counts as lost; 500 ms.
    pub ping_timeout_us: u32,
    /// Time without a valid frame after which the link is down (rulings U10, U16); 500 ms.
    pub link_timeout_us: u32,
    /// Time over which the robot averages its wheel speeds (ruling U16); 1100 ms.
    pub rpm_average_us: u32,
    /// Longest time for the acknowledgement of a calibration request; 200 ms.
    pub ack_timeout_us: u32,
    /// Pause that cuts off a frame, besides two byte times; 20 ms.
    pub idle_margin_us: u32,
    /// Number of times a calibration request is sent before it fails; 3.
    pub attempts: u8,
    /// Not 0 if the first frame is a zero motor command (ruling U16); 1. 0 for hosts that only
    /// listen.
    pub sends_first_stop: u8,
    /// Not 0 to send no id from 5 to 10, for robots that hang on them (ruling U14); 0.
    pub low_ids_only: u8,
}
plain!(axle_ucp_host_config);

impl From<HostConfig> for axle_ucp_host_config {
    fn from(config: HostConfig) -> Self {
        Self {
            baud: config.baud,
            command_period_us: config.command_period.as_micros(),
            command_gap_us: config.command_gap.as_micros(),
            dead_man_us: config.dead_man.as_micros(),
            ping_period_us: micros(config.ping_period),
            ping_timeout_us: config.ping_timeout.as_micros(),
            link_timeout_us: config.link_timeout.as_micros(),
            rpm_average_us: config.rpm_average.as_micros(),
            ack_timeout_us: config.ack_timeout.as_micros(),
            idle_margin_us: config.idle_margin.as_micros(),
            attempts: config.attempts,
            sends_first_stop: config.sends_first_stop.into(),
            low_ids_only: config.low_ids_only.into(),
        }
    }
}

impl From<axle_ucp_host_config> for HostConfig {
    fn from(from: axle_ucp_host_config) -> Self {
        let mut config = Self::direct();
        config.baud = from.baud;
        config.command_period = span(from.command_period_us);
        config.command_gap = span(from.command_gap_us);
        config.dead_man = span(from.dead_man_us);
        config.ping_period = optional(from.ping_period_us);
        config.ping_timeout = span(from.ping_timeout_us);
        config.link_timeout = span(from.link_timeout_us);
        config.rpm_average = span(from.rpm_average_us);
        config.ack_timeout = span(from.ack_timeout_us);
        config.idle_margin = span(from.idle_margin_us);
        config.attempts = from.attempts;
        config.sends_first_stop = from.sends_first_stop != 0;
        config.low_ids_only = from.low_ids_only != 0;
        config
    }
}

/// Settings for one of the processor's own UARTs.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_config_direct(config: *mut axle_ucp_host_config) -> axle_result {
    Out::new(config).map_or_else(|error| error, |out| out.write(HostConfig::direct().into()))
}

/// Settings for a USB adapter.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_config_usb_adapter(
    config: *mut axle_ucp_host_config,
) -> axle_result {
    Out::new(config).map_or_else(|error| error, |out| out.write(HostConfig::usb_adapter().into()))
}

/// Time within which a calibration request has been acknowledged or has failed, with these
/// settings; `UINT32_MAX` if that does not fit.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_get_calibration_bound(
    config: *const axle_ucp_host_config,
    bound_us: *mut u32,
) -> axle_result {
    let get = || {
        let (out, config) = (Out::new(bound_us)?, HostConfig::from(read(config)?));
        Ok(out.write(config.calibration_bound().as_micros()))
    };
    get().unwrap_or_else(|error| error)
}

/// A report as received.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ucp_report {
    /// What the robot measures.
    pub telemetry: axle_ucp_telemetry,
    /// Version of the robot's firmware; -1 if the layout has none.
    pub version: i32,
    /// Counter of the robot.
    pub index: u8,
    /// Number of reports missing between the previous one and this one.
    pub lost: u8,
}

impl From<ReceivedReport> for axle_ucp_report {
    fn from(report: ReceivedReport) -> Self {
        let ReceivedReport { telemetry, version, index, lost, .. } = report;
        Self { telemetry: telemetry.into(), version: version.map_or(-1, i32::from), index, lost }
    }
}

/// Most bytes in the body of an unknown frame.
pub const AXLE_UCP_BODY_MAX_LENGTH: usize = 56;

/// An event of a host. What an event has is said with its kind; all else is 0.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct axle_ucp_host_event {
    /// Time from the start of a ping to the end of its pong, microseconds.
    pub round_trip_us: u32,
    /// What was reported.
    pub report: axle_ucp_report,
    /// Biases of the inertial sensors.
    pub imu_bias: axle_ucp_imu_bias,
    /// Biases of the magnetometer.
    pub mag_bias: axle_ucp_mag_bias,
    /// One of `AXLE_UCP_HOST_`.
    pub kind: u8,
    /// Verdict on a ping, or of a robot that refused.
    pub err: axle_ucp_err,
    /// Sensors to calibrate.
    pub calibration: axle_ucp_calibration,
    /// The failed request: one of `AXLE_UCP_STEP_`.
    pub step: u8,
    /// Why: one of `AXLE_UCP_FAILURE_`.
    pub cause: u8,
    /// How often the request was sent.
    pub attempts: u8,
    /// 1 if biases of the inertial sensors are missing.
    pub imu_missing: u8,
    /// 1 if biases of the magnetometer are missing.
    pub mag_missing: u8,
    /// Answer to an update request.
    pub ota_status: axle_ucp_ota_status,
    /// Id of an unknown frame.
    pub id: u8,
    /// Its counter.
    pub index: u8,
    /// Length of its body, bytes.
    pub body_length: u8,
    /// Its body.
    pub body: [u8; AXLE_UCP_BODY_MAX_LENGTH],
}

impl Default for axle_ucp_host_event {
    fn default() -> Self {
        Self {
            round_trip_us: 0,
            report: Default::default(),
            imu_bias: Default::default(),
            mag_bias: Default::default(),
            kind: 0,
            err: 0,
            calibration: 0,
            step: 0,
            cause: 0,
            attempts: 0,
            imu_missing: 0,
            mag_missing: 0,
            ota_status: 0,
            id: 0,
            index: 0,
            body_length: 0,
            body: [0; AXLE_UCP_BODY_MAX_LENGTH],
        }
    }
}

kinds! {
    /// The name of a kind of event, such as "link_up"; "?" for another number.
    axle_ucp_host_event_name: u8;
    /// A valid frame has arrived, the first or the first after a link that was down.
    AXLE_UCP_HOST_LINK_UP = 1, c"link_up";
    /// No valid frame has arrived in time; a robot that was told to move is told to stand still
    /// (U16).
    AXLE_UCP_HOST_LINK_DOWN = 2, c"link_down";
    /// The robot answered a ping: `round_trip_us`, `err`.
    AXLE_UCP_HOST_PONG = 3, c"pong";
    /// A report: `report`.
    AXLE_UCP_HOST_REPORT = 4, c"report";
    /// The application was silent while the robot moved: it is told to stand still (ruling U10).
    AXLE_UCP_HOST_DEAD_MAN = 5, c"dead_man";
    /// The start of a calibration is acknowledged: `calibration`.
    AXLE_UCP_HOST_CALIBRATION_STARTED = 6, c"calibration_started";
    /// The end of a calibration is acknowledged, its result follows: `calibration`.
    AXLE_UCP_HOST_CALIBRATION_ENDED = 7, c"calibration_ended";
    /// A calibration request failed: `calibration`, `step`, `cause`, `err`, `attempts`.
    AXLE_UCP_HOST_CALIBRATION_FAILED = 8, c"calibration_failed";
    /// The result of a calibration, which the host keeps: `imu_bias`.
    AXLE_UCP_HOST_IMU_BIAS = 9, c"imu_bias";
    /// The result of a calibration, which the host keeps: `mag_bias`.
    AXLE_UCP_HOST_MAG_BIAS = 10, c"mag_bias";
    /// The robot has booted, and is sent the biases that the host keeps.
    AXLE_UCP_HOST_BIASES_SENT = 11, c"biases_sent";
    /// The robot has booted, but biases are missing: `imu_missing`, `mag_missing`.
    AXLE_UCP_HOST_BIASES_MISSING = 12, c"biases_missing";
    /// The robot has booted, but `low_ids_only` forbids the answer (ruling U14).
    AXLE_UCP_HOST_BIASES_NOT_ANSWERED = 13, c"biases_not_answered";
    /// A firmware update was given up: its request was not sent.
    AXLE_UCP_HOST_UPDATE_NOT_SENT = 14, c"update_not_sent";
    /// The robot answered a firmware update request: `ota_status`.
    AXLE_UCP_HOST_UPDATE_ANSWERED = 15, c"update_answered";
    /// A frame of no known message: `id`, `index`, `body`, `body_length` (ruling U3).
    AXLE_UCP_HOST_UNKNOWN = 16, c"unknown";
    /// An event that is newer than this header.
    AXLE_UCP_HOST_OTHER = 255, c"other";
}

/// The start of a calibration.
pub const AXLE_UCP_STEP_START: u8 = 1;
/// The end of a calibration.
pub const AXLE_UCP_STEP_END: u8 = 2;

kinds! {
    /// The name of a failure, such as "refused"; "?" for another number.
    axle_ucp_failure_name: u8;
    /// No answer after all attempts.
    AXLE_UCP_FAILURE_NO_ANSWER = 1, c"no_answer";
    /// The robot refused: see `err`.
    AXLE_UCP_FAILURE_REFUSED = 2, c"refused";
    /// A cause that is newer than this header.
    AXLE_UCP_FAILURE_OTHER = 255, c"other";
}

fn failed(of: CalibrationFailure) -> axle_ucp_host_event {
    let (cause, err) = match of.cause {
        FailureCause::NoAnswer => (AXLE_UCP_FAILURE_NO_ANSWER, 0),
        FailureCause::Refused(err) => (AXLE_UCP_FAILURE_REFUSED, err.into()),
        _ => (AXLE_UCP_FAILURE_OTHER, 0),
    };
    axle_ucp_host_event {
        kind: AXLE_UCP_HOST_CALIBRATION_FAILED,
        calibration: of.kind.into(),
        step: match of.step {
            CalibrationStep::Start => AXLE_UCP_STEP_START,
            CalibrationStep::End => AXLE_UCP_STEP_END,
        },
        cause,
        err,
        attempts: of.attempts,
        ..Default::default()
    }
}

impl From<HostEvent> for axle_ucp_host_event {
    fn from(event: HostEvent) -> Self {
        let of = |kind| Self { kind, ..Self::default() };
        match event {
            HostEvent::LinkUp => of(AXLE_UCP_HOST_LINK_UP),
            HostEvent::LinkDown => of(AXLE_UCP_HOST_LINK_DOWN),
            HostEvent::Pong { round_trip, err } => Self {
                round_trip_us: round_trip.as_micros(),
                err: err.into(),
                ..of(AXLE_UCP_HOST_PONG)
            },
            HostEvent::Report(report) => Self { report: report.into(), ..of(AXLE_UCP_HOST_REPORT) },
            HostEvent::DeadMan => of(AXLE_UCP_HOST_DEAD_MAN),
            HostEvent::CalibrationStarted(kind) => {
                Self { calibration: kind.into(), ..of(AXLE_UCP_HOST_CALIBRATION_STARTED) }
            }
            HostEvent::CalibrationEnded(kind) => {
                Self { calibration: kind.into(), ..of(AXLE_UCP_HOST_CALIBRATION_ENDED) }
            }
            HostEvent::CalibrationFailed(failure) => failed(failure),
            HostEvent::ImuBias(bias) => {
                Self { imu_bias: bias.into(), ..of(AXLE_UCP_HOST_IMU_BIAS) }
            }
            HostEvent::MagBias(bias) => {
                Self { mag_bias: bias.into(), ..of(AXLE_UCP_HOST_MAG_BIAS) }
            }
            HostEvent::BiasesSent => of(AXLE_UCP_HOST_BIASES_SENT),
            HostEvent::BiasesMissing { imu, mag } => Self {
                imu_missing: imu.into(),
                mag_missing: mag.into(),
                ..of(AXLE_UCP_HOST_BIASES_MISSING)
            },
            HostEvent::BiasesNotAnswered => of(AXLE_UCP_HOST_BIASES_NOT_ANSWERED),
            HostEvent::UpdateNotSent => of(AXLE_UCP_HOST_UPDATE_NOT_SENT),
            HostEvent::UpdateAnswered(status) => {
                Self { ota_status: status.into(), ..of(AXLE_UCP_HOST_UPDATE_ANSWERED) }
            }
            HostEvent::Unknown(frame) => {
                let frame = frame.as_raw();
                let mut event =
                    Self { id: frame.id, index: frame.index, ..of(AXLE_UCP_HOST_UNKNOWN) };
                for (to, byte) in event.body.iter_mut().zip(frame.body) {
                    *to = *byte;
                    event.body_length += 1;
                }
                event
            }
            // The store of this host refuses nothing.
            _ => of(AXLE_UCP_HOST_OTHER),
        }
    }
}

/// What a host knows of its robot.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ucp_robot_state {
    /// Events that were refused because the queue was full.
    pub lost_events: u32,
    /// The command in force, if `is_commanded`.
    pub command: axle_ucp_motor,
    /// Wheel speeds of a robot that still moves, turns per minute.
    pub rpm: [i16; 4],
    /// One of `AXLE_UCP_LINK_`.
    pub link: u8,
    /// How far a stop has come: one of `AXLE_UCP_STOP_` (ruling U16).
    pub stop: u8,
    /// 1 if a command is in force.
    pub is_commanded: u8,
    /// 1 if the latest stop has left.
    pub is_stop_sent: u8,
    /// 1 during a firmware update.
    pub is_updating: u8,
    /// 1 if the latest calibration request has been answered or has failed.
    pub is_calibration_over: u8,
    /// Why it has failed: one of `AXLE_UCP_FAILURE_`; 0 if it has not.
    pub calibration_failure: u8,
}

kinds! {
    /// The name of the state of a link, such as "up"; "?" for another number.
    axle_ucp_link_name: u8;
    /// Nothing heard yet.
    AXLE_UCP_LINK_WAITING = 0, c"waiting";
    /// The robot is heard.
    AXLE_UCP_LINK_UP = 1, c"up";
    /// The robot is no longer heard.
    AXLE_UCP_LINK_DOWN = 2, c"down";
}

kinds! {
    /// The name of what became of a stop, such as "due"; "?" for another number.
    axle_ucp_stop_name: u8;
    /// No stop was asked for.
    AXLE_UCP_STOP_NOT_ASKED = 0, c"not_asked";
    /// The stop has not left yet.
    AXLE_UCP_STOP_DUE = 1, c"due";
    /// The stop has left, and no report shows yet what the robot does.
    AXLE_UCP_STOP_NO_REPORTS = 2, c"no_reports";
    /// Reports show that the robot still moves: see `rpm`.
    AXLE_UCP_STOP_STILL_MOVING = 3, c"still_moving";
    /// Reports show that the robot stands still.
    AXLE_UCP_STOP_STANDING_STILL = 4, c"standing_still";
}

fn state_of(host: &Host<MemoryStore>) -> axle_ucp_robot_state {
    let (stop, rpm) = match host.stop_progress() {
        StopProgress::NotAsked => (AXLE_UCP_STOP_NOT_ASKED, [0; 4]),
        StopProgress::Due => (AXLE_UCP_STOP_DUE, [0; 4]),
        StopProgress::NoReports => (AXLE_UCP_STOP_NO_REPORTS, [0; 4]),
        StopProgress::StillMoving { rpm } => (AXLE_UCP_STOP_STILL_MOVING, rpm),
        StopProgress::StandingStill => (AXLE_UCP_STOP_STANDING_STILL, [0; 4]),
    };
    let calibration = host.calibration_outcome();
    axle_ucp_robot_state {
        lost_events: host.lost_events(),
        command: host.command().map(Into::into).unwrap_or_default(),
        rpm,
        link: match host.link() {
            Link::Waiting => AXLE_UCP_LINK_WAITING,
            Link::Up => AXLE_UCP_LINK_UP,
            Link::Down => AXLE_UCP_LINK_DOWN,
        },
        stop,
        is_commanded: host.command().is_some().into(),
        is_stop_sent: host.is_stop_sent().into(),
        is_updating: host.is_updating().into(),
        is_calibration_over: calibration.is_some().into(),
        calibration_failure: calibration
            .and_then(Result::err)
            .map_or(0, |failure| failed(failure).cause),
    }
}

/// Counts of a host.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ucp_host_statistics {
    /// Motor commands sent.
    pub commands: u32,
    /// Reports received.
    pub reports: u32,
    /// Reports missing, by their counter.
    pub reports_lost: u32,
    /// Reports that came twice.
    pub reports_repeated: u32,
    /// Pings sent.
    pub pings: u32,
    /// Pings without a pong.
    pub pings_lost: u32,
    /// Pongs that tell of a damaged ping, or have another code than 0.
    pub pings_damaged: u32,
    /// Pongs that nobody asked for.
    pub pongs_unasked: u32,
    /// How often the link went down.
    pub links_lost: u32,
    /// How often the dead-man has fired.
    pub dead_man: u32,
    /// Requests for biases received.
    pub bias_requests: u32,
    /// Biases sent.
    pub biases: u32,
    /// Results that came again.
    pub results_repeated: u32,
    /// Results for which the event queue had no room.
    pub results_without_room: u32,
    /// Calibration requests that failed.
    pub calibration_failures: u32,
    /// Calibration requests that were repeated.
    pub calibration_retries: u32,
    /// Acknowledgements that nobody asked for.
    pub acks_unasked: u32,
    /// Messages that only a host sends.
    pub misdirected: u32,
    /// Frames of no known message.
    pub unknown: u32,
    /// From the start of a ping to the end of its pong.
    pub round_trip: axle_latency,
}

fn statistics_of(host: &Host<MemoryStore>) -> axle_ucp_host_statistics {
    let of = host.statistics();
    axle_ucp_host_statistics {
        commands: of.commands,
        reports: of.reports,
        reports_lost: of.reports_lost,
        reports_repeated: of.reports_repeated,
        pings: of.pings,
        pings_lost: of.pings_lost,
        pings_damaged: of.pings_damaged,
        pongs_unasked: of.pongs_unasked,
        links_lost: of.links_lost,
        dead_man: of.dead_man,
        bias_requests: of.bias_requests,
        biases: of.biases,
        results_repeated: of.results_repeated,
        results_without_room: of.results_without_room,
        calibration_failures: of.calibration_failures,
        calibration_retries: of.calibration_retries,
        acks_unasked: of.acks_unasked,
        misdirected: of.misdirected,
        unknown: of.unknown,
        round_trip: of.round_trip.into(),
    }
}

object! {
    /// The host of a rover, which keeps its biases.
    axle_ucp_host, AXLE_UCP_HOST_SIZE = 1976, 247 words of Host<MemoryStore>, b"axHo"
}

/// Makes a host without biases. `size` is `sizeof *host`. Never call it during another call with
/// the same object.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_init(
    host: *mut axle_ucp_host,
    size: usize,
    config: *const axle_ucp_host_config,
    now_us: u64,
) -> axle_result {
    init(host, size, || {
        Ok(Host::with_store(read(config)?.into(), MemoryStore::default(), at(now_us)))
    })
}

endpoint!(axle_ucp_host:
    axle_ucp_host_handle_input axle_ucp_host_handle_old_input
    axle_ucp_host_handle_timeout axle_ucp_host_poll_transmit
    axle_ucp_host_handle_transmit axle_ucp_host_is_outdated
    axle_ucp_host_next_deadline axle_ucp_host_get_line_rules);

/// The next event; `AXLE_NONE` if there is none. Take them all before `poll_transmit`.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_poll_event(
    host: *mut axle_ucp_host,
    event: *mut axle_ucp_host_event,
) -> axle_result {
    get(host, event, |host| host.poll_event().map(Into::into))
}

fn call(
    host: *mut axle_ucp_host,
    call: impl FnOnce(&mut Host<MemoryStore>) -> axle_result,
) -> axle_result {
    enter(host, call).unwrap_or_else(|error| error)
}

fn drive(
    host: *mut axle_ucp_host,
    command: Result<MotorControl, axlewire::error::EncodeError>,
    now_us: u64,
) -> axle_result {
    match command {
        Ok(command) => call(host, |host| of(host.drive(command, at(now_us)).map_err(of_host))),
        Err(error) => of_encode(error),
    }
}

/// Drives at this speed and turn, percent, until the next command; the lamp is off. The host
/// repeats it; call again within the time of the dead-man (rulings U6, U10).
///
/// Fails with `AXLE_ERROR_PERCENT`, `AXLE_ERROR_LINK_DOWN` or `AXLE_ERROR_UPDATING`.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_set_speed(
    host: *mut axle_ucp_host,
    speed_pct: i16,
    turn_pct: i16,
    now_us: u64,
) -> axle_result {
    drive(host, MotorControl::new(speed_pct, turn_pct), now_us)
}

/// The same with the lamp.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_drive(
    host: *mut axle_ucp_host,
    command: axle_ucp_motor,
    now_us: u64,
) -> axle_result {
    let motor = MotorControl::new(command.speed_pct, command.turn_pct);
    drive(host, motor.map(|motor| motor.with_front_led(command.lamp != 0)), now_us)
}

/// Time after a stop in which a rover is seen to stand still, microseconds: 2 s to coast, and one
/// more until the average that it reports shows it.
pub const AXLE_UCP_COAST_US: u32 = 3_000_000;

const _: () = assert!(AXLE_UCP_COAST_US == axlewire::ucp::host::COAST.as_micros());

/// Tells the robot to stand still, again and again, until reports show that it does (ruling U16).
///
/// `get_robot_state` tells how far it is. After `AXLE_UCP_COAST_US`, a robot that is not seen to
/// stand still may be moving.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_stop(host: *mut axle_ucp_host, now_us: u64) -> axle_result {
    of(enter(host, |host| host.stop(at(now_us))))
}

/// Asks the robot to start a calibration; an event tells (ruling U11).
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_start_calibration(
    host: *mut axle_ucp_host,
    calibration: axle_ucp_calibration,
    now_us: u64,
) -> axle_result {
    call(host, |host| of(host.start_calibration(calibration.into(), at(now_us)).map_err(of_host)))
}

/// Asks the robot to end a calibration; events tell of that and of the result (ruling U11).
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_end_calibration(
    host: *mut axle_ucp_host,
    calibration: axle_ucp_calibration,
    now_us: u64,
) -> axle_result {
    call(host, |host| of(host.end_calibration(calibration.into(), at(now_us)).map_err(of_host)))
}

/// Tells the robot the state of the network, for its lamp (ruling U8).
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_set_network_state(
    host: *mut axle_ucp_host,
    state: axle_ucp_network_state,
    now_us: u64,
) -> axle_result {
    call(host, |host| of(host.set_network_state(state.into(), at(now_us)).map_err(of_host)))
}

/// Asks the robot for a firmware update to this version, once it is seen to stand still. The robot
/// then answers no more: the application takes the port (ruling U7).
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_start_firmware_update(
    host: *mut axle_ucp_host,
    version: i16,
    now_us: u64,
) -> axle_result {
    call(host, |host| of(host.start_firmware_update(version, at(now_us)).map_err(of_host)))
}

/// Ends a firmware update: the host speaks to the robot again.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_end_firmware_update(
    host: *mut axle_ucp_host,
    now_us: u64,
) -> axle_result {
    of(enter(host, |host| host.end_firmware_update(at(now_us))))
}

/// What is known of the robot.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_get_robot_state(
    host: *const axle_ucp_host,
    state: *mut axle_ucp_robot_state,
) -> axle_result {
    get(host, state, |host| Some(state_of(host)))
}

/// The latest report, once; `AXLE_NONE` if there is no new one. It need not be polled as an event.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_take_report(
    host: *mut axle_ucp_host,
    report: *mut axle_ucp_report,
) -> axle_result {
    get(host, report, |host| host.take_report().map(Into::into))
}

/// The latest report, however old; `AXLE_NONE` if there is none.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_get_report(
    host: *const axle_ucp_host,
    report: *mut axle_ucp_report,
) -> axle_result {
    get(host, report, |host| host.last_report().copied().map(Into::into))
}

/// Time of the latest ping to its pong, once, microseconds; `AXLE_NONE` if there is no new one.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_take_round_trip(
    host: *mut axle_ucp_host,
    round_trip_us: *mut u32,
) -> axle_result {
    get(host, round_trip_us, |host| host.take_round_trip().map(|span| span.as_micros()))
}

/// Gives the host the biases that a program has kept: a robot that boots asks for them.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_set_imu_bias(
    host: *mut axle_ucp_host,
    bias: axle_ucp_imu_bias,
) -> axle_result {
    of(enter(host, |host| host.store_mut().imu = Some(bias.into())))
}

/// The same for the magnetometer.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_set_mag_bias(
    host: *mut axle_ucp_host,
    bias: axle_ucp_mag_bias,
) -> axle_result {
    of(enter(host, |host| host.store_mut().mag = Some(bias.into())))
}

/// The biases that the host keeps, for a program that stores them: those of the latest calibration,
/// which the robot was told are kept, or those that were set; `AXLE_NONE` if there are none.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_get_imu_bias(
    host: *const axle_ucp_host,
    bias: *mut axle_ucp_imu_bias,
) -> axle_result {
    get(host, bias, |host| host.store_mut().imu.map(Into::into))
}

/// The same of the magnetometer.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_get_mag_bias(
    host: *const axle_ucp_host,
    bias: *mut axle_ucp_mag_bias,
) -> axle_result {
    get(host, bias, |host| host.store_mut().mag.map(Into::into))
}

/// The counts so far.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_get_statistics(
    host: *const axle_ucp_host,
    counts: *mut axle_ucp_host_statistics,
) -> axle_result {
    get(host, counts, |host| Some(statistics_of(host)))
}

/// The account of the bytes received.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_host_get_counters(
    host: *const axle_ucp_host,
    account: *mut axle_counters,
) -> axle_result {
    get(host, account, |host| Some(host.counters().into()))
}
