//! Checks cases that QEMU's USART never produces: overruns, framing errors, noise, a full queue,
//! and a slow last byte; and the clock, which it does not model; and sleeping. Exits with status 0,
//! or prints the failed check.
//!
//! The drivers of [`uart`](axlewire_firmware::uart) and [`clock`](axlewire_firmware::clock) here
//! work on register blocks in RAM, with SysTick playing the hardware. The stack measurement is
//! checked as well.

#![no_std]
#![no_main]

use core::{
    convert::Infallible,
    hint::black_box,
    ops::Deref,
    ptr,
    sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed},
};

use axlewire::{
    drive::{Clock as _, Rs485},
    time::Duration,
};
use axlewire_firmware::{
    clock::{self, Clock},
    stack::Stack,
    text_line::TextLine,
    uart::{Channel, Port, Queue},
};
use cortex_m::peripheral::{NVIC, SYST, syst::SystClkSource};
use cortex_m_semihosting::{debug, hprintln};
use embedded_hal::digital::{ErrorType, OutputPin};
use embedded_io::Write as _;
use panic_halt as _;
use stm32f4::stm32f405::{Interrupt, Peripherals, interrupt, usart1::RegisterBlock};

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
    a_frame_is_queued_as_a_whole_or_not_at_all(registers, &mut port);
    let mut core = cortex_m::Peripherals::take()?;
    core.SYST.set_clock_source(SystClkSource::Core);
    core.SYST.set_reload(1680);
    core.SYST.clear_current();
    core.SYST.enable_interrupt();
    core.SYST.enable_counter();
    the_pin_stays_on_until_the_last_stop_bit(registers, port);
    the_clock_runs_at_168_mhz_with_a_crystal_and_without()?;
    core.SYST.disable_counter();
    core.SYST.disable_interrupt();
    the_clock_sleeps_until_its_time_or_an_interrupt(registers, core.SYST)
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

