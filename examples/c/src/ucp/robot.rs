//! The robot.

use axlewire::{
    endpoint::Endpoint,
    ucp::{
        Robot,
        message::Biases,
        robot::{ReportLayout, RobotConfig, RobotEvent, UpdateSource},
    },
};

use super::values::{
    axle_ucp_calibration, axle_ucp_err, axle_ucp_imu_bias, axle_ucp_mag_bias, axle_ucp_motor,
    axle_ucp_network_state, axle_ucp_ota_status, axle_ucp_telemetry,
};
use crate::{
    memory::{Out, enter, get, init, read},
    result::{AXLE_NONE, AXLE_OK, axle_result, of},
    stream::axle_counters,
    time::{at, micros, optional, span},
};

/// Settings of a robot. Begin with those of `axle_ucp_robot_config_direct` or `_usb_adapter`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct axle_ucp_robot_config {
    /// Speed of the line, bit/s; 115,200.
    pub baud: u32,
    /// Time without a valid command after which speed and turn become 0 (ruling U10); 500 ms.
    pub watchdog_us: u32,
    /// Period of reports (ruling U10); 20 ms.
    pub report_period_us: u32,
    /// Period at which a calibration result is repeated (ruling U11); 1000 ms.
    pub result_period_us: u32,
    /// Period of requests for biases (ruling U11); 1000 ms, 0 for none.
    pub bias_request_period_us: u32,
    /// Pause that cuts off a frame, besides two byte times; 5 ms.
    pub idle_margin_us: u32,
    /// Version of the firmware in reports (ruling U5); -1 for the layout of the document, without.
    pub version: i32,
}
plain!(axle_ucp_robot_config);

impl From<RobotConfig> for axle_ucp_robot_config {
    fn from(config: RobotConfig) -> Self {
        Self {
            baud: config.baud,
            watchdog_us: config.watchdog.as_micros(),
            report_period_us: config.report_period.as_micros(),
            result_period_us: config.result_period.as_micros(),
            bias_request_period_us: micros(config.bias_request_period),
            idle_margin_us: config.idle_margin.as_micros(),
            version: match config.layout {
                ReportLayout::Firmware { version } => version.into(),
                ReportLayout::Document => -1,
            },
        }
    }
}

impl TryFrom<axle_ucp_robot_config> for RobotConfig {
    type Error = axle_result;

    fn try_from(from: axle_ucp_robot_config) -> Result<Self, axle_result> {
        let mut config = Self::direct();
        config.baud = from.baud;
        config.watchdog = span(from.watchdog_us);
        config.report_period = span(from.report_period_us);
        config.result_period = span(from.result_period_us);
        config.bias_request_period = optional(from.bias_request_period_us);
        config.idle_margin = span(from.idle_margin_us);
        config.layout = match from.version {
            -1 => ReportLayout::Document,
            version => match version.try_into() {
                Ok(version) => ReportLayout::Firmware { version },
                Err(_) => return Err(crate::result::AXLE_ERROR_VALUE),
            },
        };
        Ok(config)
    }
}

/// Settings for one of the processor's own UARTs.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_config_direct(config: *mut axle_ucp_robot_config) -> axle_result {
    Out::new(config).map_or_else(|error| error, |out| out.write(RobotConfig::direct().into()))
}

/// Settings for a robot on a host.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_config_usb_adapter(
    config: *mut axle_ucp_robot_config,
) -> axle_result {
    Out::new(config).map_or_else(|error| error, |out| out.write(RobotConfig::usb_adapter().into()))
}

/// An event of a robot. What an event has is said with its kind; all else is 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ucp_robot_event {
    /// State of the host's network.
    pub network_state: axle_ucp_network_state,
    /// The command.
    pub command: axle_ucp_motor,
    /// Biases of the inertial sensors.
    pub imu_bias: axle_ucp_imu_bias,
    /// Biases of the magnetometer.
    pub mag_bias: axle_ucp_mag_bias,
    /// The version offered.
    pub version: i16,
    /// One of `AXLE_UCP_ROBOT_`.
    pub kind: u8,
    /// The verdict with the biases.
    pub err: axle_ucp_err,
    /// Sensors to calibrate.
    pub calibration: axle_ucp_calibration,
    /// 1 if this calibration is already running.
    pub is_repeated: u8,
    /// 1 if an update was asked for by a motor command (ruling U7), not by a request.
    pub by_motor_command: u8,
}

