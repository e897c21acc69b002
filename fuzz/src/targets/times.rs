//! Times, against arithmetic in 128 bits: instants, spans, counters that wrap, wire times, and the
//! plan of a bus.

use arbitrary::{Arbitrary, Result, Unstructured};
use axlewire::{
    ikeya::{
        board::{OneMotor, ThreeMotors},
        master::Schedule,
    },
    time::{Duration, Instant, Wrapping32, wire_time},
};

use super::Tally;

#[derive(Arbitrary, Debug)]
enum Question {
    Instants { at: u64, span: u32, other: u64 },
    Spans { one: u32, other: u32, times: u32 },
    Counter { start: u32, steps: Vec<u32> },
    Wire { bytes: u32, baud: u32, is_short: bool },
    Plan { nodes: u8, writes: bool, baud: u32, response_us: u32, gap_us: u32, is_sane: bool },
}

/// Any number of questions.
pub(super) fn times(data: &[u8], tally: &mut Tally) {
    let _ = answer_all(&mut Unstructured::new(data), tally);
}

fn answer_all(u: &mut Unstructured<'_>, tally: &mut Tally) -> Result<()> {
    while !u.is_empty() {
        match u.arbitrary()? {
            Question::Instants { at, span, other } => {
                instants(at, span, other);
                tally.did(0);
            }
            Question::Spans { one, other, times } => {
                spans(one, other, times);
                tally.did(1);
            }
            Question::Counter { start, steps } => {
                counter(start, &steps);
                tally.did(2);
            }
            Question::Wire { bytes, baud, is_short } => {
                let bytes = if is_short { bytes % 600 } else { bytes };
                wire(bytes, baud);
                tally.did(3);
            }
            Question::Plan { nodes, writes, baud, response_us, gap_us, is_sane } => {
                let mut plan = Schedule::new(nodes);
                (plan.writes, plan.baud) = (writes, baud);
                let less = if is_sane { 1000 } else { u32::MAX };
                plan.response_time = Duration::from_micros(response_us % less);
                plan.turnaround_gap = Duration::from_micros(gap_us % less);
                check_plan(&plan);
                tally.did(4);
            }
        }
    }
    Ok(())
}

const LONGEST: u128 = u32::MAX as u128;

fn micros(span: Duration) -> u128 {
    span.as_micros().into()
}

fn instants(at: u64, span: u32, other: u64) {
    let begin = Instant::from_micros(at);
    let mut end = begin + Duration::from_micros(span);
    assert_eq!(end.as_micros(), (u128::from(at) + u128::from(span)) as u64, "wraps");
    assert_eq!((end - begin).as_micros(), span);
    assert_eq!((begin - end).as_micros(), 0);
    assert_eq!(end > begin, span > 0);
    assert_eq!(end == begin, span == 0);
    end += Duration::from_micros(1);
    assert!(end > begin);

    // Two instants less than half of the range apart.
    let ahead = u128::from(other.wrapping_sub(at));
    let other = Instant::from_micros(other);
    if ahead != 0 && ahead != 1 << 63 {
        assert_eq!(other > begin, ahead < 1 << 63);
        assert_eq!(other < begin, ahead > 1 << 63);
        let (later, apart) = if ahead < 1 << 63 {
            (other - begin, ahead)
        } else {
            (begin - other, (1 << 64) - ahead)
        };
        assert_eq!(micros(later), apart.min(LONGEST));
    }
    assert_eq!(Instant::from_millis(at).as_micros(), (u128::from(at) * 1000) as u64);
}

fn spans(one: u32, other: u32, times: u32) {
    let (a, b) = (Duration::from_micros(one), Duration::from_micros(other));
    let (one, other) = (u128::from(one), u128::from(other));
    assert_eq!(micros(a + b), (one + other).min(LONGEST));
    assert_eq!(a + b, a.saturating_add(b));
    assert_eq!(micros(a.saturating_mul(times)), (one * u128::from(times)).min(LONGEST));
    assert_eq!(micros(Duration::from_millis(times)), (u128::from(times) * 1000).min(LONGEST));
    assert_eq!(a < b, one < other);
}

/// The counter is read at least once per turn, so it counts all steps.
fn counter(start: u32, steps: &[u32]) {
    let clock = Wrapping32::new();
    let mut total = u128::from(start);
    let mut last = clock.at(start);
    assert_eq!(u128::from(last.as_micros()), total);
    for &step in steps {
        total += u128::from(step);
        let now = clock.at(total as u32);
        assert_eq!(u128::from(now.as_micros()), total);
        assert_eq!((now - last).as_micros(), step);
        assert!(now >= last);
        last = now;
    }
}

/// Ten bits per byte, rounded up.
fn wire_us(bytes: u128, baud: u32) -> u128 {
    match baud {
        0 => LONGEST,
        _ => (bytes * 10 * 1_000_000).div_ceil(baud.into()).min(LONGEST),
    }
}

fn wire(bytes: u32, baud: u32) {
    assert_eq!(micros(wire_time(bytes as usize, baud)), wire_us(bytes.into(), baud));
}

fn check_plan(plan: &Schedule) {
    let (gap, answer) = (micros(plan.turnaround_gap), micros(plan.response_time));
    // Each sum saturates, and all parts are positive: one limit at the end is the same.
    let time = |long: u128, answers_write: bool| {
        let (read, packet) = (wire_us(4, plan.baud), wire_us(long, plan.baud));
        let asked = match (plan.writes, answers_write) {
            (false, _) => read,
            (true, true) => packet,
            (true, false) => packet + gap + read,
        };
        (asked + answer + packet + gap).min(LONGEST)
    };
    let exchange = time(8, false);
    assert_eq!(micros(plan.exchange_time()), exchange);
    assert_eq!(plan.exchange_time_of::<OneMotor>(), plan.exchange_time());
    assert_eq!(micros(plan.exchange_time_of::<ThreeMotors>()), time(16, true));
    let cycle = (exchange * u128::from(plan.nodes)).min(LONGEST);
    assert_eq!(micros(plan.cycle_time()), cycle);
    let per_second = 1_000_000_u128.checked_div(cycle).unwrap_or(0);
    assert_eq!(u128::from(plan.cycles_per_second()), per_second);
    let silent = (answer + gap * if plan.writes { 2 } else { 1 }).min(LONGEST);
    let talking = exchange.saturating_sub(silent);
    let busy = (talking * 100).checked_div(exchange).unwrap_or(0);
    assert_eq!(u128::from(plan.busy_pct()), busy);
    assert!(plan.busy_pct() <= 100);
}
