//! Host and robot in C and in Rust.

use axlewire::{
    error::EncodeError,
    time::{Duration, Instant},
    ucp::{
        Host, MotorControl, Robot, Telemetry,
        host::{
            CalibrationFailure, CalibrationStep, CommandError, FailureCause, HostConfig, HostEvent,
            Link, MemoryStore, ReceivedReport, StopProgress,
        },
        message::{ImuBias, MagBias},
        robot::{ReportLayout, RobotConfig, RobotEvent, UpdateSource},
    },
};
use axlewire_c::*;

use crate::twin::{Pair, Twin, counters, latency, object, same, value};

object!(axle_ucp_host:
    axle_ucp_host_handle_input axle_ucp_host_handle_old_input axle_ucp_host_handle_timeout
    axle_ucp_host_poll_transmit axle_ucp_host_handle_transmit axle_ucp_host_is_outdated
    axle_ucp_host_next_deadline axle_ucp_host_get_line_rules);
object!(axle_ucp_robot:
    axle_ucp_robot_handle_input axle_ucp_robot_handle_old_input axle_ucp_robot_handle_timeout
    axle_ucp_robot_poll_transmit axle_ucp_robot_handle_transmit axle_ucp_robot_is_outdated
    axle_ucp_robot_next_deadline axle_ucp_robot_get_line_rules);

pub(crate) type MyHost = Host<MemoryStore>;

pub(crate) fn host_config(of: &HostConfig) -> axle_ucp_host_config {
    axle_ucp_host_config {
        baud: of.baud,
        command_period_us: of.command_period.as_micros(),
        command_gap_us: of.command_gap.as_micros(),
        dead_man_us: of.dead_man.as_micros(),
        ping_period_us: of.ping_period.map_or(0, Duration::as_micros),
        ping_timeout_us: of.ping_timeout.as_micros(),
        link_timeout_us: of.link_timeout.as_micros(),
        rpm_average_us: of.rpm_average.as_micros(),
        ack_timeout_us: of.ack_timeout.as_micros(),
        idle_margin_us: of.idle_margin.as_micros(),
        attempts: of.attempts,
        sends_first_stop: of.sends_first_stop.into(),
        low_ids_only: of.low_ids_only.into(),
    }
}

pub(crate) fn robot_config(of: &RobotConfig) -> axle_ucp_robot_config {
    axle_ucp_robot_config {
        baud: of.baud,
        watchdog_us: of.watchdog.as_micros(),
        report_period_us: of.report_period.as_micros(),
        result_period_us: of.result_period.as_micros(),
        bias_request_period_us: of.bias_request_period.map_or(0, Duration::as_micros),
        idle_margin_us: of.idle_margin.as_micros(),
        version: match of.layout {
            ReportLayout::Firmware { version } => version.into(),
            ReportLayout::Document => -1,
        },
    }
}

pub(crate) fn motor(of: MotorControl) -> axle_ucp_motor {
    axle_ucp_motor {
        speed_pct: of.speed(),
        turn_pct: of.angular(),
        lamp: u8::from(of.front_led() == 100),
    }
}

pub(crate) fn telemetry(of: &Telemetry) -> axle_ucp_telemetry {
    axle_ucp_telemetry {
        battery_pct: of.battery_pct,
        current_ca: of.current_ca,
        acc: of.acc,
        gyro: of.gyro,
        mag: of.mag,
        heading_deg: of.heading_deg,
        rpm: of.rpm,
        voltage_dv: of.voltage_dv,
        power_w: of.power_w,
    }
}

fn imu(of: ImuBias) -> axle_ucp_imu_bias {
    axle_ucp_imu_bias { acc: of.acc(), gyro: of.gyro() }
}

fn mag(of: MagBias) -> axle_ucp_mag_bias {
    axle_ucp_mag_bias { mag: of.mag() }
}

