//! Random stories of the same world, longer than a search can try them: up to three nodes, any
//! settings, any pauses, and clocks that are about to wrap.

use axlewire::sim::Rng;

use super::{
    action::{Action, Answer, Fate, Menu, Wait},
    bus::Bus,
    names::*,
};

/// Steps with faults.
const STEPS: usize = 300;

/// Time in which all nodes of a healthy bus have to be still after their stops.
const RECOVERY: Duration = Duration::from_millis(500);

const US: fn(u32) -> Duration = Duration::from_micros;

fn settings(rng: &mut Rng) -> MasterConfig {
    let mut config = MasterConfig::direct();
    config.polling = match rng.below(3) {
        0 => Polling::Fastest,
        1 => Polling::Every(US(rng.below(5000) as u32)),
        _ => Polling::Manual,
    };
    if rng.chance(0.3) {
        config.turnaround_gap = US(rng.below(200) as u32);
    }
    if rng.chance(0.3) {
        config.recovery_share_pct = [0, 1, 50, 100][rng.below(4) as usize];
    }
    if rng.chance(0.5) {
        config.dead_man = Some(US(rng.below(20_000) as u32));
    }
    if rng.chance(0.3) {
        config.attempts = rng.below(4) as u8;
    }
    config
}

/// What happens if nothing goes wrong.
fn next<B: Kit>(bus: &Bus<B>) -> Action {
    if bus.asked.is_some_and(|asked| asked.is_heard) {
        Action::Answer(Answer::Right)
    } else if bus.master.poll_timeout().is_some_and(|at| at > bus.now) && !bus.sends() {
        Action::Wait(Wait::Deadline)
    } else {
        Action::Send(Fate::Arrives)
    }
}

fn story<B: Kit>(seed: u64, is_told: bool) -> Checked {
    let mut rng = Rng::new(seed);
    let config = settings(&mut rng);
    let modes: Vec<_> = (0..=rng.below(3))
        .map(|_| if rng.chance(0.5) { Mode::Velocity } else { Mode::Position })
        .collect();
    let start = if rng.chance(0.2) { u64::MAX - 50_000 } else { rng.below(1 << 40) };
    let mut bus = Bus::<B>::at(Instant::from_micros(start), &modes, config, Menu::FINE);
    bus.menu.polls_fastest = config.polling == Polling::Fastest;
    bus.is_far = rng.chance(0.3);
    let (is_lazy, turns) = (rng.chance(0.3), rng.chance(0.3));
    if is_told {
        println!("{modes:?} {config:?}");
    }
    let step = |bus: &mut Bus<B>, action: Action| {
        if is_told {
            println!("{:?} {action:?}", bus.now);
        }
        bus.step(action)
    };
    bus.master.discover(bus.now);
    for _ in 0..STEPS {
        let longest = if is_lazy && rng.chance(0.05) { 3_600_000_000 } else { 3000 };
        if rng.chance(0.1) {
            bus.now += US(rng.below(longest) as u32);
        }
        let action = match rng.chance(0.75) {
            true => next(&bus),
            false => {
                let actions = bus.actions();
                actions[rng.below(actions.len() as u64) as usize]
            }
        };
        step(&mut bus, action)?;
        if turns && rng.chance(0.02) {
            let node = NodeId::ALL[rng.below(modes.len() as u64) as usize];
            step(&mut bus, Action::Turn(node))?;
        }
    }
    let end = bus.now + RECOVERY;
    for count in 0.. {
        if bus.master.stops_owed().is_empty() && bus.master.coasting().is_empty() {
            break;
        }
        let action = next(&bus);
        step(&mut bus, action)?;
        if bus.now - end > Duration::ZERO || count > 5000 {
            let (owed, coasting) = (bus.master.stops_owed(), bus.master.coasting());
            return Err(format!("not still on a healthy bus: {owed:?}, {coasting:?}"));
        }
    }
    Ok(())
}

/// Runs these seeds; the first one that breaks a rule is reported in full.
fn play<B: Kit>(seeds: core::ops::Range<u64>) {
    for seed in seeds {
        if story::<B>(seed, false).is_err() {
            panic!("seed {seed}: {:?}", story::<B>(seed, true));
        }
    }
}

#[test]
fn a_random_master_of_boards_with_one_motor_obeys_the_model() {
    play::<OneMotor>(0..400);
}

#[test]
fn a_random_master_of_boards_with_three_motors_obeys_the_model() {
    play::<ThreeMotors>(0..400);
}

#[test]
#[ignore = "a minute"]
fn deep_random_masters_obey_the_model() {
    play::<OneMotor>(400..20_000);
    play::<ThreeMotors>(400..20_000);
}
