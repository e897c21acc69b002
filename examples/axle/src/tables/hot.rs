//! Rows of the messages that most captures are made of. They wait until there are some, and then
//! fill one column after the other, which takes a fraction of the time.

use axlewire::{
    ikeya::{Position, PositionResponse, VelocityResponse},
    ucp::{
        FrameOf, MessageId, Telemetry,
        message::{FirmwareReport, RawMotorControl},
    },
};

use super::column::{Column, Unfit};
use crate::listing::Hot;

/// Most rows that wait: they stay in a processor's nearest cache.
const MOST: usize = 256;

/// Rows that are not in all columns yet: index or node, and what is in the frame. Those of a table
/// are of one kind.
#[derive(Debug, Default)]
pub(super) struct Waiting {
    reports: Vec<(u8, FirmwareReport)>,
    controls: Vec<(u8, RawMotorControl)>,
    velocities: Vec<(u8, f32)>,
    positions: Vec<(u8, Position)>,
}

impl Waiting {
    /// Adds a row, and returns whether it is time to fill the columns.
    #[inline]
    pub(super) fn add(&mut self, frame: Hot<'_>) -> bool {
        fn put<T>(rows: &mut Vec<(u8, T)>, number: u8, it: T) -> bool {
            rows.push((number, it));
            rows.len() >= MOST
        }
        match frame {
            Hot::Report(index, report) => put(&mut self.reports, index, *report),
            Hot::Control(index, control) => put(&mut self.controls, index, *control),
            Hot::Velocity(node, rps) => put(&mut self.velocities, node, rps),
            Hot::Position(node, position) => put(&mut self.positions, node, position),
        }
    }

    /// Moves the rows to their columns: those of a frame, without the last one, its bytes.
    pub(super) fn fill(&mut self, columns: &mut [Column]) -> Result<(), Unfit> {
        fn all<T>(
            rows: &mut Vec<(u8, T)>,
            columns: &mut [Column],
            fill: impl FnOnce(&[(u8, T)], &mut [Column]) -> Result<(), Unfit>,
        ) -> Result<(), Unfit> {
            if !rows.is_empty() {
                fill(rows, columns)?;
                rows.clear();
            }
            Ok(())
        }
        all(&mut self.reports, columns, reports)?;
        all(&mut self.controls, columns, controls)?;
        all(&mut self.velocities, columns, velocities)?;
        all(&mut self.positions, columns, positions)
    }
}

/// Fills the next columns, each with these values of a row.
macro_rules! fill {
    ($rows:ident, $columns:ident: $($row:pat => $value:expr;)+) => {$(
        $columns.next().ok_or(Unfit)?.extend($rows.iter().map(|$row| $value))?;
    )+};
}

/// Fills the next columns, each with this part of a field of the telemetry.
macro_rules! telemetry {
    ($rows:ident, $columns:ident, $it:ident: $($field:ident $part:pat),+) => {
        fill! { $rows, $columns: $((_, report) => {
            let Telemetry { $field: $part, .. } = report.telemetry();
            $it
        };)+ }
    };
}

fn reports(rows: &[(u8, FirmwareReport)], columns: &mut [Column]) -> Result<(), Unfit> {
    let mut columns = columns.iter_mut();
    fill! { rows, columns:
        _ => size_of::<FrameOf<FirmwareReport>>() as u8;
        _ => MessageId::Report as u8;
        (index, _) => *index;
    }
    columns.next().ok_or(Unfit)?.names("firmware", rows.len())?;
    telemetry! { rows, columns, it:
        battery_pct it,
        rpm [it, ..],
        rpm [_, it, ..],
        rpm [_, _, it, _],
        rpm [.., it],
        acc [it, ..],
        acc [_, it, _],
        acc [.., it],
        gyro [it, ..],
        gyro [_, it, _],
        gyro [.., it],
        mag [it, ..],
        mag [_, it, _],
        mag [.., it],
        heading_deg it,
        power_w it,
        voltage_dv it,
        current_ca it
    }
    fill! { rows, columns: (_, report) => report.version(); }
    Ok(())
}

fn controls(rows: &[(u8, RawMotorControl)], columns: &mut [Column]) -> Result<(), Unfit> {
    let mut columns = columns.iter_mut();
    fill! { rows, columns:
        _ => size_of::<FrameOf<RawMotorControl>>() as u8;
        _ => MessageId::MotorControl as u8;
        (index, _) => *index;
        (_, control) => control.speed();
        (_, control) => control.angular();
        (_, control) => control.front_led();
        (_, control) => control.back_led();
        (_, control) => control.version();
        (_, control) => control.reserve1();
        // As its column holds it: the `i32` of the same bits.
        (_, control) => control.reserve2() as i32;
    }
    Ok(())
}

fn velocities(rows: &[(u8, f32)], columns: &mut [Column]) -> Result<(), Unfit> {
    let mut columns = columns.iter_mut();
    fill! { rows, columns:
        _ => VelocityResponse::LEN as u8;
        (node, _) => *node;
        // Any NaN is the same, as in JSON.
        (_, rps) => if rps.is_nan() { f32::NAN } else { *rps };
    }
    Ok(())
}

fn positions(rows: &[(u8, Position)], columns: &mut [Column]) -> Result<(), Unfit> {
    let mut columns = columns.iter_mut();
    fill! { rows, columns:
        _ => PositionResponse::LEN as u8;
        (node, _) => *node;
        (_, position) => position.count();
        (_, position) => position.rotation();
    }
    Ok(())
}
