//! Stops through a driver: `Ok` only for a motor that is still, and `drive_for` ends with one
//! (I12).

use crate::rig::*;

type Outcome = Result<(), DriveError<Unplugged>>;

const OWED_2: DriveError<Unplugged> = DriveError::StopsOwed(only(NodeId::N2));

fn stop(story: &mut Story, is_async: bool) -> Outcome {
    call!(is_async, story.bus, stop(NodeId::N2))
}

fn drive_for(story: &mut Story, span: Duration, is_async: bool) -> Outcome {
    call!(is_async, story.bus, drive_for(NodeId::N2, rps(3.0), span))
}

/// From now on the port fails, for this long.
fn fail_port(story: &Story, from: Instant, span: Duration) {
    let (world, unplugged) = (story.world.clone(), story.bus.port().unplugged.clone());
    story.world.add(move || {
        let now = world.now();
        unplugged.set(now >= from && now < from + span);
    });
}

#[test]
fn a_stop_that_is_not_paid_is_an_error_at_its_stated_deadline_and_stays_owed() {
    for is_async in BOTH {
        let mut story = Story::new(MasterConfig::direct()).discovered();
        story.bus.set_velocity(NodeId::N2, rps(3.0)).unwrap();
        story.unplug_two(true);
        let (begin, bound) = (story.world.now(), story.bus.role().stop_bound());
        assert_eq!(bound, Duration::from_micros(151_200), "a tenth of a second and a half");
        assert_eq!(stop(&mut story, is_async), Err(OWED_2));
        let took = story.world.now() - begin;
        assert!(took >= bound && took < bound + ms(1), "{took:?} of {bound:?}");
        assert_eq!(story.bus.role().stops_owed(), only(NodeId::N2));
        // The next calls continue it.
        story.unplug_two(false);
        story.run(100);
        assert_eq!(story.bus.role().stops_owed(), NodeSet::NONE);
        assert_eq!(story.told_two(), STOPPED);
    }
    let told = OWED_2.to_string();
    assert_eq!(told, "stop of node 2 not confirmed: a motor may be running");
}

#[test]
fn a_stop_continues_through_errors_of_the_port() {
    for is_async in BOTH {
        let mut story = Story::new(MasterConfig::direct()).discovered();
        story.bus.set_velocity(NodeId::N2, rps(3.0)).unwrap();
        let begin = story.world.now();
        fail_port(&story, begin, ms(10));
        assert_eq!(stop(&mut story, is_async), Ok(()));
        assert!(story.world.now() > begin + ms(10));
        assert_eq!(story.told_two(), STOPPED);
    }
}

#[test]
fn a_stop_of_all_lists_the_ids_that_have_never_answered() {
    for is_async in BOTH {
        let mut story = Story::new(MasterConfig::direct());
        let stopped = call!(is_async, story.bus, stop_all());
        let mut silent = NodeSet::ALL;
        silent.remove(NodeId::N2);
        silent.remove(NodeId::N5);
        assert_eq!(stopped, Err(DriveError::StopsOwed(silent)));
        assert_eq!(story.told_two(), STOPPED, "nodes that answer are stopped");
        assert_eq!(story.told_five(), HELD);
        let mut story = Story::new(only_two_and_five());
        let stopped = call!(is_async, story.bus, stop_all());
        assert_eq!(stopped, Ok(()), "no discovery is needed first");
        let mut story = Story::new(MasterConfig::direct());
        let both = only_two_and_five().nodes;
        let stopped = call!(is_async, story.bus, stop(both));
        assert_eq!((stopped, story.told_two()), (Ok(()), STOPPED), "nobody waits for other ids");
    }
}

