//! An episode with a rover: a noisy link, a plug that may be loose, and a stop.

use axlewire::{
    sim::RoverNode,
    ucp::{Host, MotorControl, host::HostConfig, robot::RobotConfig},
};

use super::*;

/// The robot's watchdog, plus the same again for frames and loops along the way (ruling U10).
const BOUND_MS: f64 = 500.0 + 20.0;

/// Time for a wheel to fall from 120 rpm to 0.5 rpm, which a report rounds to 0: ln(240) time
/// constants of 150 ms.
const RUN_OUT_MS: f64 = 5.5 * 150.0;

/// Full speed of the rover: 2 turns per second of a wheel with a circumference of 0.4 m.
const FASTEST_M_PER_S: f64 = 0.8;

pub(crate) fn episode(seed: u64) -> Vec<Run> {
    let mut rng = Rng::new(seed ^ 0x4057);
    let zero = Instant::from_micros(0);
    let host = Host::new(HostConfig::default(), zero);
    let mut link = Line::new(115_200, seed, host);
    link.add(RoverNode::new(RobotConfig::default(), zero));
    *link.pair_mut(Direction::ToTails) = faults(&mut rng, 2000);
    *link.pair_mut(Direction::ToHead) = faults(&mut rng, 2000);
    link.timing_mut(Who::Head).latency = Duration::from_micros(rng.below(2000) as u32);
    link.timing_mut(Who::Tail(0)).latency = Duration::from_micros(rng.below(2000) as u32);

    let percent = |rng: &mut Rng| rng.below(201) as i16 - 100;
    let command = MotorControl::new(percent(&mut rng), percent(&mut rng)).unwrap();
    let stop_at = zero + millis(&mut rng, 100, 1500);
    let is_loose = rng.chance(0.3);
    let out_at = zero + millis(&mut rng, 100, 1600);
    let in_at = out_at + millis(&mut rng, 0, 800);
    let end = stop_at + Duration::from_millis(2000);

    let (mut start, mut time_ms, mut way) = (None, 0.0, 0.0_f64);
    let mut is_stopped = false;
    while link.now() < end {
        let now = link.now();
        link.stub_mut(Who::Tail(0)).unplugged = is_loose && (out_at..in_at).contains(&now);
        if now < stop_at {
            // Refused while the robot is not heard.
            let _ = link.head_mut().drive(command, now);
        } else if !is_stopped {
            is_stopped = true;
            link.head_mut().stop(now);
        }
        link.run_for(Duration::from_millis(1)).unwrap();
        link.take_head_events();
        link.take_tail_events();
        // A rover is simulated up to the last call of its robot, whether or not bytes arrived.
        let now = link.now();
        link.tail_mut(0).handle_input(&[], now);
        if link.now() > stop_at {
            let rover = link.tail(0).rover();
            let begin = *start.get_or_insert(rover.distance_m());
            way = way.max((rover.distance_m() - begin).abs());
            if rover.telemetry().rpm != [0; 4] {
                time_ms = f64::from((link.now() - stop_at).as_micros()) / 1e3;
            }
        }
    }
    vec![Run {
        kind: "rover",
        seed,
        time_ms,
        time_bound_ms: BOUND_MS + RUN_OUT_MS,
        way,
        way_bound: FASTEST_M_PER_S * (BOUND_MS + 150.0) / 1e3,
        unit: "metres",
        cable: None,
        is_ok_wrong: false,
        complaint: None,
    }]
}
