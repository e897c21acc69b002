//! A host, its application, its port, and a robot that sends anything at any time.

use axlewire::ucp::host::StopProgress;

use super::{
    host_account::{Account, Update},
    host_store::Shelf,
    names::*,
    site::{self, Acts, Menu},
};

/// A message from the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Hear {
    Report,
    Pong,
    StartAck(CalibrationKind, ErrorCode),
    EndAck(CalibrationKind),
    Imu(i16),
    Mag(i16),
    BiasRequest,
    UpdateAnswer(OtaStatus),
    Unknown,
    /// An acknowledgement of a start, with one bit flipped.
    Damaged,
    /// A motor command: our own, on a line that echoes.
    Echo,
    /// The first part of an IMU result, and the rest of it.
    Front,
    Rest,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Call {
    /// 1: ahead, with the lamp on. 2: on the spot. 3: a zero command.
    Go(u8),
    Stop,
    Calibrate(CalibrationStep, CalibrationKind),
    Show(u32),
    Update,
    EndUpdate,
    /// The store works, or fails.
    SetStore(bool),
}

/// Firmware version on offer.
pub(super) const VERSION: i16 = 41;

pub(super) fn command(number: u8) -> MotorControl {
    match number {
        1 => MotorControl::new(60, 0).unwrap().with_front_led(true),
        2 => MotorControl::new(0, 50).unwrap(),
        _ => MotorControl::STOP,
    }
}

#[derive(Clone, Debug, Default)]
pub(crate) struct HostSide {
    /// The application was found silent in this step.
    pub(super) is_halted: bool,
}

pub(crate) type Act = site::Act<Call, Hear>;
pub(crate) type Site = site::Site<HostSide>;

impl Site {
    pub(crate) fn new(config: HostConfig, is_open: bool, menu: Menu<HostSide>) -> Self {
        let now = Instant::from_micros(1_000_000);
        let shelf = Shelf { is_open, ..Shelf::default() };
        let host = Host::with_store(config, shelf, now);
        Self::of(host, Account::new(&config, now), now, menu)
    }
}

impl Site {
    /// No reports show a standstill.
    fn is_update_barred(&self) -> bool {
        self.role.stop_progress() != StopProgress::StandingStill
    }
}

impl Acts<HostSide> for Site {
    fn call(&mut self, call: Call) -> Checked {
        match call {
            Call::Stop => {
                self.role.stop(self.now);
                self.account.end_update();
                self.account.motion.stop(self.now);
            }
            Call::EndUpdate => {
                self.role.end_firmware_update(self.now);
                self.account.end_update();
            }
            Call::SetStore(fails) => self.role.store_mut().fails = fails,
            _ => return self.request(call),
        }
        Ok(())
    }

    fn hand_out(&mut self) -> Result<bool, String> {
        let (shelf, now) = (self.role.store().clone(), self.now);
        self.account.motion.asked(now);
        self.account.request.iter_mut().for_each(|request| request.begin(now));
        self.step.is_halted |= self.account.expire_command(now);
        let is_barred = self.is_update_barred();
        let is_asked = matches!(self.account.update, Update::Asked { .. });
        let frame = self.role.poll_transmit(now);
        // The request is the last that is due, but for pings.
        if is_asked && frame.is_none_or(|frame| frame[4] == 1) {
            broken_if!(!is_barred, "the request of an update is missing");
            self.account.give_up_update();
        }
        let Some(frame) = frame else { return Ok(false) };
        broken_if!(is_barred && frame[4] == 9, "an update of a robot that may move");
        self.account.frame(frame, &shelf, now)?;
        Ok(true)
    }

    fn expire(&mut self) {
        self.step.is_halted |= self.account.expire_command(self.now);
        self.account.expire(self.now);
    }

    fn unsent(&mut self, unsent: Unsent) {
        self.account.unsent(unsent, self.now);
    }

    fn flushed(&mut self) {
        self.account.motion.flushed();
    }

    fn owed(&self) -> Option<Instant> {
        self.account.owed(self.now)
    }

    fn settled(&mut self) -> Checked {
        self.check_calibration()
    }
}