/// While the data register is full.
fn a_frame_is_queued_as_a_whole_or_not_at_all(registers: Registers, port: &mut Port<Registers>) {
    // SAFETY: RAM.
    unsafe { registers.sr().write(|w| w.bits(0)) };
    expect("room for 500 bytes", port.try_send(&[7; 500]));
    expect("no room for 12 more", !port.try_send(&[8; 12]));
    expect("room for 11 more", port.try_send(&[9; 11]));
    expect("no room at all", !port.try_send(&[8]) && port.try_send(&[]));
    // SAFETY: RAM.
    unsafe { registers.sr().write(|w| w.bits(TXE)) };
    CHANNEL.serve();
    expect("the last byte is sent last", registers.dr().read().bits() & 0xFF == 9);
    expect("all are sent", registers.cr1().read().txeie().bit_is_clear());
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

fn the_pin_stays_on_until_the_last_stop_bit(registers: Registers, port: Port<Registers>) {
    // SAFETY: there is no critical section based on priority that this could break.
    unsafe { NVIC::unmask(Interrupt::USART6) };
    let Ok(mut port) = Rs485::new(port, Pin);
    // The data register is full, and remains so for half of the ticks; the shift register is full
    // or, though the queue is not, still empty.
    for (frame, status) in [(&[1u8; 4][..], 0), (&[2; 8], TC), (&[3; 44], 0), (&[4; 4], TC)] {
        let before = SWITCHES.load(Relaxed);
        // SAFETY: RAM.
        unsafe { registers.sr().write(|w| w.bits(status)) };
        SHIFTING.store(SHIFT_TICKS, Relaxed);
        expect("a frame is queued", port.write(frame) == Ok(frame.len()));
        expect("nothing has been sent", SHIFTING.load(Relaxed) > 0);
        expect("it is to be sent", registers.cr1().read().txeie().bit_is_set());
        // A master talks over the answer: its bytes are damaged and overrun each other.
        arrive(registers, b'x', RXNE | ORE | FE | status);
        expect("flushed", port.flush() == Ok(()));
        expect("flush waits for the stop bit", SHIFTING.load(Relaxed) == 0);
        expect("nothing is left to send", registers.cr1().read().txeie().bit_is_clear());
        expect("the pin went on and off", SWITCHES.load(Relaxed) - before == 2);
    }
    expect("the pin went off too early", EARLY.load(Relaxed) == 0);
}

/// Addresses of the registers of the clocks and of the flash; 0 until they are used.
static RCC: AtomicU32 = AtomicU32::new(0);
static FLASH: AtomicU32 = AtomicU32::new(0);
static HAS_CRYSTAL: AtomicBool = AtomicBool::new(false);

/// 5 wait states, prefetch and both caches.
const FIVE_WAIT_STATES: u32 = 0x705;

/// Bits of the clock control register.
const HSIRDY: u32 = 1 << 1;
const HSEON: u32 = 1 << 16;
const HSERDY: u32 = 1 << 17;
const PLLON: u32 = 1 << 24;
const PLLRDY: u32 = 1 << 25;

fn the_clock_runs_at_168_mhz_with_a_crystal_and_without() -> Option<()> {
    let rcc = ptr::from_mut(cortex_m::singleton!(: [u32; 40] = [0; 40])?);
    let flash = ptr::from_mut(cortex_m::singleton!(: [u32; 8] = [0; 8])?);
    let rcc_word = |index| register(rcc.expose_provenance() as u32, index);
    FLASH.store(flash.expose_provenance() as u32, Relaxed);
    // SAFETY: the blocks are 35 and 6 registers long, have the alignment of one, and any bit
    // pattern is valid.
    let blocks = unsafe { (&*rcc.cast(), &*flash.cast()) };
    clock::speed_up(blocks.0, blocks.1);
    let is_untouched = (0..3).all(|index| rcc_word(index).read() == 0);
    expect("an emulator's clock is left alone", is_untouched && clock::is_emulated(blocks.0));
    for (has_crystal, mhz) in [(true, 8), (false, 16)] {
        (0..3).for_each(|index| rcc_word(index).write(0));
        register(FLASH.load(Relaxed), 0).write(0);
        rcc_word(0).write(HSIRDY);
        HAS_CRYSTAL.store(has_crystal, Relaxed);
        RCC.store(rcc.expose_provenance() as u32, Relaxed);
        clock::speed_up(blocks.0, blocks.1);
        RCC.store(0, Relaxed);
        // 1 MHz times 336, halved; the crystal as the source; 336 by 7 for USB; a reserved bit.
        let pll = mhz | 336 << 6 | u32::from(has_crystal) << 22 | 7 << 24 | 1 << 29;
        expect("168 MHz from the PLL", rcc_word(1).read() == pll);
        // APB1 at a quarter, APB2 at half, the PLL as the source, and in use.
        expect("the buses", rcc_word(2).read() == 0b101 << 10 | 0b100 << 13 | 0b10_10);
    }
    expect("a microsecond at 84 MHz", clock::prescaler(false) == 83);
    Some(())
}

/// In virtual time, which the machine does not delay. With QEMU's own timers, unlike the rest.
fn the_clock_sleeps_until_its_time_or_an_interrupt(
    registers: Registers,
    alarm: SYST,
) -> Option<()> {
    let (short, long) = (Duration::from_millis(2), Duration::from_millis(80));
    let mut clock = Clock::new(Peripherals::take()?.TIM2, alarm, true);
    // Takes what has happened so far.
    let start = clock.now();
    clock.idle_until(start + short);

    arrive(registers, b'x', RXNE);
    let start = clock.now();
    clock.idle_until(start + long);
    expect("no sleep after an interrupt", clock.now() < start + short);

    // Its handler runs after the sleep that it has ended, and an alarm is left half way.
    let start = clock.now();
    critical_section::with(|_| {
        NVIC::pend(Interrupt::USART6);
        clock.idle_until(start + long);
    });
    expect("an interrupt ends a sleep", clock.now() < start + short);
    clock.idle_until(start + long);
    expect("it counts as an interrupt after the sleep", clock.now() < start + short);

    let start = clock.now();
    clock.idle_until(start + short);
    let slept = clock.now() - start;
    expect("a sleep as long as wanted", short <= slept && slept < short + short);
    let start = clock.now();
    clock.idle_until(start);
    expect("no sleep until now", clock.now() < start + short);
    Some(())
}

/// A register in RAM.
struct Word(*mut u32);

/// The register at this index of the block at this address.
fn register(block: u32, index: usize) -> Word {
    Word(ptr::with_exposed_provenance_mut::<u32>(block as usize + 4 * index))
}

impl Word {
    fn read(&self) -> u32 {
        // SAFETY: a register of a block in static RAM.
        unsafe { self.0.read_volatile() }
    }

    fn write(&self, value: u32) {
        // SAFETY: a register of a block in static RAM.
        unsafe { self.0.write_volatile(value) }
    }
}

/// Plays the clocks: a crystal starts if there is one, the PLL starts, and a source that is chosen
/// is used, which needs the PLL and a flash that is slow enough.
fn play_clocks(rcc: u32) {
    let (control, configuration) = (register(rcc, 0), register(rcc, 2));
    let mut state = control.read();
    if state & HSEON != 0 && HAS_CRYSTAL.load(Relaxed) {
        state |= HSERDY;
    }
    if state & PLLON != 0 {
        state |= PLLRDY;
    }
    control.write(state);
    let source = configuration.read() & 0b11;
    let is_slow = register(FLASH.load(Relaxed), 0).read() == FIVE_WAIT_STATES;
    if source == 0b10 && state & PLLRDY != 0 {
        expect("the flash is slow enough before the clock is fast", is_slow);
        configuration.write(configuration.read() | source << 2);
    }
}

/// Plays the hardware: empties the data register halfway, and the shift register at the end.
#[cortex_m_rt::exception]
fn SysTick() {
    let rcc = RCC.load(Relaxed);
    if rcc != 0 {
        play_clocks(rcc);
    }
    let left = SHIFTING.load(Relaxed);
    if left == 0 {
        return;
    }
    SHIFTING.store(left - 1, Relaxed);
    let status = match left - 1 {
        0 => TXE | TC,
        ticks if ticks < SHIFT_TICKS / 2 => TXE,
        _ => return,
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