pub(crate) fn report(of: ReceivedReport) -> axle_ucp_report {
    axle_ucp_report {
        telemetry: telemetry(&of.telemetry),
        version: of.version.map_or(-1, i32::from),
        index: of.index,
        lost: of.lost,
    }
}

pub(crate) fn command_error(of: Result<(), CommandError>) -> axle_result {
    match of {
        Ok(()) => 0,
        Err(CommandError::LinkDown) => -80,
        Err(CommandError::Calibrating) => -81,
        Err(CommandError::CalibrationKind { .. }) => -82,
        Err(CommandError::LowIdsOnly { .. }) => -83,
        Err(CommandError::Moving) => -84,
        Err(CommandError::Updating) => -85,
        Err(CommandError::Value(EncodeError::Percent { .. })) => -24,
        Err(CommandError::Value(EncodeError::NetworkState { .. })) => -25,
        Err(other) => panic!("{other:?}"),
    }
}

fn failure(of: CalibrationFailure) -> (u8, u8) {
    match of.cause {
        FailureCause::NoAnswer => (1, 0),
        FailureCause::Refused(err) => (2, err.into()),
        other => panic!("{other:?}"),
    }
}

impl Pair for MyHost {
    type Object = axle_ucp_host;
    type Told = axle_ucp_host_event;

    fn poll_in_c(object: *mut axle_ucp_host, event: *mut axle_ucp_host_event) -> axle_result {
        axle_ucp_host_poll_event(object, event)
    }

    fn expected(event: &HostEvent) -> axle_ucp_host_event {
        let mut told = axle_ucp_host_event::default();
        told.kind = match event {
            HostEvent::LinkUp => 1,
            HostEvent::LinkDown => 2,
            HostEvent::Pong { round_trip, err } => {
                (told.round_trip_us, told.err) = (round_trip.as_micros(), (*err).into());
                3
            }
            HostEvent::Report(of) => {
                told.report = report(*of);
                4
            }
            HostEvent::DeadMan => 5,
            HostEvent::CalibrationStarted(kind) => {
                told.calibration = (*kind).into();
                6
            }
            HostEvent::CalibrationEnded(kind) => {
                told.calibration = (*kind).into();
                7
            }
            HostEvent::CalibrationFailed(of) => {
                told.calibration = of.kind.into();
                told.step = if of.step == CalibrationStep::Start { 1 } else { 2 };
                (told.cause, told.err) = failure(*of);
                told.attempts = of.attempts;
                8
            }
            HostEvent::ImuBias(bias) => {
                told.imu_bias = imu(*bias);
                9
            }
            HostEvent::MagBias(bias) => {
                told.mag_bias = mag(*bias);
                10
            }
            HostEvent::BiasesSent => 11,
            HostEvent::BiasesMissing { imu, mag } => {
                (told.imu_missing, told.mag_missing) = ((*imu).into(), (*mag).into());
                12
            }
            HostEvent::BiasesNotAnswered => 13,
            HostEvent::UpdateNotSent => 14,
            HostEvent::UpdateAnswered(status) => {
                told.ota_status = (*status).into();
                15
            }
            HostEvent::Unknown(frame) => {
                let raw = frame.as_raw();
                (told.id, told.index) = (raw.id, raw.index);
                told.body_length = raw.body.len() as u8;
                told.body[..raw.body.len()].copy_from_slice(raw.body);
                16
            }
            other => panic!("{other:?}"),
        };
        told
    }

