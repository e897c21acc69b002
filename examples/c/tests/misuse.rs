//! What a function does with pointers, lengths and objects that are wrong: the error that the
//! header names, and nothing else.

use std::{collections::BTreeSet, path::Path, ptr::null_mut};

use axlewire_c::*;

/// What is wrong with one of the pointers.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wrong {
    Nothing,
    Null,
    Unaligned,
}

/// An argument, which may be a pointer.
trait Argument: Sized {
    fn spoilt(self, _: Wrong) -> Option<Self> {
        None
    }
}

impl<T> Argument for *mut T {
    fn spoilt(self, wrong: Wrong) -> Option<Self> {
        match wrong {
            Wrong::Nothing => None,
            Wrong::Null => Some(null_mut()),
            Wrong::Unaligned => (align_of::<T>() > 1).then(|| self.wrapping_byte_add(1)),
        }
    }
}

impl<T> Argument for *const T {
    fn spoilt(self, wrong: Wrong) -> Option<Self> {
        self.cast_mut().spoilt(wrong).map(<*mut T>::cast_const)
    }
}

macro_rules! numbers {
    ($($number:ty),*) => {
        $(impl Argument for $number {})*
    };
}
numbers!(u8, u16, i16, i32, u32, u64, usize, f32);
numbers!(axle_ikeya_position, axle_ucp_imu_bias, axle_ucp_mag_bias, axle_ucp_motor);

/// Spoils the pointer at this place.
struct Spoiler {
    place: usize,
    wrong: Wrong,
    next: usize,
    done: bool,
}

impl Spoiler {
    fn pass<T: Argument + Copy>(&mut self, argument: T) -> T {
        let here = self.next == self.place;
        self.next += 1;
        match argument.spoilt(self.wrong).filter(|_| here) {
            Some(spoilt) => {
                self.done = true;
                spoilt
            }
            None => argument,
        }
    }
}

/// A function with arguments that are right.
struct Call<M> {
    name: &'static str,
    /// Calls it with a pointer spoilt; whether there was one at that place.
    call: Box<dyn Fn(*mut M, usize, Wrong) -> (axle_result, bool)>,
}

impl<M> Call<M> {
    fn with(&self, object: *mut M) -> axle_result {
        (self.call)(object, usize::MAX, Wrong::Nothing).0
    }
}

macro_rules! calls {
    ($($function:ident($($argument:expr),*);)*) => {
        vec![$(Call {
            name: stringify!($function),
            call: Box::new(|object, place, wrong| {
                let mut spoiler = Spoiler { place, wrong, next: 0, done: false };
                let result = $function(spoiler.pass(object), $(spoiler.pass($argument)),*);
                (result, spoiler.done)
            }),
        }),*]
    };
}

fn out<T: Default + 'static>() -> *mut T {
    Box::leak(Box::default())
}

fn held<T: 'static>(value: T) -> *mut T {
    Box::leak(Box::new(value))
}

const BYTES: [u8; 4] = [1, 2, 3, 4];

fn bytes() -> *const u8 {
    BYTES.as_ptr()
}

fn stream_event() -> *mut axle_stream_event {
    held(axle_stream_event { kind: 0, reason: 0, bytes: null_mut(), length: 0, skipped: 0 })
}

/// Memory for an object, which nothing was written to but this byte.
fn memory<M: 'static>(byte: u8) -> *mut M {
    let memory = Box::leak(Box::<M>::new_uninit()).as_mut_ptr();
    // SAFETY: it is memory of that size.
    unsafe { memory.cast::<u8>().write_bytes(byte, size_of::<M>()) };
    memory
}

/// The first number in an object tells its state.
fn state<M>(object: *mut M) -> *mut u32 {
    object.cast()
}

