//! Stops of nodes that are lost: 0 rps every 20 ms, whatever else is searched for (I13).

use crate::rig::*;

const N2: (NodeId, Mode) = (NodeId::N2, Mode::Velocity);

/// Both presets with all ids, and each share of the search.
fn settings() -> impl Iterator<Item = MasterConfig> {
    let presets = [MasterConfig::direct(), MasterConfig::usb_adapter()];
    let with_share =
        |preset, share| with(preset, |config: &mut MasterConfig| config.recovery_share_pct = share);
    presets.into_iter().flat_map(move |it| [0, 1, 5, 50].map(|share| with_share(it, share)))
}

/// The longest time between two packets with this header.
fn longest(sent: &[(u32, Vec<u8>)], header: u8) -> u32 {
    let at: Vec<_> = sent.iter().filter(|it| it.1[0] == header).map(|it| it.0).collect();
    assert!(at.len() > 5, "{} packets", at.len());
    at.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap()
}

#[test]
fn a_velocity_node_gets_0_rps_within_50_ms_after_its_cable_is_back() {
    for config in settings() {
        for others in [&[N1][..], &[N1, N2, N3]] {
            let mut desk = Desk::with_nodes(config, others);
            desk.master.set_velocity(NodeId::N1, rps(5.0), desk.now).unwrap();
            desk.lose(NodeId::N1);
            // The ids that were never heard are owed a stop as well.
            desk.master.stop_all(desk.now);
            let sent = desk.follow(NodeId::N1, MS(1500), |_| Answer::Silence);
            assert!(sent[0].1 == write(NodeId::N1, 0.0) && sent[0].0 < 21_000, "{config:?}");
            // It may come back right behind the beginning of one.
            let pause = longest(&sent, WRITE) + 160;
            assert!(pause <= 50_000, "{pause} us, {} nodes, {config:?}", others.len());
        }
    }
}

#[test]
fn set_points_faster_than_the_line_do_not_hold_up_blind_stops() {
    const ALL: [NodeId; 7] =
        [NodeId::N2, NodeId::N3, NodeId::N4, NodeId::N5, NodeId::N6, NodeId::N7, NodeId::N8];
    for (config, busy) in settings().flat_map(|it| [(it, 2), (it, 3), (it, 7)]) {
        let config = with(config, |it| it.polling = Polling::Manual);
        let online: Vec<_> = ALL[..busy].iter().map(|node| (*node, Mode::Velocity)).collect();
        let mut desk = Desk::with_nodes(config, &[&[N1][..], &online].concat());
        desk.master.set_velocity(NodeId::N1, rps(5.0), desk.now).unwrap();
        desk.packets(1);
        desk.lose_by_hand(NodeId::N1);
        let (begin, mut written) = (desk.now, vec![]);
        while desk.now - begin < MS(1000) {
            for (node, _) in &online {
                desk.master.set_velocity(*node, rps(1.0), desk.now).unwrap();
            }
            written.extend(
                desk.follow(NodeId::N1, US(100), |_| Answer::Silence)
                    .into_iter()
                    .map(|(at, packet)| ((desk.now - begin).as_micros() + at, packet)),
            );
        }
        let pause = longest(&written, WRITE) + 160;
        assert!(pause <= 50_000, "{pause} us, {busy} nodes, {config:?}");
    }
}

#[test]
fn a_position_node_is_read_within_two_windows_for_each_commanded_node_that_is_silent() {
    let all = [N3, (NodeId::N4, Mode::Position), (NodeId::N6, Mode::Position)];
    for config in settings() {
        for nodes in [&all[..1], &all] {
            let mut desk = Desk::with_nodes(config, nodes);
            for (node, _) in nodes {
                desk.answer(*node, Answer::Silence);
            }
            desk.master.stop_all(desk.now);
            for (node, _) in nodes {
                desk.lose(*node);
            }
            let window = (config.reply_timeout + US(80 + 160)).as_micros();
            // Each has one attempt at once.
            desk.run(US(3 * window));
            let sent = desk.follow(NodeId::N3, MS(1500), |_| Answer::Silence);
            let (pause, most) = (longest(&sent, READ), nodes.len() as u32 * 2 * window);
            assert!(pause <= most, "{pause} of {most} us, {config:?}");
        }
    }
}

#[test]
fn blind_stops_leave_room_for_the_reads_that_find_the_nodes_on_the_slowest_line() {
    for (baud, gap) in [(500_000, MS(20)), (500_000, MS(100)), (9600, US(0))] {
        let config = with(MasterConfig::usb_adapter(), |config| {
            (config.baud, config.turnaround_gap) = (baud, gap);
            config.accepts_early = true;
        });
        let nodes = NodeId::ALL.map(|node| (node, Mode::Velocity));
        let mut desk = Desk::with_nodes(config, &nodes);
        for (node, _) in nodes {
            desk.answer(node, Answer::Silence);
        }
        desk.master.stop_all(desk.now);
        for (node, _) in nodes {
            desk.lose(node);
        }
        let sent = desk.follow(NodeId::N8, MS(30_000), |_| Answer::Silence);
        let reads = sent.iter().filter(|it| it.1[0] == READ).count();
        let blind = sent.iter().filter(|it| it.1 == write(NodeId::N8, 0.0)).count();
        assert!(reads > 2 && blind > 20, "{baud} bit/s, {gap:?}: {reads} READs, {blind} WRITEs");
        desk.answer(NodeId::N8, Answer::Velocity(0.0));
        desk.until(NodeId::N8, StopProgress::StandingStill);
    }
}

#[test]
fn a_stop_of_all_reads_each_id_that_was_never_heard_soon_however_busy_the_line_is() {
    for config in settings() {
        let mut desk = Desk::with_nodes(config, &[N1, N2]);
        desk.answer(NodeId::N8, Answer::Velocity(9.0));
        desk.master.stop_all(desk.now);
        let begin = desk.now;
        while desk.exchange().expect("nothing is sent") != write(NodeId::N8, 0.0) {}
        // An exchange for each id, and as many in between.
        let most = (config.reply_timeout + US(500)).saturating_mul(16);
        assert!(desk.now - begin <= most, "{:?}, {config:?}", desk.now - begin);
    }
}