kinds! {
    /// The name of a kind of event, such as "motor"; "?" for another number.
    axle_ucp_robot_event_name: u8;
    /// The command has changed: `command`. To move the robot, use `axle_ucp_robot_get_command`.
    AXLE_UCP_ROBOT_MOTOR = 1, c"motor";
    /// No valid command for the time of the watchdog: speed and turn are 0 (ruling U10).
    AXLE_UCP_ROBOT_WATCHDOG = 2, c"watchdog";
    /// A calibration is to start: `calibration`, `is_repeated`.
    AXLE_UCP_ROBOT_CALIBRATION_START = 3, c"calibration_start";
    /// The calibration is to end, and its result to be handed in: `calibration`.
    AXLE_UCP_ROBOT_CALIBRATION_END = 4, c"calibration_end";
    /// The host has the biases of the inertial sensors.
    AXLE_UCP_ROBOT_IMU_BIAS_TAKEN = 5, c"imu_bias_taken";
    /// The host has the biases of the magnetometer.
    AXLE_UCP_ROBOT_MAG_BIAS_TAKEN = 6, c"mag_bias_taken";
    /// The host has sent its stored biases: `imu_bias`, `mag_bias`, `err`.
    AXLE_UCP_ROBOT_BIASES = 7, c"biases";
    /// State of the host's network: `network_state`.
    AXLE_UCP_ROBOT_NETWORK_STATE = 8, c"network_state";
    /// The host asks for a firmware update: `version`, `by_motor_command`.
    AXLE_UCP_ROBOT_UPDATE_REQUESTED = 9, c"update_requested";
    /// An event that is newer than this header.
    AXLE_UCP_ROBOT_OTHER = 255, c"other";
}

fn biases(of: Biases) -> axle_ucp_robot_event {
    axle_ucp_robot_event {
        kind: AXLE_UCP_ROBOT_BIASES,
        imu_bias: of.imu().into(),
        mag_bias: of.mag().into(),
        err: of.err().into(),
        ..Default::default()
    }
}

impl From<RobotEvent> for axle_ucp_robot_event {
    fn from(event: RobotEvent) -> Self {
        let of = |kind| Self { kind, ..Self::default() };
        match event {
            RobotEvent::Motor(command) => {
                Self { command: command.into(), ..of(AXLE_UCP_ROBOT_MOTOR) }
            }
            RobotEvent::Watchdog => of(AXLE_UCP_ROBOT_WATCHDOG),
            RobotEvent::CalibrationStart { kind, repeated } => Self {
                calibration: kind.into(),
                is_repeated: repeated.into(),
                ..of(AXLE_UCP_ROBOT_CALIBRATION_START)
            },
            RobotEvent::CalibrationEnd(kind) => {
                Self { calibration: kind.into(), ..of(AXLE_UCP_ROBOT_CALIBRATION_END) }
            }
            RobotEvent::ImuBiasTaken => of(AXLE_UCP_ROBOT_IMU_BIAS_TAKEN),
            RobotEvent::MagBiasTaken => of(AXLE_UCP_ROBOT_MAG_BIAS_TAKEN),
            RobotEvent::Biases(sent) => biases(sent),
            RobotEvent::NetworkState(state) => {
                Self { network_state: state.into(), ..of(AXLE_UCP_ROBOT_NETWORK_STATE) }
            }
            RobotEvent::UpdateRequested { version, by } => Self {
                version,
                by_motor_command: (by == UpdateSource::MotorCommand).into(),
                ..of(AXLE_UCP_ROBOT_UPDATE_REQUESTED)
            },
            _ => of(AXLE_UCP_ROBOT_OTHER),
        }
    }
}

/// Counts of a robot.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ucp_robot_statistics {
    /// Motor commands accepted.
    pub commands: u32,
    /// Of these, with a speed or turn out of range, which was limited.
    pub commands_clamped: u32,
    /// Motor commands refused because they would start a firmware update (ruling U7).
    pub commands_refused: u32,
    /// How often the watchdog has fired.
    pub watchdog: u32,
    /// Reports sent.
    pub reports: u32,
    /// Reports that were left out.
    pub reports_skipped: u32,
    /// Pings received.
    pub pings: u32,
    /// Pongs sent.
    pub pongs: u32,
    /// Calibration requests of an unknown kind, or to end one that does not run.
    pub calibration_refused: u32,
    /// Calibration requests that came again.
    pub calibration_repeats: u32,
    /// Results sent.
    pub results: u32,
    /// Acknowledgements that were refused.
    pub acks_refused: u32,
    /// Requests for biases sent.
    pub bias_requests: u32,
    /// Messages that only a robot sends.
    pub misdirected: u32,
    /// Frames of no known message.
    pub unknown: u32,
    /// Messages for which the event queue had no room.
    pub without_room: u32,
    /// Events that were refused because the queue was full.
    pub lost_events: u32,
}

fn statistics_of(robot: &Robot) -> axle_ucp_robot_statistics {
    let of = robot.statistics();
    axle_ucp_robot_statistics {
        commands: of.commands,
        commands_clamped: of.commands_clamped,
        commands_refused: of.commands_refused,
        watchdog: of.watchdog,
        reports: of.reports,
        reports_skipped: of.reports_skipped,
        pings: of.pings,
        pongs: of.pongs,
        calibration_refused: of.calibration_refused,
        calibration_repeats: of.calibration_repeats,
        results: of.results,
        acks_refused: of.acks_refused,
        bias_requests: of.bias_requests,
        misdirected: of.misdirected,
        unknown: of.unknown,
        without_room: of.without_room,
        lost_events: robot.lost_events(),
    }
}