/// All functions of an object, of which the first initialises it.
fn an_object<M: 'static>(init: &Call<M>, calls: &[Call<M>], seen: &mut BTreeSet<&'static str>) {
    let object = memory::<M>(0);
    for call in calls {
        assert_eq!(call.with(object), AXLE_ERROR_NOT_INITIALIZED, "{}", call.name);
    }
    // Whatever the memory holds, also what is left of a call that never ended.
    for byte in [0xFF, 0x55, 0x00] {
        let object = memory::<M>(byte);
        assert_eq!(init.with(object), AXLE_OK);
    }
    assert_eq!(init.with(object), AXLE_OK);
    // SAFETY: the memory of an object, which no call uses now.
    let magic = unsafe { state(object).read() };
    let every = std::iter::once(init).chain(calls);
    for call in every {
        assert!(seen.insert(call.name), "{} twice", call.name);
        for wrong in [Wrong::Null, Wrong::Unaligned] {
            let error = if wrong == Wrong::Null { AXLE_ERROR_NULL } else { AXLE_ERROR_ALIGNMENT };
            let mut places = 0;
            for place in 0..8 {
                let (result, spoilt) = (call.call)(object, place, wrong);
                if spoilt {
                    assert_eq!(result, error, "{} at {place}, {wrong:?}", call.name);
                    places += 1;
                }
            }
            assert!(places > 0, "{}: an object is a pointer", call.name);
        }
        // The object works.
        let result = call.with(object);
        assert!(result >= 0 || result <= -20, "{}: {result}", call.name);
    }
    for call in calls {
        // As a call in an interrupt sees it, during another one.
        // SAFETY: the memory of an object, which no call uses now.
        unsafe { state(object).write(!magic) };
        assert_eq!(call.with(object), AXLE_ERROR_BUSY, "{}", call.name);
        // Overwritten.
        // SAFETY: as above.
        unsafe { state(object).write(magic ^ 1) };
        assert_eq!(call.with(object), AXLE_ERROR_NOT_INITIALIZED, "{}", call.name);
        // SAFETY: as above.
        unsafe { state(object).write(magic) };
        let result = call.with(object);
        assert!(result >= 0 || result <= -20, "{}: {result}", call.name);
    }
    // An object of another kind: none has the same number, nor that of one in use.
    for other in MAGICS {
        let other = u32::from_le_bytes(*other);
        if other != magic {
            assert_ne!(!other, magic);
            // SAFETY: as above.
            unsafe { state(object).write(other) };
            for call in calls {
                assert_eq!(call.with(object), AXLE_ERROR_NOT_INITIALIZED, "{}", call.name);
            }
        }
    }
    // SAFETY: as above.
    unsafe { state(object).write(magic) };
}

const MAGICS: [&[u8; 4]; 8] =
    [b"axDi", b"axDu", b"axM1", b"axM3", b"axS1", b"axS3", b"axHo", b"axRo"];

/// Init fails with another size, and leaves the memory as it is.
fn other_sizes(size: usize, init: impl Fn(usize) -> axle_result) {
    for other in [0, 1, size - 1, size + 1, size * 2, usize::MAX] {
        assert_eq!(init(other), AXLE_ERROR_SIZE);
    }
    assert_eq!(init(size), AXLE_OK);
}

/// Bytes that are too many, or in the object.
fn bad_bytes<M>(object: *mut M, input: impl Fn(*const u8, usize) -> axle_result) {
    for length in [isize::MAX as usize + 1, usize::MAX] {
        assert_eq!(input(bytes(), length), AXLE_ERROR_TOO_LONG);
        assert_eq!(input(object.cast(), length), AXLE_ERROR_TOO_LONG);
    }
    let start: *const u8 = object.cast();
    for offset in [0, 1, size_of::<M>() / 2, size_of::<M>() - 1] {
        assert_eq!(input(start.wrapping_add(offset), 1), AXLE_ERROR_OVERLAP);
        assert_eq!(input(start.wrapping_add(offset), 0), AXLE_OK);
    }
    assert_eq!(input(std::ptr::null(), 0), AXLE_OK);
    assert_eq!(input(bytes(), BYTES.len()), AXLE_OK);
}

macro_rules! decoder {
    ($decode:ident $many:ident $push:ident $poll:ident $spare:ident $commit:ident $idle:ident $pending:ident
        $counters:ident) => {
        calls! {
            $decode(held(bytes()), held(BYTES.len()), stream_event());
            $many(held(bytes()), held(BYTES.len()), stream_event(), 1, out());
            $push(7);
            $poll(stream_event());
            $spare(held(null_mut()), out());
            $commit(1);
            $idle();
            $pending(out());
            $counters(out::<axle_counters>());
        }
    };
}

macro_rules! role {
    ($input:ident $old:ident $timeout:ident $transmit:ident $transmitted:ident $outdated:ident
        $deadline:ident $rules:ident) => {
        calls! {
            $input(bytes(), BYTES.len(), 5);
            $old(bytes(), BYTES.len(), 4, 5);
            $timeout(5);
            $transmit(5, held(std::ptr::null()), out());
            $transmitted(AXLE_TRANSMIT_TAKEN, 5);
            $outdated();
            $deadline(out());
            $rules(out::<axle_line_rules>());
        }
    };
}

fn master_config() -> *const axle_ikeya_master_config {
    let config = held([0_u64; 8]).cast::<axle_ikeya_master_config>();
    assert_eq!(axle_ikeya_master_config_direct(config), AXLE_OK);
    config
}

fn slave_config() -> *const axle_ikeya_slave_config {
    let config = held([0_u64; 8]).cast::<axle_ikeya_slave_config>();
    assert_eq!(axle_ikeya_slave_config_direct(config), AXLE_OK);
    config
}

fn host_config() -> *const axle_ucp_host_config {
    let config = held([0_u64; 8]).cast::<axle_ucp_host_config>();
    assert_eq!(axle_ucp_host_config_direct(config), AXLE_OK);
    config
}