#[test]
fn drive_for_keeps_the_command_for_its_time_and_ends_with_a_motor_that_is_still() {
    for is_async in BOTH {
        let mut story = Story::new(MasterConfig::direct()).discovered();
        let begin = story.world.now();
        assert_eq!(drive_for(&mut story, ms(50), is_async), Ok(()));
        let took = story.world.now() - begin;
        assert!(took >= ms(70) && took < ms(80), "{took:?}");
        assert_eq!(story.bus.role().stop_progress(NodeId::N2), StopProgress::StandingStill);
        assert_eq!(story.told_two(), STOPPED);
        let writes = story.two.borrow().role().statistics().writes;
        assert!(writes > 20, "only {writes} writes: the command is not repeated");
    }
}

#[test]
fn drive_for_is_a_constant_sign_of_life_even_on_a_quiet_bus() {
    for limit in [Duration::from_micros(1), ms(1), ms(20)] {
        for is_async in BOTH {
            let mut config = manual();
            config.dead_man = Some(limit);
            let mut story = Story::new(config).discovered();
            if limit >= ms(1) {
                assert_eq!(drive_for(&mut story, ms(100), is_async), Ok(()));
                assert_eq!(story.bus.role().statistics().dead_man, 0);
            } else {
                // The virtual clock is too coarse for this: the dead-man fires rightly, and the
                // call ends.
                assert!(drive_for(&mut story, ms(100), is_async).is_err());
            }
            assert_eq!(story.told_two(), STOPPED);
        }
    }
}

#[test]
fn drive_for_through_errors_of_the_port_ends_with_a_motor_that_is_still_and_returns_the_error() {
    for (after, span) in [(0, 5), (1, 5), (20, 1), (20, 5)] {
        for is_async in BOTH {
            let mut story = Story::new(MasterConfig::direct()).discovered();
            let begin = story.world.now();
            fail_port(&story, begin + ms(after), ms(span));
            let driven = drive_for(&mut story, ms(100), is_async);
            assert_eq!(driven, Err(DriveError::Port(Unplugged)), "{after} ms");
            assert!(story.world.now() < begin + ms(60), "it kept driving");
            assert_eq!(story.bus.role().stops_owed(), NodeSet::NONE);
            assert_eq!(story.told_two(), STOPPED);
        }
    }
}

#[test]
fn drive_for_of_a_lost_node_ends_with_the_owed_stop() {
    for is_async in BOTH {
        let mut story = Story::new(MasterConfig::direct()).discovered();
        let world = story.world.clone();
        let lost = story.world.now() + ms(10);
        let unplugged = story.two.borrow().port().unplugged.clone();
        story.world.add(move || unplugged.set(world.now() >= lost));
        assert_eq!(drive_for(&mut story, ms(5000), is_async), Err(OWED_2));
        assert!(story.world.now() < lost + ms(500), "at once, not at the end of its time");
    }
}

#[test]
fn a_dropped_drive_for_leaves_a_stop_that_the_next_call_sends() {
    dropped_at_any_await(30, |polls| {
        let mut story = Story::new(manual()).discovered();
        (story.bus.port_mut().most, story.bus.port_mut().stutters) = (1, true);
        let drive = story.bus.asynch().drive_for(NodeId::N2, rps(3.0), ms(1));
        let is_done = story.world.poll_times(polls, drive).is_some();
        if polls > 0 && !is_done {
            let progress = story.bus.role().stop_progress(NodeId::N2);
            let is_owed = matches!(progress, StopProgress::Owed | StopProgress::Confirmed);
            assert!(is_owed, "{progress:?} after {polls} polls");
        }
        assert_eq!(story.bus.role().set_point(NodeId::N2).filter(|it| Some(*it) != STOPPED), None);
        // Any call.
        story.world.block_on(story.bus.asynch().next_event(Duration::ZERO)).unwrap();
        story.world.block_on(story.bus.asynch().run_for(ms(30), |_, _, _| ())).unwrap();
        assert_eq!(story.bus.role().stops_owed(), NodeSet::NONE);
        let was_told = story.two.borrow().role().statistics().writes > 0;
        assert_eq!(story.told_two(), STOPPED.filter(|_| was_told), "after {polls} polls");
        assert!(was_told || polls == 0);
        // A set-point WRITE that had begun is not completed.
        assert!(story.two.borrow().role().counters().skipped() < WriteRequest::LEN as u64);
        is_done
    });
}

