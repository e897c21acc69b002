//! Checks cases that QEMU's USART never produces: overruns, framing errors, noise, a full queue,
//! and a slow last byte. Exits with status 0, or prints the failed check.
//!
//! The driver of [`uart`](axlewire_firmware::uart) here works on a register block in RAM, with
//! SysTick playing the hardware. The stack measurement is checked as well.

#![no_std]
#![no_main]

use core::{
    convert::Infallible,
    hint::black_box,
    ops::Deref,
    ptr,
    sync::atomic::{AtomicU32, Ordering::Relaxed},
};

use axlewire::drive::Rs485;
use axlewire_firmware::{
    stack::Stack,
    text_line::TextLine,
    uart::{Channel, Port, Queue},
};
use cortex_m::peripheral::{NVIC, syst::SystClkSource};
use cortex_m_semihosting::{debug, hprintln};
use embedded_hal::digital::{ErrorType, OutputPin};
use embedded_io::Write as _;
use panic_halt as _;
use stm32f4::stm32f405::{Interrupt, interrupt, usart1::RegisterBlock};

/// Bits of the status register.
const FE: u16 = 1 << 1;
const NF: u16 = 1 << 2;
const ORE: u16 = 1 << 3;
const RXNE: u16 = 1 << 5;
const TC: u16 = 1 << 6;
const TXE: u16 = 1 << 7;

/// SysTicks from fetching the last byte until its stop bit is out.
const SHIFT_TICKS: u32 = 20;

