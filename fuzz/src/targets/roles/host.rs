//! A host under any calls, bytes and times, with a store that may fail: it sends no motion that was
//! not requested, is out of date or was not meant for its robot, and acknowledges what it keeps.

use arbitrary::{Result, Unstructured};
use axlewire::{
    endpoint::Endpoint,
    time::{Duration, Instant},
    ucp::{
        Frame, Host, Message, MotorControl,
        host::{BiasStore, HostConfig, NotStored},
        message::{ImuBias, MagBias},
    },
};

use super::{
    Clock, Tally, check_account, raw, serve,
    ucp_frames::{from_host, from_robot, is_to_robot},
    unsent,
};

/// The host of a rover.
pub(crate) fn ucp_host(data: &[u8], tally: &mut Tally) {
    let _ = host(&mut Unstructured::new(data), tally);
}

/// A store that can fail, and counts what it has kept.
#[derive(Clone, Debug, Default)]
struct Store {
    imu: Option<ImuBias>,
    mag: Option<MagBias>,
    fails: bool,
    forgets: bool,
}

impl BiasStore for Store {
    fn keeps(&self) -> bool {
        !self.forgets
    }

    fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>) {
        (self.imu, self.mag)
    }

    fn store_imu(&mut self, bias: ImuBias) -> core::result::Result<(), NotStored> {
        if self.fails {
            return Err(NotStored);
        }
        self.imu = Some(bias);
        Ok(())
    }

    fn store_mag(&mut self, bias: MagBias) -> core::result::Result<(), NotStored> {
        if self.fails {
            return Err(NotStored);
        }
        self.mag = Some(bias);
        Ok(())
    }
}

fn config(u: &mut Unstructured<'_>) -> Result<HostConfig> {
    let mut config = if u.arbitrary()? { HostConfig::direct() } else { HostConfig::usb_adapter() };
    config.ping_period = u.arbitrary::<bool>()?.then_some(Duration::from_millis(200));
    config.attempts = u.int_in_range(0..=4)?;
    config.low_ids_only = u.arbitrary()?;
    config.sends_first_stop = u.ratio(3, 4)?;
    config.command_period = Duration::from_millis(*u.choose(&[100, 0, 30])?);
    config.dead_man = Duration::from_millis(*u.choose(&[500, 0, 50])?);
    config.command_gap = Duration::from_millis(*u.choose(&[20, 0])?);
    config.baud = *u.choose(&[115_200, 9600, 0])?;
    Ok(config)
}

/// Length of the shortest frame, bytes.
const SHORTEST: u64 = 8;

/// The latest command: speed and turn, and when it was given.
type Wanted = Option<((i16, i16), Instant)>;

fn host(u: &mut Unstructured<'_>, tally: &mut Tally) -> Result<()> {
    let config = config(u)?;
    let mut clock = Clock::new(u)?;
    let store = Store { forgets: u.arbitrary()?, ..Store::default() };
    let mut host = Host::with_store(config, store, clock.0);
    // Whether an update may be in progress.
    let (mut wanted, mut updating): (Wanted, bool) = (None, false);
    let (mut is_first, mut given) = (config.sends_first_stop, 0);
    while !u.is_empty() {
        let now = clock.pass(u)?;
        let mut input = Vec::new();
        let action = u.int_in_range(0..=13_u8)?;
        match action {
            0 => input = raw(u)?.to_vec(),
            1 | 2 => input = from_robot(u)?,
            3 => {
                if let Ok(command) = MotorControl::new(u.arbitrary()?, u.arbitrary()?) {
                    drive(&mut host, command, &mut wanted, now);
                }
            }
            4 => {
                let command = MotorControl::new(u.int_in_range(-100..=100)?, 5).expect("legal");
                drive(&mut host, command, &mut wanted, now);
            }
            5 => {
                host.stop(now);
                wanted = None;
            }
            6 => drop(host.set_network_state(u.arbitrary()?, now)),
            7 => drop(host.start_calibration(u.arbitrary()?, now)),
            8 => drop(host.end_calibration(u.arbitrary()?, now)),
            9 => updating |= host.start_firmware_update(u.arbitrary()?, now).is_ok(),
            10 => host.end_firmware_update(now),
            11 => host.handle_transmit(unsent(u)?, now),
            12 => host.store_mut().fails = u.arbitrary()?,
            // Our own bytes on a line with an echo, or another host.
            _ => input = from_host(u)?,
        }
        given += input.len() as u64;
        host.handle_input(&input, now);
        // Several may come free at once, behind a header whose frame never ended.
        let misdirected = u64::from(host.statistics().misdirected);
        assert!(misdirected * SHORTEST <= given, "{misdirected} frames in {given} bytes");
        for packet in serve(&mut host, now, |_| {}) {
            let frame = Frame::parse(&packet).expect("a good frame");
            assert!(!config.low_ids_only || frame.id() < 5, "an id that hangs some builds (U14)");
            if core::mem::take(&mut is_first) {
                assert_eq!(packet[4..10], [2, 0, 0, 0, 0, 0], "the first frame (U16)");
            }
            check(&host, frame.message(), wanted, config, updating, now);
        }
        check_account(host.counters(), given, 64);
        tally.did(action);
    }
    Ok(())
}

fn drive(host: &mut Host<Store>, command: MotorControl, wanted: &mut Wanted, now: Instant) {
    if host.drive(command, now).is_ok() {
        *wanted = Some(((command.speed(), command.angular()), now));
    }
}

fn check(
    host: &Host<Store>,
    message: Message<'_>,
    wanted: Wanted,
    config: HostConfig,
    updating: bool,
    now: Instant,
) {
    match message {
        Message::MotorControl(command) => {
            assert!(MotorControl::try_from(*command).is_ok());
            let motion = (command.speed(), command.angular());
            let limit = config.dead_man.max(Duration::from_millis(1));
            let is_wanted = wanted
                .is_some_and(|(motion_wanted, at)| motion == motion_wanted && now - at < limit);
            assert!(motion == (0, 0) || is_wanted, "{motion:?} was not commanded");
        }
        Message::OtaRequest(_) => assert!(updating, "an update that was not started"),
        // U15: only what is kept is acknowledged. A store that forgets keeps a copy here, too.
        Message::ImuBiasAck(_) => assert!(host.store().imu.is_some(), "nothing was kept"),
        Message::MagBiasAck(_) => assert!(host.store().mag.is_some(), "nothing was kept"),
        Message::Biases(biases) => {
            assert_eq!(Some(biases.imu()), host.store().imu);
            assert_eq!(Some(biases.mag()), host.store().mag);
        }
        message => assert!(is_to_robot(&message), "{message:?} from a host (U13)"),
    }
}