object! {
    /// The robot's side of the link.
    axle_ucp_robot, AXLE_UCP_ROBOT_SIZE = 1080, 135 words of Robot, b"axRo"
}

/// Makes a robot. `size` is `sizeof *robot`. Never call it during another call with the same
/// object.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_init(
    robot: *mut axle_ucp_robot,
    size: usize,
    config: *const axle_ucp_robot_config,
    now_us: u64,
) -> axle_result {
    init(robot, size, || Ok(Robot::new(read(config)?.try_into()?, at(now_us))))
}

endpoint!(axle_ucp_robot:
    axle_ucp_robot_handle_input axle_ucp_robot_handle_old_input
    axle_ucp_robot_handle_timeout axle_ucp_robot_poll_transmit
    axle_ucp_robot_handle_transmit axle_ucp_robot_is_outdated
    axle_ucp_robot_next_deadline axle_ucp_robot_get_line_rules);

/// The next event; `AXLE_NONE` if there is none. Take them all before `poll_transmit`.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_poll_event(
    robot: *mut axle_ucp_robot,
    event: *mut axle_ucp_robot_event,
) -> axle_result {
    get(robot, event, |robot| robot.poll_event().map(Into::into))
}

/// The command in force: the latest, or a stop if it is too old. Correct at any time.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_get_command(
    robot: *const axle_ucp_robot,
    now_us: u64,
    command: *mut axle_ucp_motor,
) -> axle_result {
    get(robot, command, |robot| Some(robot.command(at(now_us)).into()))
}

/// The command in force if it has changed since the last call; `AXLE_NONE` if not. A stop by the
/// watchdog is a change.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_take_command(
    robot: *mut axle_ucp_robot,
    now_us: u64,
    command: *mut axle_ucp_motor,
) -> axle_result {
    get(robot, command, |robot| robot.take_command(at(now_us)).map(Into::into))
}

/// Sets the content of the next reports. The first call starts them.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_set_telemetry(
    robot: *mut axle_ucp_robot,
    telemetry: *const axle_ucp_telemetry,
    now_us: u64,
) -> axle_result {
    let set = || {
        let telemetry = read(telemetry)?.into();
        enter(robot, |robot| robot.set_telemetry(&telemetry, at(now_us)))
    };
    of(set())
}

/// Sends the result of a calibration until the host has it (ruling U11).
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_calibration_result_imu(
    robot: *mut axle_ucp_robot,
    bias: axle_ucp_imu_bias,
    now_us: u64,
) -> axle_result {
    of(enter(robot, |robot| robot.calibration_result_imu(bias.into(), at(now_us))))
}

/// The same for the magnetometer.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_calibration_result_mag(
    robot: *mut axle_ucp_robot,
    bias: axle_ucp_mag_bias,
    now_us: u64,
) -> axle_result {
    of(enter(robot, |robot| robot.calibration_result_mag(bias.into(), at(now_us))))
}

/// Answers a firmware update request; `AXLE_NONE` if there is none. The application stops the
/// motors first, and takes the port after `AXLE_UCP_OTA_ACCEPTED`.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_answer_update(
    robot: *mut axle_ucp_robot,
    status: axle_ucp_ota_status,
    now_us: u64,
) -> axle_result {
    match enter(robot, |robot| robot.answer_update(status.into(), at(now_us))) {
        Ok(true) => AXLE_OK,
        Ok(false) => AXLE_NONE,
        Err(error) => error,
    }
}

/// The calibration that is running; `AXLE_NONE` if there is none.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_get_calibration(
    robot: *const axle_ucp_robot,
    calibration: *mut axle_ucp_calibration,
) -> axle_result {
    get(robot, calibration, |robot| robot.calibrating().map(Into::into))
}

/// The state of the host's network, as told last; `AXLE_NONE` if it was not.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_get_network_state(
    robot: *const axle_ucp_robot,
    state: *mut axle_ucp_network_state,
) -> axle_result {
    get(robot, state, |robot| robot.network_state().map(Into::into))
}

/// Ends the running calibration without a result, and tells which one; `AXLE_NONE` if there is
/// none. The host is not told.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_abort_calibration(
    robot: *mut axle_ucp_robot,
    calibration: *mut axle_ucp_calibration,
) -> axle_result {
    get(robot, calibration, |robot| robot.abort_calibration().map(Into::into))
}

/// The counts so far.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_get_statistics(
    robot: *const axle_ucp_robot,
    counts: *mut axle_ucp_robot_statistics,
) -> axle_result {
    get(robot, counts, |robot| Some(statistics_of(robot)))
}

/// The account of the bytes received.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_robot_get_counters(
    robot: *const axle_ucp_robot,
    account: *mut axle_counters,
) -> axle_result {
    get(robot, account, |robot| Some(robot.counters().into()))
}