    fn same(&self, object: *mut axle_ucp_host, _: Instant) {
        let (stop, rpm) = match self.stop_progress() {
            StopProgress::NotAsked => (0, [0; 4]),
            StopProgress::Due => (1, [0; 4]),
            StopProgress::NoReports => (2, [0; 4]),
            StopProgress::StillMoving { rpm } => (3, rpm),
            StopProgress::StandingStill => (4, [0; 4]),
        };
        let calibration = self.calibration_outcome();
        let state = axle_ucp_robot_state {
            lost_events: self.lost_events(),
            command: self.command().map_or(axle_ucp_motor::default(), motor),
            rpm,
            link: match self.link() {
                Link::Waiting => 0,
                Link::Up => 1,
                Link::Down => 2,
            },
            stop,
            is_commanded: self.command().is_some().into(),
            is_stop_sent: self.is_stop_sent().into(),
            is_updating: self.is_updating().into(),
            is_calibration_over: calibration.is_some().into(),
            calibration_failure: match calibration {
                Some(Err(of)) => failure(of).0,
                _ => 0,
            },
        };
        same(value(|to| axle_ucp_host_get_robot_state(object, to)), Some(state));
        let of = self.statistics();
        let counts = axle_ucp_host_statistics {
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
            round_trip: latency(of.round_trip),
        };
        same(value(|to| axle_ucp_host_get_statistics(object, to)), Some(counts));
        let account = value(|to| axle_ucp_host_get_counters(object, to));
        same(account, Some(counters(self.counters())));
    }
}

impl Pair for Robot {
    type Object = axle_ucp_robot;
    type Told = axle_ucp_robot_event;

    fn poll_in_c(object: *mut axle_ucp_robot, event: *mut axle_ucp_robot_event) -> axle_result {
        axle_ucp_robot_poll_event(object, event)
    }

    fn expected(event: &RobotEvent) -> axle_ucp_robot_event {
        let mut told = axle_ucp_robot_event::default();
        told.kind = match *event {
            RobotEvent::Motor(command) => {
                told.command = motor(command);
                1
            }
            RobotEvent::Watchdog => 2,
            RobotEvent::CalibrationStart { kind, repeated } => {
                (told.calibration, told.is_repeated) = (kind.into(), repeated.into());
                3
            }
            RobotEvent::CalibrationEnd(kind) => {
                told.calibration = kind.into();
                4
            }
            RobotEvent::ImuBiasTaken => 5,
            RobotEvent::MagBiasTaken => 6,
            RobotEvent::Biases(of) => {
                (told.imu_bias, told.mag_bias) = (imu(of.imu()), mag(of.mag()));
                told.err = of.err().into();
                7
            }
            RobotEvent::NetworkState(state) => {
                told.network_state = state.into();
                8
            }
            RobotEvent::UpdateRequested { version, by } => {
                told.version = version;
                told.by_motor_command = u8::from(by == UpdateSource::MotorCommand);
                9
            }
            ref other => panic!("{other:?}"),
        };
        told
    }

    fn same(&self, object: *mut axle_ucp_robot, now: Instant) {
        let command = value(|to| axle_ucp_robot_get_command(object, now.as_micros(), to));
        same(command, Some(motor(self.command(now))));
        let calibration = value(|to| axle_ucp_robot_get_calibration(object, to));
        same(calibration, self.calibrating().map(u8::from));
        let state = value(|to| axle_ucp_robot_get_network_state(object, to));
        same(state, self.network_state().map(u32::from));
        let of = self.statistics();
        let counts = axle_ucp_robot_statistics {
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
            lost_events: self.lost_events(),
        };
        same(value(|to| axle_ucp_robot_get_statistics(object, to)), Some(counts));
        let account = value(|to| axle_ucp_robot_get_counters(object, to));
        same(account, Some(counters(self.counters())));
    }
}

impl Twin<MyHost> {
    pub(crate) fn host(config: HostConfig, now: Instant) -> Self {
        let in_c = host_config(&config);
        let rust = Host::with_store(config, MemoryStore::default(), now);
        let size = size_of::<axle_ucp_host>();
        Self::new(rust, now, |it| axle_ucp_host_init(it, size, &in_c, now.as_micros()))
    }
}

impl Twin<Robot> {
    pub(crate) fn robot(config: RobotConfig, now: Instant) -> Self {
        let in_c = robot_config(&config);
        let size = size_of::<axle_ucp_robot>();
        let rust = Robot::new(config, now);
        Self::new(rust, now, |it| axle_ucp_robot_init(it, size, &in_c, now.as_micros()))
    }
}