fn robot_config() -> *const axle_ucp_robot_config {
    let config = held([0_u64; 8]).cast::<axle_ucp_robot_config>();
    assert_eq!(axle_ucp_robot_config_direct(config), AXLE_OK);
    config
}

fn positions() -> *const axle_ikeya_position {
    held([axle_ikeya_position::default(); 3]).cast()
}

fn speeds() -> *const f32 {
    held([1.0_f32; 3]).cast()
}

macro_rules! master {
    ($init:ident $size:ident $event:ident $discover:ident $stop:ident $stop_all:ident $check:ident
        $read:ident $confirm:ident $keep_alive:ident $release:ident $node:ident $bus:ident $statistics:ident
        $node_statistics:ident $counters:ident $velocity:ident($speed:expr)
        $position:ident($to:expr)) => {{
        let mut init = calls! { $init($size, master_config(), 0); };
        let calls = calls! {
            $event(out::<axle_ikeya_master_event>());
            $discover(5);
            $stop(1, 5);
            $stop_all(5);
            $check(1, held(axle_ikeya_motion { mode: AXLE_IKEYA_MODE_VELOCITY, ..Default::default() }));
            $read(1, 5);
            $confirm(1, 5);
            $keep_alive(5);
            $release(1);
            $node(1, out::<axle_ikeya_node>());
            $bus(out::<axle_ikeya_bus>());
            $statistics(out::<axle_ikeya_master_statistics>());
            $node_statistics(1, out::<axle_ikeya_node_statistics>());
            $counters(out::<axle_counters>());
            $velocity(1, $speed, 5);
            $position(1, $to, 5);
        };
        (init.remove(0), calls)
    }};
}

macro_rules! slave {
    ($init:ident $size:ident $event:ident $command:ident $mode:ident $set_mode:ident
        $statistics:ident $counters:ident $velocity:ident($speed:expr) $position:ident($to:expr)) => {{
        let mut init = calls! {
            $init($size, 1, AXLE_IKEYA_MODE_VELOCITY, slave_config(), 0);
        };
        let calls = calls! {
            $event(out::<axle_ikeya_slave_event>());
            $command(5, out::<axle_ikeya_motion>());
            $mode(out::<axle_ikeya_mode>());
            $set_mode(AXLE_IKEYA_MODE_POSITION);
            $statistics(out::<axle_ikeya_slave_statistics>());
            $counters(out::<axle_counters>());
            $velocity($speed);
            $position($to);
        };
        (init.remove(0), calls)
    }};
}

type Functions<M> = (Call<M>, Vec<Call<M>>);

fn of_masters() -> (Functions<axle_ikeya_master>, Functions<axle_ikeya3_master>) {
    let mut one = master!(axle_ikeya_master_init AXLE_IKEYA_MASTER_SIZE
        axle_ikeya_master_poll_event axle_ikeya_master_discover axle_ikeya_master_stop
        axle_ikeya_master_stop_all axle_ikeya_master_check axle_ikeya_master_read
        axle_ikeya_master_confirm
        axle_ikeya_master_keep_alive axle_ikeya_master_release axle_ikeya_master_get_node
        axle_ikeya_master_get_bus axle_ikeya_master_get_statistics
        axle_ikeya_master_get_node_statistics axle_ikeya_master_get_counters
        axle_ikeya_master_set_velocity(1.0)
        axle_ikeya_master_set_position(axle_ikeya_position::default()));
    one.1.extend(role!(axle_ikeya_master_handle_input axle_ikeya_master_handle_old_input
        axle_ikeya_master_handle_timeout axle_ikeya_master_poll_transmit
        axle_ikeya_master_handle_transmit axle_ikeya_master_is_outdated
        axle_ikeya_master_next_deadline axle_ikeya_master_get_line_rules));
    let mut three = master!(axle_ikeya3_master_init AXLE_IKEYA3_MASTER_SIZE
        axle_ikeya3_master_poll_event axle_ikeya3_master_discover axle_ikeya3_master_stop
        axle_ikeya3_master_stop_all axle_ikeya3_master_check axle_ikeya3_master_read
        axle_ikeya3_master_confirm
        axle_ikeya3_master_keep_alive axle_ikeya3_master_release axle_ikeya3_master_get_node
        axle_ikeya3_master_get_bus axle_ikeya3_master_get_statistics
        axle_ikeya3_master_get_node_statistics axle_ikeya3_master_get_counters
        axle_ikeya3_master_set_velocity(speeds()) axle_ikeya3_master_set_position(positions()));
    three.1.extend(role!(axle_ikeya3_master_handle_input axle_ikeya3_master_handle_old_input
        axle_ikeya3_master_handle_timeout axle_ikeya3_master_poll_transmit
        axle_ikeya3_master_handle_transmit axle_ikeya3_master_is_outdated
        axle_ikeya3_master_next_deadline axle_ikeya3_master_get_line_rules));
    (one, three)
}

