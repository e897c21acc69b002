//! The calls of a host's application, and those that are refused.

use axlewire::ucp::host::{CommandError, Link, StopProgress};

use super::{
    host::{Call, Site, VERSION, command},
    host_account::Update,
    names::*,
    site::ROOM,
};

impl Site {
    /// A call and its result.
    pub(super) fn request(&mut self, call: Call) -> Checked {
        let is_updating = self.account.update != Update::None;
        let (now, room_is_over) = (self.now, queue(&self.role).len() > ROOM);
        let is_calibrating = self.account.request.is_some() || room_is_over;
        let (result, expected) = match call {
            Call::Go(number) => {
                let result = self.role.drive(command(number), now);
                if result.is_ok() {
                    self.account.motion.call(command(number), now);
                }
                let is_lost = self.account.link == Link::Down && !command(number).stands_still();
                let lost = is_lost.then_some(CommandError::LinkDown);
                (result, is_updating.then_some(CommandError::Updating).or(lost))
            }
            Call::Calibrate(step, kind) => {
                let result = match step {
                    CalibrationStep::Start => self.role.start_calibration(kind, now),
                    CalibrationStep::End => self.role.end_calibration(kind, now),
                };
                if result.is_ok() {
                    self.account.calibrate(step, kind);
                }
                let calibrating = is_calibrating.then_some(CommandError::Calibrating);
                (result, is_updating.then_some(CommandError::Updating).or(calibrating))
            }
            Call::Show(state) => {
                let result = self.role.set_network_state(NetworkState::from(state), now);
                if result.is_ok() && self.account.network.replace(state) != Some(state) {
                    self.account.is_network_due = true;
                }
                let is_barred = self.account.low_ids_only;
                (result, is_barred.then_some(CommandError::LowIdsOnly { id: 0x0A }))
            }
            _ => {
                let result = self.role.start_firmware_update(VERSION, now);
                let is_still = self.role.stop_progress() == StopProgress::StandingStill;
                let is_down = self.account.link == Link::Down;
                let motion = &mut self.account.motion;
                let expected = match () {
                    () if self.account.low_ids_only => Some(CommandError::LowIdsOnly { id: 9 }),
                    () if is_updating => Some(CommandError::Updating),
                    () if is_calibrating => Some(CommandError::Calibrating),
                    () if is_down => Some(CommandError::LinkDown),
                    () if !is_still => Some(CommandError::Moving),
                    () => None,
                };
                if result.is_ok() {
                    motion.is_called = true;
                    motion.owe_two();
                    self.account.update = Update::Asked { version: VERSION, needs_stop: true };
                }
                (result, expected)
            }
        };
        match (result.err(), expected) {
            (found, expected) if found == expected => Ok(()),
            (found, expected) => Err(format!("refused: {found:?} instead of {expected:?}")),
        }
    }
}