/// Registers in RAM.
#[derive(Clone, Copy)]
struct Registers(&'static RegisterBlock);

// SAFETY: one thread and two interrupts of the same priority share them through volatile accesses.
unsafe impl Send for Registers {}

impl Deref for Registers {
    type Target = RegisterBlock;

    fn deref(&self) -> &RegisterBlock {
        self.0
    }
}

static CHANNEL: Channel<Registers> = Channel::new(Interrupt::USART6);

/// Address of the registers, for the interrupt that plays the hardware.
static REGISTERS: AtomicU32 = AtomicU32::new(0);

/// SysTicks left until the data register and the shift register are empty; 0 when they are.
static SHIFTING: AtomicU32 = AtomicU32::new(0);

#[cortex_m_rt::entry]
fn main() -> ! {
    let done = check_all();
    hprintln!("{}", if done.is_some() { "all as it should be" } else { "failed: no resources" });
    debug::exit(if done.is_some() { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    loop {}
}

fn check_all() -> Option<()> {
    // First, because stack that has already been in use leaves no new mark.
    the_stack_leaves_its_mark();
    let words = cortex_m::singleton!(: [u32; 16] = [0; 16])?;
    REGISTERS.store(ptr::from_mut(words).expose_provenance() as u32, Relaxed);
    // SAFETY: the block is seven registers long, has the alignment of one, and any bit pattern is
    // valid.
    let registers = Registers(unsafe { &*ptr::from_mut(words).cast() });
    let queues = [
        cortex_m::singleton!(: Queue = Queue::new())?,
        cortex_m::singleton!(: Queue = Queue::new())?,
    ];
    let mut port = CHANNEL.start(registers, 168, queues);
    received_bytes_and_what_went_wrong(registers, &mut port);
    a_full_queue_loses_the_newest(registers, &mut port);
    the_counts_are_told();
    the_pin_stays_on_until_the_last_stop_bit(registers, port)?;
    Some(())
}

/// A byte arrives, with these bits set in the status register.
fn arrive(registers: Registers, byte: u8, status: u16) {
    // SAFETY: RAM.
    unsafe {
        registers.sr().write(|w| w.bits(status));
        registers.dr().write(|w| w.bits(byte.into()));
    }
    CHANNEL.serve();
}

fn counts() -> [u32; 3] {
    [CHANNEL.overruns(), CHANNEL.lost(), CHANNEL.damaged()]
}

fn received_bytes_and_what_went_wrong(registers: Registers, port: &mut Port<Registers>) {
    arrive(registers, b'a', RXNE);
    expect("a good byte", port.poll_byte() == Some(b'a') && counts() == [0, 0, 0]);
    arrive(registers, b'b', RXNE | ORE);
    expect("an overrun after a byte", port.poll_byte() == Some(b'b') && counts() == [1, 0, 0]);
    arrive(registers, b'c', ORE);
    expect("an overrun without a byte", port.poll_byte().is_none() && counts() == [2, 0, 0]);
    arrive(registers, b'd', RXNE | FE);
    expect("a wrong stop bit", port.poll_byte() == Some(b'd') && counts() == [2, 0, 1]);
    arrive(registers, b'e', RXNE | NF);
    expect("noise", port.poll_byte() == Some(b'e') && counts() == [2, 0, 2]);
    arrive(registers, b'f', TXE | TC);
    expect("an interrupt without a byte", port.poll_byte().is_none() && counts() == [2, 0, 2]);
}

fn a_full_queue_loses_the_newest(registers: Registers, port: &mut Port<Registers>) {
    for byte in 0..515u32 {
        arrive(registers, byte as u8, RXNE);
    }
    expect("a queue of 511 bytes", counts() == [2, 4, 2]);
    let is_kept = (0..511u32).all(|byte| port.poll_byte() == Some(byte as u8));
    expect("the oldest are kept", is_kept && port.poll_byte().is_none());
}

fn the_counts_are_told() {
    let mut line = TextLine::new("check");
    expect("the line", line.losses(&CHANNEL).end() == b"check overruns 2 lost 4 damaged 2\r\n");
}

/// The driver-enable pin, which must not go off before the last stop bit is out.
struct Pin;

/// Number of times the pin switched, and number of times it went off too early.
static SWITCHES: AtomicU32 = AtomicU32::new(0);
static EARLY: AtomicU32 = AtomicU32::new(0);

fn count(counter: &AtomicU32) {
    counter.store(counter.load(Relaxed) + 1, Relaxed);
}

impl ErrorType for Pin {
    type Error = Infallible;
}

impl OutputPin for Pin {
    fn set_high(&mut self) -> Result<(), Infallible> {
        count(&SWITCHES);
        Ok(())
    }

    fn set_low(&mut self) -> Result<(), Infallible> {
        count(&SWITCHES);
        if SHIFTING.load(Relaxed) > 0 {
            count(&EARLY);
        }
        Ok(())
    }
}

fn the_pin_stays_on_until_the_last_stop_bit(
    registers: Registers,
    port: Port<Registers>,
) -> Option<()> {
    let mut core = cortex_m::Peripherals::take()?;
    core.SYST.set_clock_source(SystClkSource::Core);
    core.SYST.set_reload(1680);
    core.SYST.clear_current();
    core.SYST.enable_interrupt();
    core.SYST.enable_counter();
    // SAFETY: there is no critical section based on priority that this could break.
    unsafe { NVIC::unmask(Interrupt::USART6) };
    let Ok(mut port) = Rs485::new(port, Pin);
    for frame in [&[1u8; 4][..], &[2; 8], &[3; 44]] {
        let before = SWITCHES.load(Relaxed);
        // The data register is full, and remains so until the first tick.
        // SAFETY: RAM.
        unsafe { registers.sr().write(|w| w.bits(0)) };
        SHIFTING.store(SHIFT_TICKS, Relaxed);
        expect("a frame is queued", port.write(frame) == Ok(frame.len()));
        expect("nothing has been sent", SHIFTING.load(Relaxed) > 0);
        // A master talks over the answer: its bytes are damaged and overrun each other.
        arrive(registers, b'x', RXNE | ORE | FE);
        expect("flushed", port.flush() == Ok(()));
        expect("flush waits for the stop bit", SHIFTING.load(Relaxed) == 0);
        expect("the pin went on and off", SWITCHES.load(Relaxed) - before == 2);
    }
    core.SYST.disable_counter();
    expect("the pin went off too early", EARLY.load(Relaxed) == 0);
    Some(())
}

/// Plays the hardware: empties the data register halfway, and the shift register at the end.
#[cortex_m_rt::exception]
fn SysTick() {
    let left = SHIFTING.load(Relaxed);
    if left == 0 {
        return;
    }
    SHIFTING.store(left - 1, Relaxed);
    let status = match left - 1 {
        0 => TXE | TC,
        ticks if ticks < SHIFT_TICKS / 2 => TXE,
        _ => 0,
    };
    let register = ptr::with_exposed_provenance_mut::<u16>(REGISTERS.load(Relaxed) as usize);
    // SAFETY: the first register, in static RAM.
    unsafe { register.write_volatile(status) };
    NVIC::pend(Interrupt::USART6);
}

#[interrupt]
fn USART6() {
    CHANNEL.serve();
}

fn the_stack_leaves_its_mark() {
    let mut stack = Stack::new();
    let before = stack.used();
    expect("some stack is in use", (1..4096).contains(&before));
    let before = stack.used();
    expect("no more than before", stack.used() == before);
    dig();
    let more = stack.used().wrapping_sub(before);
    expect("900 bytes more, and the frames around them", (900..2400).contains(&more));
}

/// Uses 900 bytes of stack.
#[inline(never)]
fn dig() {
    #[inline(never)]
    fn deeper(room: &mut [u8]) {
        black_box(room).fill(1);
    }
    let mut room = [0u8; 900];
    deeper(&mut room);
    black_box(&room);
}

fn expect(what: &str, is_true: bool) {
    if !is_true {
        hprintln!("failed: {}", what);
        debug::exit(debug::EXIT_FAILURE);
    }
}