fn of_slaves() -> (Functions<axle_ikeya_slave>, Functions<axle_ikeya3_slave>) {
    let mut one = slave!(axle_ikeya_slave_init AXLE_IKEYA_SLAVE_SIZE axle_ikeya_slave_poll_event
        axle_ikeya_slave_get_command axle_ikeya_slave_get_mode axle_ikeya_slave_set_mode axle_ikeya_slave_get_statistics
        axle_ikeya_slave_get_counters axle_ikeya_slave_set_velocity(1.0)
        axle_ikeya_slave_set_position(axle_ikeya_position::default()));
    one.1.extend(role!(axle_ikeya_slave_handle_input axle_ikeya_slave_handle_old_input
        axle_ikeya_slave_handle_timeout axle_ikeya_slave_poll_transmit
        axle_ikeya_slave_handle_transmit axle_ikeya_slave_is_outdated
        axle_ikeya_slave_next_deadline axle_ikeya_slave_get_line_rules));
    let mut three = slave!(axle_ikeya3_slave_init AXLE_IKEYA3_SLAVE_SIZE
        axle_ikeya3_slave_poll_event axle_ikeya3_slave_get_command axle_ikeya3_slave_get_mode axle_ikeya3_slave_set_mode
        axle_ikeya3_slave_get_statistics axle_ikeya3_slave_get_counters
        axle_ikeya3_slave_set_velocity(speeds()) axle_ikeya3_slave_set_position(positions()));
    three.1.extend(role!(axle_ikeya3_slave_handle_input axle_ikeya3_slave_handle_old_input
        axle_ikeya3_slave_handle_timeout axle_ikeya3_slave_poll_transmit
        axle_ikeya3_slave_handle_transmit axle_ikeya3_slave_is_outdated
        axle_ikeya3_slave_next_deadline axle_ikeya3_slave_get_line_rules));
    (one, three)
}

fn of_host() -> Functions<axle_ucp_host> {
    let mut calls = calls! {
        axle_ucp_host_poll_event(out::<axle_ucp_host_event>());
        axle_ucp_host_set_speed(10, 0, 5);
        axle_ucp_host_drive(axle_ucp_motor::default(), 5);
        axle_ucp_host_stop(5);
        axle_ucp_host_start_calibration(AXLE_UCP_CALIBRATION_IMU, 5);
        axle_ucp_host_end_calibration(AXLE_UCP_CALIBRATION_IMU, 5);
        axle_ucp_host_set_network_state(1, 5);
        axle_ucp_host_start_firmware_update(40, 5);
        axle_ucp_host_end_firmware_update(5);
        axle_ucp_host_get_robot_state(out::<axle_ucp_robot_state>());
        axle_ucp_host_take_report(out::<axle_ucp_report>());
        axle_ucp_host_get_report(out::<axle_ucp_report>());
        axle_ucp_host_take_round_trip(out::<u32>());
        axle_ucp_host_set_imu_bias(axle_ucp_imu_bias::default());
        axle_ucp_host_set_mag_bias(axle_ucp_mag_bias::default());
        axle_ucp_host_get_imu_bias(out::<axle_ucp_imu_bias>());
        axle_ucp_host_get_mag_bias(out::<axle_ucp_mag_bias>());
        axle_ucp_host_get_statistics(out::<axle_ucp_host_statistics>());
        axle_ucp_host_get_counters(out::<axle_counters>());
    };
    calls.extend(role!(axle_ucp_host_handle_input axle_ucp_host_handle_old_input
        axle_ucp_host_handle_timeout axle_ucp_host_poll_transmit axle_ucp_host_handle_transmit
        axle_ucp_host_is_outdated axle_ucp_host_next_deadline axle_ucp_host_get_line_rules));
    let mut init = calls! { axle_ucp_host_init(AXLE_UCP_HOST_SIZE, host_config(), 0); };
    (init.remove(0), calls)
}