#[test]
fn a_dropped_stop_is_owed_and_the_next_call_sends_it() {
    let mut story = Story::new(manual()).discovered();
    story.bus.set_velocity(NodeId::N2, rps(3.0)).unwrap();
    story.bus.port_mut().stutters = true;
    assert_eq!(story.world.poll_times(1, story.bus.asynch().stop(NodeId::N2)), None);
    assert_eq!(story.bus.role().stops_owed(), only(NodeId::N2));
    story.run(10);
    assert_eq!(story.told_two(), STOPPED);
}

#[test]
fn a_motor_that_moves_on_after_its_confirmed_stop_is_still_moving() {
    for mut config in [MasterConfig::direct(), manual()] {
        config.coast = ms(100);
        for is_async in BOTH {
            // Node 2 reports that it still turns at 0.5 rps.
            let mut story = Story::new(config).discovered();
            story.two_obeys.set(false);
            let begin = story.world.now();
            assert_eq!(stop(&mut story, is_async), Err(DriveError::StillMoving(only(NodeId::N2))));
            let took = story.world.now() - begin;
            assert!(took >= ms(100) && took < ms(130), "{took:?}");
            assert_eq!(story.bus.role().stop_progress(NodeId::N2), StopProgress::StillMoving);
            let told = core::iter::from_fn(|| story.bus.role_mut().poll_event())
                .filter(|event| matches!(event, MasterEvent::StillMoving { .. }));
            assert_eq!(told.count(), 1);
            // It is stopped further, and a later stop sees it still.
            let writes = story.two.borrow().role().statistics().writes;
            story.run(100);
            assert!(story.two.borrow().role().statistics().writes >= writes + 5);
            story.two.borrow_mut().role_mut().set_velocity(rps(0.01));
            assert_eq!(stop(&mut story, is_async), Ok(()));
            assert_eq!(story.bus.role().stop_progress(NodeId::N2), StopProgress::StandingStill);
        }
    }
}

#[test]
fn a_node_that_loses_its_confirmation_has_time_to_be_still_all_the_same() {
    for is_async in BOTH {
        let mut story = Story::new(MasterConfig::direct()).discovered();
        story.two_obeys.set(false);
        // It coasts for 1500 ms, and is not heard from 1000 to 1020 ms.
        let (begin, clock) = (story.world.now(), story.world.clone());
        let two = story.two.clone();
        story.world.add(move || {
            if let Ok(mut two) = two.try_borrow_mut() {
                let at = clock.now() - begin;
                two.port().unplugged.set((ms(1000)..ms(1020)).contains(&at));
                two.role_mut().set_velocity(rps(if at < ms(1500) { 0.5 } else { 0.0 }));
            }
        });
        assert_eq!(stop(&mut story, is_async), Ok(()));
        let took = story.world.now() - begin;
        assert!((ms(1520)..ms(1600)).contains(&took), "{took:?}");
        let lost =
            |it: &MasterEvent| matches!(it, MasterEvent::Health { health: Health::Abnormal, .. });
        assert!(core::iter::from_fn(|| story.bus.role_mut().poll_event()).any(|it| lost(&it)));
    }
}

#[test]
fn a_stop_whose_port_fails_for_good_once_it_is_confirmed_ends_at_its_bound() {
    for is_async in BOTH {
        let mut story = Story::new(MasterConfig::direct()).discovered();
        story.two_obeys.set(false);
        let now = story.bus.now();
        story.bus.role_mut().stop(NodeId::N2, now);
        story.run(10);
        story.bus.port_mut().is_mute = true;
        assert_eq!(stop(&mut story, is_async), Err(DriveError::StillMoving(only(NodeId::N2))));
    }
}
