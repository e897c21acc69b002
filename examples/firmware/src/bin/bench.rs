//! Instructions per call on a Cortex-M4, counted by QEMU: one line `name value goal` per figure.
//!
//! With `-icount shift=0` an instruction takes one nanosecond of virtual time, and SysTick runs at
//! 168 MHz of virtual time. A figure is the mean of many calls, without call and return: the cost
//! of calling an empty function is subtracted. A wrong result ends the program with status 1.

#![no_std]
#![no_main]

use core::hint::black_box;

use axlewire::{
    crc16,
    endpoint::Endpoint,
    ikeya::{
        Master, Mode, NodeId, ReadRequest, Rps, Slave, ToMaster, VelocityResponse,
        slave::SlaveConfig,
    },
    stream::Decoder,
    time::Instant,
    ucp::{Body, Host, Robot, Telemetry, Ucp, message::FirmwareReport},
};
#[cfg(feature = "board")]
use axlewire_firmware::stack::Stack;
use axlewire_firmware::work;
use cortex_m::peripheral::{SYST, syst::SystClkSource};
use cortex_m_semihosting::{debug, hprintln};
use panic_halt as _;

/// Calls per measurement: 168 ticks are 1000 instructions, so the resolution per call is 0.006.
const CALLS: u32 = 1000;

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(mut core) = cortex_m::Peripherals::take() else { fail("no peripherals") };
    core.SYST.set_clock_source(SystClkSource::Core);
    core.SYST.set_reload(0x00FF_FFFF);
    core.SYST.clear_current();
    core.SYST.enable_counter();
    calibrate();
    let answer = VelocityResponse::new(NodeId::N2, rps(1.0));
    let telemetry = Telemetry { battery_pct: 87, heading_deg: -12, ..Telemetry::default() };
    let report = FirmwareReport::new(&telemetry, 38).frame(0);
    from_slices(answer.as_bytes(), report.as_bytes());
    byte_by_byte(answer.as_bytes(), report.as_bytes());
    checksums(answer.as_bytes(), report.as_bytes());
    read_to_answer();
    ram();
    #[cfg(feature = "board")]
    print("stack", Stack::new().used(), 0);
    debug::exit(debug::EXIT_SUCCESS);
    loop {}
}

/// Frames in memory: the cost of one more frame, and of a slice with a single one.
fn from_slices(answer: &[u8], report: &[u8]) {
    let mut many = [0; 33 * 44];
    let answers = repeat(answer, &mut many);
    let sum = 1.0f32.to_bits() + 2;
    let one = of_slice(work::ikeya_slice, answer, sum);
    let all = of_slice(work::ikeya_slice, answers, sum.wrapping_mul(33));
    print("ikeya8_slice", (all - one) / 32, 70);
    print("ikeya8_slice_alone", one, 0);

    let reports = repeat(report, &mut many);
    let one = of_slice(work::ucp_slice, report, 5 + 87);
    let all = of_slice(work::ucp_slice, reports, (5 + 87) * 33);
    print("ucp44_slice", (all - one) / 32, 200);
    print("ucp44_slice_alone", one, 0);
}

/// Frames that arrive byte by byte, as from a receive interrupt: the cost of all calls for one
/// frame.
fn byte_by_byte(answer: &[u8], report: &[u8]) {
    let mut decoder = Decoder::<ToMaster, 8>::new();
    let spent = of_bytes(work::ikeya_byte, &mut decoder, answer, 1.0f32.to_bits() + 2);
    print("ikeya8_bytes", spent, 147);
    let mut decoder = Decoder::<Ucp, 64>::new();
    let spent = of_bytes(work::ucp_byte, &mut decoder, report, 5 + 87);
    print("ucp44_bytes", spent, 500);
    print("push", of_pushes(), 0);
}

/// Instructions for a pushed byte that completes no frame, as most do not.
fn of_pushes() -> u32 {
    const PUSHES: u32 = 52;
    let ticks_of = |work: fn(&mut Decoder<Ucp, 64>, u8) -> u32| {
        let mut decoder = Decoder::new();
        for byte in [0xFD, 0xFF, 60, 0, 1, 0, 0, 0] {
            expect(work::ucp_byte(&mut decoder, byte), 0);
        }
        let work = black_box(work);
        let start = SYST::get_current();
        for _ in 0..PUSHES {
            expect(work(&mut decoder, 0), 0);
        }
        ticks_since(start)
    };
    let empty = ticks_of(|_, _| 0);
    (instructions(ticks_of(work::ucp_byte) - empty) + PUSHES / 2) / PUSHES
}

fn checksums(answer: &[u8], report: &[u8]) {
    let compute = |bytes: &[u8]| u32::from(crc16::compute(bytes));
    let check = |bytes: &[u8]| u32::from(crc16::check(bytes));
    expect(compute(b"123456789"), 0x4B37);
    for (name, frame, goal) in [("crc_6", answer, 0), ("crc_42", report, 200)] {
        let Some((body, crc)) = frame.split_last_chunk() else { fail(name) };
        print(name, of_slice(compute, body, u16::from_le_bytes(*crc).into()), goal);
    }
    for (name, frame) in [("check_8", answer), ("check_44", report)] {
        print(name, of_slice(check, frame, 1), 0);
    }
}