fn of_robot() -> Functions<axle_ucp_robot> {
    let mut calls = calls! {
        axle_ucp_robot_poll_event(out::<axle_ucp_robot_event>());
        axle_ucp_robot_get_command(5, out::<axle_ucp_motor>());
        axle_ucp_robot_take_command(5, out::<axle_ucp_motor>());
        axle_ucp_robot_set_telemetry(out::<axle_ucp_telemetry>().cast_const(), 5);
        axle_ucp_robot_calibration_result_imu(axle_ucp_imu_bias::default(), 5);
        axle_ucp_robot_calibration_result_mag(axle_ucp_mag_bias::default(), 5);
        axle_ucp_robot_answer_update(AXLE_UCP_OTA_FORBIDDEN, 5);
        axle_ucp_robot_get_calibration(out::<axle_ucp_calibration>());
        axle_ucp_robot_get_network_state(out::<axle_ucp_network_state>());
        axle_ucp_robot_abort_calibration(out::<axle_ucp_calibration>());
        axle_ucp_robot_get_statistics(out::<axle_ucp_robot_statistics>());
        axle_ucp_robot_get_counters(out::<axle_counters>());
    };
    calls.extend(role!(axle_ucp_robot_handle_input axle_ucp_robot_handle_old_input
        axle_ucp_robot_handle_timeout axle_ucp_robot_poll_transmit axle_ucp_robot_handle_transmit
        axle_ucp_robot_is_outdated axle_ucp_robot_next_deadline axle_ucp_robot_get_line_rules));
    let mut init = calls! { axle_ucp_robot_init(AXLE_UCP_ROBOT_SIZE, robot_config(), 0); };
    (init.remove(0), calls)
}

fn of_decoders() -> (Functions<axle_ikeya_decoder>, Functions<axle_ucp_decoder>) {
    let mut ikeya = calls! {
        axle_ikeya_decoder_init(AXLE_IKEYA_DECODER_SIZE, AXLE_IKEYA_TO_SLAVE);
    };
    let mut ucp = calls! { axle_ucp_decoder_init(AXLE_UCP_DECODER_SIZE); };
    (
        (
            ikeya.remove(0),
            decoder!(axle_ikeya_decoder_decode axle_ikeya_decoder_decode_many
            axle_ikeya_decoder_push axle_ikeya_decoder_poll axle_ikeya_decoder_spare axle_ikeya_decoder_commit
            axle_ikeya_decoder_idle axle_ikeya_decoder_get_pending
            axle_ikeya_decoder_get_counters),
        ),
        (
            ucp.remove(0),
            decoder!(axle_ucp_decoder_decode axle_ucp_decoder_decode_many
            axle_ucp_decoder_push axle_ucp_decoder_poll axle_ucp_decoder_spare axle_ucp_decoder_commit
            axle_ucp_decoder_idle axle_ucp_decoder_get_pending axle_ucp_decoder_get_counters),
        ),
    )
}

