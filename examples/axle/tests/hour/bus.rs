//! The master of the library on its serial port, at the pace of a line of 500 kbit/s.

use std::time::{Duration, Instant};

use axlewire::{
    drive::{Driver, SerialPort, StdClock},
    ikeya::{
        BAUD, Master, Mode, NodeId, Rps,
        master::{MasterConfig, MasterEvent, MasterStatistics, NodeStatistics, Polling, Schedule},
    },
};

use crate::machine::{Control, Gaps};

/// The nodes, as arguments of the simulation.
pub(crate) const NODES: &str = "-n 1:velocity -n 2:position -n 3:velocity -n 4:position \
     -n 5:velocity -n 6:position -n 7:velocity -n 8:position";

/// Longest time without a good answer that the machine does not explain: the wait for an answer,
/// and the guard behind it.
const LONGEST: Duration = Duration::from_millis(60);

type Bus = Driver<Master, SerialPort, StdClock>;

pub(crate) struct Outcome {
    gaps: Gaps,
    span: Duration,
    /// Readings told, and answers counted by the master in the same time.
    answers: u64,
    replied: u64,
    line: MasterStatistics,
    nodes: Vec<NodeStatistics>,
    lost_events: u32,
    is_account_whole: bool,
    stopped: Result<(), String>,
}

pub(crate) fn run(path: &str, length: Duration, control: Control, sim: u32) -> Outcome {
    let port = SerialPort::open(path, BAUD).unwrap();
    let mut config = MasterConfig::usb_adapter();
    config.accepts_early = true;
    // As often as the line could carry it.
    config.polling = Polling::Every(Schedule::new(8).cycle_time());
    let mut bus: Bus = Driver::master(config, port, StdClock::new());
    while bus.discover().unwrap().len() < 8 {}
    command(&mut bus);
    while bus.poll_event().is_some() {}
    let replied = replies(&bus);
    let (begin, mut gaps) = (Instant::now(), Gaps::new(control, sim));
    let (mut answers, mut commanded) = (0, begin);
    while begin.elapsed() < length {
        bus.service().unwrap();
        while let Some(event) = bus.poll_event() {
            if let MasterEvent::Status { .. } = event {
                answers += 1;
                gaps.heard(Instant::now());
            }
        }
        // A node that the machine kept from answering has been stopped.
        if commanded.elapsed() > Duration::from_secs(1) {
            commanded = Instant::now();
            command(&mut bus);
        }
        let (now, due) = (bus.now(), bus.poll_timeout());
        let pause = due.map_or(1000, |due| (due - now).as_micros().min(1000));
        if pause > 0 {
            bus.port_mut().wait(Duration::from_micros(pause.into())).unwrap();
        }
    }
    let (span, replied) = (begin.elapsed(), replies(&bus) - replied);
    while let Some(event) = bus.poll_event() {
        answers += u64::from(matches!(event, MasterEvent::Status { .. }));
    }
    let stopped = bus.stop_all().map_err(|error| error.to_string());
    let master = bus.role();
    let counters = master.counters();
    Outcome {
        gaps,
        span,
        answers,
        replied,
        line: *master.statistics(),
        nodes: NodeId::ALL.map(|node| *master.node_statistics(node)).to_vec(),
        lost_events: master.lost_events(),
        is_account_whole: counters.received == counters.framed + counters.skipped(),
        stopped,
    }
}

fn replies(bus: &Bus) -> u64 {
    NodeId::ALL.iter().map(|&node| u64::from(bus.role().node_statistics(node).replies)).sum()
}

/// Commands every velocity node that has none; the position nodes are read only.
fn command(bus: &mut Bus) {
    let now = bus.now();
    for node in NodeId::ALL {
        let master = bus.role_mut();
        if master.mode(node) == Some(Mode::Velocity) && master.set_point(node).is_none() {
            // Refused while it is owed a stop.
            let _ = master.set_velocity(node, Rps::new(2.0).unwrap(), now);
        }
    }
}

impl Outcome {
    /// Prints the figures, and complains of what is wrong; `told` is what the simulation printed.
    pub(crate) fn report(&self, told: &[String], complaints: &mut Vec<String>) {
        let total = |count: fn(&NodeStatistics) -> u32| -> u64 {
            self.nodes.iter().map(|node| u64::from(count(node))).sum()
        };
        let (requests, replies) = (total(|node| node.requests), total(|node| node.replies));
        let (timeouts, late) = (total(|node| node.timeouts), total(|node| node.late));
        let rate = self.answers as f64 / self.span.as_secs_f64();
        println!(
            "bus: {} answers, {rate:.0} a second; {} READ, {} WRITE; {timeouts} timeouts, {late} late, {} events lost; longest \
             gap {:.1?}, of which the machine does not explain {:.1?}",
            self.answers,
            self.line.reads,
            self.line.writes,
            self.lost_events,
            self.gaps.longest,
            self.gaps.longest_own,
        );
        // node N: R READ, W WRITE, A answers
        let heard = told.iter().filter(|line| line.ends_with(" answers"));
        let heard = heard.map(|line| -> Vec<u64> {
            let (_, counts) = line.rsplit_once(": ").unwrap();
            counts.split(' ').filter_map(|word| word.parse().ok()).collect()
        });
        let heard = heard.fold([0; 3], |sums, counts| [0, 1, 2].map(|i| sums[i] + counts[i]));
        println!("bus: the nodes count {heard:?} READ, WRITE, answers");
        let line = [self.line.reads, self.line.writes].map(u64::from);
        let mut check = |is_so: bool, what: &str| {
            if !is_so {
                complaints.push(format!("bus: {what}"));
            }
        };
        check(self.gaps.are_within(LONGEST), "the line stalled");
        // One may be on its way.
        let is_sum = (0..=1).contains(&(requests as i64 - (replies + timeouts) as i64));
        check(is_sum, &format!("{requests} requests, {replies} answers, {timeouts} timeouts"));
        check(u64::from(self.line.reads) == requests, "the READs do not add up");
        check(heard[..2] == line, "the nodes did not hear what the master sent");
        check((replies..=replies + timeouts + 1).contains(&heard[2]), "answers were made or lost");
        // Readings that piled up while the machine kept us from taking them out: counted, and rare.
        let lost = u64::from(self.lost_events);
        check(lost * 1000 <= self.answers, "events were lost");
        let told = self.answers + lost;
        check((self.answers..=told).contains(&self.replied), "answers were not told");
        check(self.is_account_whole, "bytes are missing in the account");
        check(self.stopped.is_ok(), &format!("the stop: {:?}", self.stopped));
        check(rate > 200.0, "hardly anything was said");
    }
}