/// From the last byte of a READ to the answer. The goal is 50 µs at 168 MHz (ruling I9), at 1.5
/// cycles per instruction.
fn read_to_answer() {
    let mut slave: Slave =
        Slave::new(NodeId::N2, Mode::Velocity, SlaveConfig::direct(), Instant::from_micros(0));
    slave.set_velocity(rps(1.0));
    let request = ReadRequest::new(NodeId::N2);
    let expected = VelocityResponse::new(NodeId::N2, rps(1.0));
    let (mut spent, mut at_once) = (0, 0);
    for call in 0..u64::from(CALLS) {
        let now = Instant::from_millis(call);
        let [first @ .., last] = request.as_bytes();
        for byte in first {
            slave.handle_input(&[*byte], now);
        }
        let start = SYST::get_current();
        slave.handle_input(black_box(&[*last]), now);
        let answer = slave.poll_transmit(now);
        spent += ticks_since(start);
        if answer != Some(expected.as_bytes()) {
            fail("answer to a READ byte by byte");
        }

        let start = SYST::get_current();
        slave.handle_input(black_box(request.as_bytes()), now);
        let answer = slave.poll_transmit(now);
        at_once += ticks_since(start);
        if answer != Some(expected.as_bytes()) {
            fail("answer to a READ in one piece");
        }
    }
    let empty: u32 = (0..CALLS).map(|_| ticks_since(SYST::get_current())).sum();
    print("read_to_answer", instructions(spent - empty) / CALLS, 5600);
    print("read_to_answer_whole", instructions(at_once - empty) / CALLS, 5600);
}

/// Sizes of the states, bytes.
fn ram() {
    print("ram_ikeya_decoder", size_of::<Decoder<ToMaster, 8>>() as u32, 0);
    print("ram_ucp_decoder", size_of::<Decoder<Ucp, 64>>() as u32, 0);
    print("ram_master", size_of::<Master>() as u32, 0);
    print("ram_slave", size_of::<Slave>() as u32, 0);
    print("ram_host", size_of::<Host>() as u32, 0);
    print("ram_robot", size_of::<Robot>() as u32, 0);
}

/// A loop of known length: if QEMU counts otherwise, all figures are worthless.
fn calibrate() {
    let start = SYST::get_current();
    cortex_m::asm::delay(black_box(100_000));
    let counted = instructions(ticks_since(start));
    // `delay` runs one iteration more than requested, two instructions each, plus a few around
    // them.
    if !(200_002..200_040).contains(&counted) {
        hprintln!("200002 instructions were counted as {}", counted);
        fail("run it with -icount shift=0");
    }
}

/// Instructions for one call of `work`, which must return `expected`.
fn of_slice(work: fn(&[u8]) -> u32, bytes: &[u8], expected: u32) -> u32 {
    fn nothing(bytes: &[u8]) -> u32 {
        bytes.len() as u32
    }
    let ticks_of = |work: fn(&[u8]) -> u32, expected| {
        let (work, bytes) = (black_box(work), black_box(bytes));
        let start = SYST::get_current();
        for _ in 0..CALLS {
            expect(work(bytes), expected);
        }
        ticks_since(start)
    };
    let empty = ticks_of(nothing, bytes.len() as u32);
    instructions(ticks_of(work, expected) - empty) / CALLS
}

/// Instructions for passing one frame to `work`, whose results must add up to `expected`.
fn of_bytes<D>(work: fn(&mut D, u8) -> u32, decoder: &mut D, frame: &[u8], expected: u32) -> u32 {
    let mut ticks_of = |work: fn(&mut D, u8) -> u32, expected| {
        let (work, frame) = (black_box(work), black_box(frame));
        let start = SYST::get_current();
        for _ in 0..CALLS {
            let sum = frame.iter().fold(0, |sum: u32, &byte| sum.wrapping_add(work(decoder, byte)));
            expect(sum, expected);
        }
        ticks_since(start)
    };
    let empty = ticks_of(|_, _| 0, 0);
    instructions(ticks_of(work, expected) - empty) / CALLS
}

/// SysTick counts down in 24 bits, enough for 99 million instructions.
fn ticks_since(start: u32) -> u32 {
    start.wrapping_sub(SYST::get_current()) & 0x00FF_FFFF
}

fn instructions(ticks: u32) -> u32 {
    (u64::from(ticks) * 1000 / 168) as u32
}

/// Fills the start of `room` with 33 copies of `frame`.
fn repeat<'r>(frame: &[u8], room: &'r mut [u8]) -> &'r [u8] {
    let filled = &mut room[..33 * frame.len()];
    filled.chunks_exact_mut(frame.len()).for_each(|chunk| chunk.copy_from_slice(frame));
    filled
}

fn rps(value: f32) -> Rps {
    Rps::new(value).unwrap_or_else(|_| fail("a speed"))
}

fn print(name: &str, value: u32, goal: u32) {
    match goal {
        0 => hprintln!("{} {} -", name, value),
        goal => hprintln!("{} {} {}", name, value, goal),
    }
}

#[inline]
fn expect(value: u32, expected: u32) {
    if value != expected {
        fail("a wrong sum");
    }
}

fn fail(what: &str) -> ! {
    hprintln!("failed: {}", what);
    debug::exit(debug::EXIT_FAILURE);
    loop {}
}