/// The functions without an object; their first pointer counts as one.
fn without_object(seen: &mut BTreeSet<&'static str>) {
    fn check<M>(calls: Vec<Call<M>>, argument: *mut M, seen: &mut BTreeSet<&'static str>) {
        for call in calls {
            assert!(seen.insert(call.name));
            for wrong in [Wrong::Null, Wrong::Unaligned] {
                for place in 0..8 {
                    let (result, spoilt) = (call.call)(argument, place, wrong);
                    if spoilt && wrong == Wrong::Null {
                        assert_eq!(result, AXLE_ERROR_NULL, "{} at {place}", call.name);
                    } else if spoilt {
                        assert_eq!(result, AXLE_ERROR_ALIGNMENT, "{} at {place}", call.name);
                    }
                }
            }
            let result = call.with(argument);
            assert!(result >= 0 || result <= -20, "{}: {result}", call.name);
        }
    }
    let to = || held([0_u8; 64]).cast::<u8>();
    let packet = axle_ikeya_packet { kind: 1, node: 1, ..Default::default() };
    let message = axle_ucp_message { kind: AXLE_UCP_PING, ..Default::default() };
    check(calls! { axle_ikeya_master_config_direct(); }, master_config().cast_mut(), seen);
    check(calls! { axle_ikeya_master_config_usb_adapter(); }, master_config().cast_mut(), seen);
    check(calls! { axle_ikeya_slave_config_direct(); }, slave_config().cast_mut(), seen);
    check(calls! { axle_ikeya_slave_config_usb_adapter(); }, slave_config().cast_mut(), seen);
    check(calls! { axle_ucp_host_config_direct(); }, host_config().cast_mut(), seen);
    check(calls! { axle_ucp_host_config_usb_adapter(); }, host_config().cast_mut(), seen);
    check(
        calls! { axle_ucp_host_get_calibration_bound(out::<u32>()); },
        host_config().cast_mut(),
        seen,
    );
    let bound = out::<u32>();
    assert_eq!(axle_ucp_host_get_calibration_bound(host_config(), bound), AXLE_OK);
    let expected = axlewire::ucp::host::HostConfig::direct().calibration_bound().as_micros();
    // SAFETY: the function has written there.
    assert_eq!(unsafe { bound.read() }, expected);
    let schedule = || {
        let schedule = held([0_u64; 4]).cast::<axle_ikeya_schedule>();
        assert_eq!(axle_ikeya_schedule_default(schedule, 8), AXLE_OK);
        schedule
    };
    check(calls! { axle_ikeya_schedule_default(8); }, schedule(), seen);
    check(calls! { axle_ikeya_schedule_get_cycle(out::<axle_ikeya_cycle>()); }, schedule(), seen);
    check(calls! { axle_ucp_robot_config_direct(); }, robot_config().cast_mut(), seen);
    check(calls! { axle_ucp_robot_config_usb_adapter(); }, robot_config().cast_mut(), seen);
    check(
        calls! { axle_ikeya_encode(held([0_u8; 64]).cast::<u8>(), 64, out()); },
        held(packet),
        seen,
    );
    check(
        calls! { axle_ucp_encode(held([0_u8; 64]).cast::<u8>(), 64, out()); },
        held(message),
        seen,
    );
    check(calls! { axle_ikeya_parse(4, out::<axle_ikeya_packet>()); }, to(), seen);
    check(calls! { axle_ucp_parse(4, out::<axle_ucp_message>()); }, to(), seen);
    // Numbers first.
    seen.extend(["axle_ikeya_position_from_counts", "axle_ikeya_dip_switches"]);
    assert_eq!(axle_ikeya_position_from_counts(1, null_mut()), AXLE_ERROR_NULL);
    let odd = out::<u64>().wrapping_byte_add(1);
    assert_eq!(axle_ikeya_position_from_counts(1, odd.cast()), AXLE_ERROR_ALIGNMENT);
    assert_eq!(axle_ikeya_dip_switches(2, 1, null_mut(), out()), AXLE_ERROR_NULL);
    assert_eq!(axle_ikeya_dip_switches(2, 1, out(), null_mut()), AXLE_ERROR_NULL);
    assert_eq!(axle_ikeya_dip_switches(16, 1, out(), out()), AXLE_ERROR_DIP_SWITCH);
    assert_eq!(axle_ikeya_dip_switches(0, 2, out(), out()), AXLE_ERROR_DIP_SWITCH);
    assert_eq!(axle_ikeya_dip_switches(0, 3, out(), out()), AXLE_ERROR_VALUE);
    // No results: what they give is said in the header.
    seen.extend(["axle_crc16", "axle_clock32_at", "axle_wire_time_us", "axle_result_name"]);
    seen.extend(["axle_result_text", "axle_ikeya_position_counts"]);
    macro_rules! names {
        ($($name:ident)*) => {$(
            seen.insert(stringify!($name));
            assert!(!$name(1).is_null() && !$name(254).is_null());
        )*};
    }
    names!(axle_reason_name axle_ikeya_mode_name axle_ikeya_packet_name axle_ikeya_health_name
        axle_ikeya_cause_name axle_ikeya_stop_name axle_ikeya_master_event_name
        axle_ikeya_slave_event_name axle_ucp_message_name axle_ucp_host_event_name
        axle_ucp_robot_event_name axle_ucp_link_name axle_ucp_stop_name axle_ucp_failure_name
        axle_ucp_calibration_name axle_ucp_ota_status_name axle_ucp_network_state_name);
    assert_eq!(axle_crc16(null_mut(), 9), 0xFFFF);
    assert_eq!(axle_crc16(bytes(), usize::MAX), 0xFFFF);
    assert_eq!(axle_clock32_at(null_mut(), 9), 0);
    assert_eq!(axle_clock32_at(odd.cast(), 9), 0);
    let clock = out::<axle_clock32>();
    for (timer, at) in [(5, 5), (u32::MAX, u32::MAX.into()), (0, 1 << 32), (7, (1 << 32) + 7)] {
        assert_eq!(axle_clock32_at(clock, timer), at);
    }
    assert_eq!(axle_wire_time_us(8, 0), axlewire::time::wire_time(8, 0).as_micros());
    assert!(!axle_result_name(i32::MIN).is_null() && !axle_result_text(i32::MAX).is_null());
}

#[test]
fn each_function_of_the_header_names_what_is_wrong_and_the_object_still_works() {
    let mut seen = BTreeSet::new();
    without_object(&mut seen);
    let (one, three) = of_masters();
    an_object(&one.0, &one.1, &mut seen);
    an_object(&three.0, &three.1, &mut seen);
    let (one, three) = of_slaves();
    an_object(&one.0, &one.1, &mut seen);
    an_object(&three.0, &three.1, &mut seen);
    let (host, robot) = (of_host(), of_robot());
    an_object(&host.0, &host.1, &mut seen);
    an_object(&robot.0, &robot.1, &mut seen);
    let (ikeya, ucp) = of_decoders();
    an_object(&ikeya.0, &ikeya.1, &mut seen);
    an_object(&ucp.0, &ucp.1, &mut seen);

    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("include/axlewire.h");
    let header = std::fs::read_to_string(path).unwrap();
    let code = header.lines().filter(|line| !line.trim_start().starts_with(['/', '*']));
    let declared: BTreeSet<&str> = code
        .filter_map(|line| line.split_once('('))
        .filter_map(|(before, _)| before.split([' ', '*']).next_back())
        .filter(|name| name.starts_with("axle_"))
        .collect();
    let either: Vec<_> = declared.symmetric_difference(&seen).collect();
    assert!(either.is_empty(), "in the header or tested, but not both: {either:?}");
}

