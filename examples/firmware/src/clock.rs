//! The 168 MHz clock, microseconds, and sleeping until an event.

use axlewire::{
    drive::Clock as DriverClock,
    time::{Instant, Wrapping32},
};
use cortex_m::peripheral::{SCB, SYST, syst::SystClkSource};
use stm32f4::stm32f405::{TIM2, flash, rcc};

use crate::uart;

/// Crystal of the board, MHz. Boards of this family have 8, 12 or 25: change it to match yours. If
/// no crystal starts, the internal oscillator is used.
const CRYSTAL_MHZ: u8 = 8;

/// Internal oscillator, MHz: within 1 % at 25 °C.
const INTERNAL_MHZ: u8 = 16;

/// Clock of the processor, MHz.
const CORE_MHZ: u32 = 168;

/// Clock of USART1, Hz.
pub const APB2_HZ: u32 = 84_000_000;

/// Clock of USART2, Hz.
pub const APB1_HZ: u32 = 42_000_000;

/// Clock of the timers on APB1, MHz: twice the bus.
const TIMER_MHZ: u16 = 84;

/// Clock of the same timers in QEMU, MHz, whatever the bus clock.
const EMULATED_TIMER_MHZ: u16 = 1000;

/// Number of polls before a crystal counts as missing: about 30 ms at 16 MHz. A present crystal
/// starts within 10 ms.
const CRYSTAL_PATIENCE: u32 = 50_000;

/// Whether this is QEMU, which models neither clocks nor pins.
///
/// After every reset a processor runs from its internal oscillator, so HSIRDY is 1 wherever it is
/// modelled.
pub fn is_emulated(rcc: &rcc::RegisterBlock) -> bool {
    rcc.cr().read().hsirdy().bit_is_clear()
}

/// Runs the processor at 168 MHz, APB1 at 42 MHz and APB2 at 84 MHz.
///
/// Does nothing in an emulator, which runs at its own speed and would never report a clock as
/// ready.
pub fn speed_up(rcc: &rcc::RegisterBlock, flash: &flash::RegisterBlock) {
    if is_emulated(rcc) {
        return;
    }
    rcc.cr().modify(|_, w| w.hseon().on());
    let has_crystal = (0..CRYSTAL_PATIENCE).any(|_| rcc.cr().read().hserdy().is_ready());
    // 1 MHz · 336 / 2 = 168 MHz; 336 / 7 = 48 MHz for the unused USB.
    let divider = if has_crystal { CRYSTAL_MHZ } else { INTERNAL_MHZ };
    rcc.pllcfgr().write(|w| {
        // SAFETY: M, N and Q may hold values that the PLL cannot run with; these are within its
        // limits (reference manual RM0090, RCC_PLLCFGR).
        unsafe { w.pllm().bits(divider).plln().bits(336).pllq().bits(7) };
        w.pllp().div2().pllsrc().bit(has_crystal)
    });
    // 5 wait states at 168 MHz, before the clock goes up.
    flash.acr().write(|w| w.latency().ws5().prften().enabled().icen().enabled().dcen().enabled());
    rcc.cfgr().write(|w| w.ppre1().div4().ppre2().div2());
    rcc.cr().modify(|_, w| w.pllon().on());
    // Both waits end: the PLL has a running input.
    while !rcc.cr().read().pllrdy().is_ready() {}
    rcc.cfgr().modify(|_, w| w.sw().pll());
    while !rcc.cfgr().read().sws().is_pll() {}
}

/// Prescaler of TIM2 for microseconds.
pub const fn prescaler(is_emulated: bool) -> u16 {
    (if is_emulated { EMULATED_TIMER_MHZ } else { TIMER_MHZ }) - 1
}

/// The time since the start. TIM2 counts microseconds; SysTick is the alarm.
pub struct Clock {
    timer: TIM2,
    alarm: SYST,
    wrapping: Wrapping32,
}

impl Clock {
    /// Starts at 0. The timer's clock must already be enabled.
    pub fn new(timer: TIM2, mut alarm: SYST, is_emulated: bool) -> Self {
        timer.psc().write(|w| w.psc().set(prescaler(is_emulated)));
        // The update event loads the prescaler.
        timer.egr().write(|w| w.ug().set_bit());
        timer.cr1().write(|w| w.cen().enabled());
        alarm.set_clock_source(SystClkSource::Core);
        Self { timer, alarm, wrapping: Wrapping32::new() }
    }
}

/// A time for display, milliseconds since the start. Wraps after 49 days.
pub fn milliseconds(now: Instant) -> u32 {
    (now.as_micros() / 1000) as u32
}

impl DriverClock for Clock {
    fn now(&self) -> Instant {
        self.wrapping.at(self.timer.cnt().read().bits())
    }

    /// Sleeps until `until`, until an interrupt of a USART, or for 90 ms, whichever is first.
    fn idle_until(&mut self, until: Instant) {
        /// Longest time that SysTick can count, microseconds.
        const LONGEST: u32 = 90_000;
        // It has 24 bits.
        const { assert!(LONGEST <= 0xFF_FFFF / CORE_MHZ) };
        let micros = (until - self.now()).as_micros().min(LONGEST);
        if micros == 0 {
            return;
        }
        // With interrupts disabled, an earlier interrupt shows in the flag, and a later one still
        // wakes the processor and is served after the critical section. The alarm, which has no
        // handler, wakes it too.
        critical_section::with(|cs| {
            if uart::has_happened(cs) {
                return;
            }
            self.alarm.set_reload(micros * CORE_MHZ);
            self.alarm.clear_current();
            self.alarm.enable_interrupt();
            self.alarm.enable_counter();
            cortex_m::asm::wfi();
            self.alarm.disable_interrupt();
            self.alarm.disable_counter();
            SCB::clear_pendst();
        });
    }
}
