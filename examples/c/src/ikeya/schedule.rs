//! How fast a bus can be, before it is wired.

use axlewire::ikeya::{NodeId, master::Schedule};

use crate::{
    memory::{Out, read},
    result::{AXLE_ERROR_VALUE, axle_result, of_encode},
    time::span,
};

/// A bus of boards with one motor, for `axle_ikeya_schedule_get_cycle`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct axle_ikeya_schedule {
    /// Speed of the line, bit/s; 500,000 by default.
    pub baud: u32,
    /// Time from the end of a request to the start of its answer; 50 us by default (ruling I9).
    pub response_time_us: u32,
    /// Silence after each packet of the master and after each answer; 0 by default.
    pub turnaround_gap_us: u32,
    /// Number of nodes.
    pub nodes: u8,
    /// Not 0 if each node is commanded in each cycle, or only read; 1 by default.
    pub writes: u8,
}
plain!(axle_ikeya_schedule);

/// What the master does with each node in turn: a WRITE, if it is commanded, and a READ.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ikeya_cycle {
    /// Time that one node takes.
    pub exchange_time_us: u32,
    /// Time of all nodes: from one turn of a node to its next.
    pub cycle_time_us: u32,
    /// Visits to each node per second, rounded down; 0 without nodes.
    pub cycles_per_second: u32,
    /// Share of the time in which the line is in use, percent, rounded down.
    pub busy_pct: u32,
}

/// A bus of so many nodes with the values by default.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_schedule_default(
    schedule: *mut axle_ikeya_schedule,
    nodes: u8,
) -> axle_result {
    let Schedule { nodes, writes, baud, response_time, turnaround_gap, .. } = Schedule::new(nodes);
    let schedule = Out::new(schedule).map(|out| {
        out.write(axle_ikeya_schedule {
            baud,
            response_time_us: response_time.as_micros(),
            turnaround_gap_us: turnaround_gap.as_micros(),
            nodes,
            writes: writes.into(),
        })
    });
    schedule.unwrap_or_else(|error| error)
}

/// The shortest cycle of a bus.
///
/// Fails with `AXLE_ERROR_VALUE` for a `baud` of 0, and `AXLE_ERROR_NODE_ID` for more than 8 nodes
/// or none. Times that do not fit are `UINT32_MAX`.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_schedule_get_cycle(
    schedule: *const axle_ikeya_schedule,
    cycle: *mut axle_ikeya_cycle,
) -> axle_result {
    let get = || {
        let (out, of) = (Out::new(cycle)?, read(schedule)?);
        if of.baud == 0 {
            return Err(AXLE_ERROR_VALUE);
        }
        NodeId::new(of.nodes).map_err(of_encode)?;
        let mut bus = Schedule::new(of.nodes);
        bus.writes = of.writes != 0;
        bus.baud = of.baud;
        bus.response_time = span(of.response_time_us);
        bus.turnaround_gap = span(of.turnaround_gap_us);
        Ok(out.write(axle_ikeya_cycle {
            exchange_time_us: bus.exchange_time().as_micros(),
            cycle_time_us: bus.cycle_time().as_micros(),
            cycles_per_second: bus.cycles_per_second(),
            busy_pct: bus.busy_pct(),
        }))
    };
    get().unwrap_or_else(|error| error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result::AXLE_ERROR_NODE_ID;

    #[test]
    fn eight_nodes_are_visited_277_times_per_second_as_in_rust() {
        let mut bus = axle_ikeya_schedule {
            baud: 0,
            response_time_us: 0,
            turnaround_gap_us: 0,
            nodes: 0,
            writes: 0,
        };
        let mut cycle = axle_ikeya_cycle::default();
        axle_ikeya_schedule_default(&mut bus, 8);
        axle_ikeya_schedule_get_cycle(&bus, &mut cycle);
        let plan = Schedule::new(8);
        assert_eq!(
            (cycle.exchange_time_us, cycle.cycle_time_us, cycle.cycles_per_second, cycle.busy_pct),
            (450, 3600, 277, plan.busy_pct())
        );
        // Read only, slower, with gaps.
        bus = axle_ikeya_schedule { baud: 250_000, turnaround_gap_us: 100, writes: 0, ..bus };
        axle_ikeya_schedule_get_cycle(&bus, &mut cycle);
        assert_eq!(cycle.exchange_time_us, 160 + 50 + 320 + 100);
        for (nodes, baud, error) in
            [(0, 1, AXLE_ERROR_NODE_ID), (9, 1, AXLE_ERROR_NODE_ID), (8, 0, AXLE_ERROR_VALUE)]
        {
            let bus = axle_ikeya_schedule { nodes, baud, ..bus };
            assert_eq!(axle_ikeya_schedule_get_cycle(&bus, &mut cycle), error);
        }
    }
}