#[test]
fn memory_of_another_size_is_refused() {
    let object = memory::<axle_ikeya_master>(0);
    let (size, config) = (AXLE_IKEYA_MASTER_SIZE, master_config());
    other_sizes(size, |size| axle_ikeya_master_init(object, size, config, 0));
    let object = memory::<axle_ikeya3_master>(0);
    let size = AXLE_IKEYA3_MASTER_SIZE;
    other_sizes(size, |size| axle_ikeya3_master_init(object, size, config, 0));
    let object = memory::<axle_ikeya_slave>(0);
    let (size, config) = (AXLE_IKEYA_SLAVE_SIZE, slave_config());
    other_sizes(size, |size| axle_ikeya_slave_init(object, size, 1, 1, config, 0));
    let object = memory::<axle_ikeya3_slave>(0);
    let size = AXLE_IKEYA3_SLAVE_SIZE;
    other_sizes(size, |size| axle_ikeya3_slave_init(object, size, 1, 1, config, 0));
    let object = memory::<axle_ucp_host>(0);
    let config = host_config();
    other_sizes(AXLE_UCP_HOST_SIZE, |size| axle_ucp_host_init(object, size, config, 0));
    let object = memory::<axle_ucp_robot>(0);
    let config = robot_config();
    other_sizes(AXLE_UCP_ROBOT_SIZE, |size| axle_ucp_robot_init(object, size, config, 0));
    let object = memory::<axle_ikeya_decoder>(0);
    other_sizes(AXLE_IKEYA_DECODER_SIZE, |size| axle_ikeya_decoder_init(object, size, 1));
    let object = memory::<axle_ucp_decoder>(0);
    other_sizes(AXLE_UCP_DECODER_SIZE, |size| axle_ucp_decoder_init(object, size));
}

#[test]
fn bytes_that_are_too_many_or_in_the_object_are_refused() {
    macro_rules! role {
        ($of:expr, $input:ident, $old:ident) => {{
            let (init, _) = $of;
            let object = memory(0);
            assert_eq!(init.with(object), AXLE_OK);
            bad_bytes(object, |bytes, length| $input(object, bytes, length, 5));
            bad_bytes(object, |bytes, length| $old(object, bytes, length, 4, 5));
        }};
    }
    role!(of_masters().0, axle_ikeya_master_handle_input, axle_ikeya_master_handle_old_input);
    role!(of_masters().1, axle_ikeya3_master_handle_input, axle_ikeya3_master_handle_old_input);
    role!(of_slaves().0, axle_ikeya_slave_handle_input, axle_ikeya_slave_handle_old_input);
    role!(of_slaves().1, axle_ikeya3_slave_handle_input, axle_ikeya3_slave_handle_old_input);
    role!(of_host(), axle_ucp_host_handle_input, axle_ucp_host_handle_old_input);
    role!(of_robot(), axle_ucp_robot_handle_input, axle_ucp_robot_handle_old_input);

    let object = memory(0);
    assert_eq!(of_decoders().1.0.with(object), AXLE_OK);
    bad_bytes(object, |mut bytes, mut length| {
        let before = (bytes, length);
        match axle_ucp_decoder_decode(object, &mut bytes, &mut length, stream_event()) {
            AXLE_NONE | AXLE_OK => AXLE_OK,
            error => {
                assert_eq!((bytes, length), before);
                error
            }
        }
    });
    let many = |events: *mut axle_stream_event, capacity| {
        let (mut from, mut length) = (events.cast_const().cast::<u8>(), 1);
        axle_ucp_decoder_decode_many(object, &mut from, &mut length, events, capacity, out())
    };
    assert_eq!(many(stream_event(), 0), AXLE_ERROR_VALUE);
    assert_eq!(many(stream_event(), 1), AXLE_ERROR_OVERLAP);
    let decode = |event: *mut axle_stream_event| {
        let (mut from, mut length) = (event.cast_const().cast::<u8>(), 1);
        axle_ucp_decoder_decode(object, &mut from, &mut length, event)
    };
    assert_eq!(decode(stream_event()), AXLE_ERROR_OVERLAP);
    let (from, length) = (held(bytes()), held(BYTES.len()));
    for capacity in [isize::MAX as usize, usize::MAX] {
        let events = stream_event().wrapping_add(1 << 20);
        let result = axle_ucp_decoder_decode_many(object, from, length, events, capacity, out());
        assert_eq!(result, AXLE_ERROR_TOO_LONG);
    }
    let too_long = usize::MAX;
    assert_eq!(axle_ikeya_parse(bytes(), too_long, out()), AXLE_ERROR_TOO_LONG);
    assert_eq!(axle_ucp_parse(bytes(), too_long, out()), AXLE_ERROR_TOO_LONG);
    let to = held([0_u8; 64]).cast::<u8>();
    let packet = held(axle_ikeya_packet::default());
    assert_eq!(axle_ikeya_encode(packet, to, too_long, out()), AXLE_ERROR_TOO_LONG);
    let message = held(axle_ucp_message::default());
    assert_eq!(axle_ucp_encode(message, to, too_long, out()), AXLE_ERROR_TOO_LONG);
    let unknown = axle_ucp_message { kind: AXLE_UCP_UNKNOWN, id: 0x42, ..Default::default() };
    let body = |body, body_length| {
        let message = axle_ucp_message { body, body_length, ..unknown };
        axle_ucp_encode(&message, to, 64, out())
    };
    assert_eq!(body(bytes(), too_long), AXLE_ERROR_TOO_LONG);
    assert_eq!(body(std::ptr::null(), 1), AXLE_ERROR_NULL);
    assert_eq!(body(to.wrapping_add(63), 1), AXLE_ERROR_OVERLAP);
    assert_eq!(body(bytes(), 4), AXLE_OK);
    assert_eq!(body(held([0; 64]).cast(), 57), AXLE_ERROR_BODY_TOO_LONG);
}

#[test]
fn numbers_that_mean_nothing_are_refused() {
    let master = memory(0);
    assert_eq!(of_masters().0.0.with(master), AXLE_OK);
    for node in [0, 9, 255] {
        assert_eq!(axle_ikeya_master_stop(master, node, 0), AXLE_ERROR_NODE_ID);
        assert_eq!(axle_ikeya_master_get_node(master, node, out()), AXLE_ERROR_NODE_ID);
        let slave = axle_ikeya_slave_init(
            memory(0),
            AXLE_IKEYA_SLAVE_SIZE,
            node,
            AXLE_IKEYA_MODE_POSITION,
            slave_config(),
            0,
        );
        assert_eq!(slave, AXLE_ERROR_NODE_ID);
    }
    for outcome in [0, 6, 255] {
        assert_eq!(axle_ikeya_master_handle_transmit(master, outcome, 0), AXLE_ERROR_VALUE);
    }
    for framing in [0, 7, 255] {
        let size = AXLE_IKEYA_DECODER_SIZE;
        assert_eq!(axle_ikeya_decoder_init(memory(0), size, framing), AXLE_ERROR_VALUE);
    }
    let slave = memory(0);
    assert_eq!(of_slaves().0.0.with(slave), AXLE_OK);
    for mode in [0, 3, 255] {
        assert_eq!(axle_ikeya_slave_set_mode(slave, mode), AXLE_ERROR_VALUE);
    }
    assert_eq!(axle_ikeya_slave_set_velocity(slave, f32::NAN), AXLE_ERROR_NOT_FINITE);
    let robot = robot_config().cast_mut();
    for version in [-2, 65_536, i32::MIN] {
        // SAFETY: it is a config that nobody else uses.
        unsafe { (*robot).version = version };
        let size = AXLE_UCP_ROBOT_SIZE;
        assert_eq!(axle_ucp_robot_init(memory(0), size, robot, 0), AXLE_ERROR_VALUE);
    }
    let config = master_config().cast_mut();
    // SAFETY: as above.
    unsafe { (*config).polling = 9 };
    let result = axle_ikeya_master_init(master, AXLE_IKEYA_MASTER_SIZE, config, 0);
    assert_eq!(result, AXLE_ERROR_VALUE);
    assert_eq!(axle_ikeya_master_stop_all(master, 0), AXLE_OK, "a failed init changes nothing");
}

#[test]
fn a_full_decoder_says_so_and_loses_nothing_that_it_had() {
    let decoder = memory::<axle_ikeya_decoder>(0);
    let size = AXLE_IKEYA_DECODER_SIZE;
    assert_eq!(axle_ikeya_decoder_init(decoder, size, AXLE_IKEYA_TO_SLAVE), AXLE_OK);
    let read = [0xAA, 0x01, 0xBE, 0xD0];
    let pushed = read.iter().cycle().map(|byte| axle_ikeya_decoder_push(decoder, *byte));
    let taken = pushed.take_while(|result| *result != AXLE_ERROR_FULL).take(1000).count();
    assert!((8..100).contains(&taken), "{taken}");
    // SAFETY: numbers and a pointer.
    let mut event: axle_stream_event = unsafe { std::mem::zeroed() };
    let frames = std::iter::from_fn(|| {
        (axle_ikeya_decoder_poll(decoder, &mut event) == AXLE_OK).then_some(event.kind)
    });
    assert_eq!(frames.collect::<Vec<_>>(), vec![AXLE_STREAM_FRAME; taken / 4]);
}
