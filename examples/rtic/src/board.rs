//! The board at register level: clock, timer, UART, pins.

use stm32f4::stm32f405::{GPIOA, Peripherals, RCC, TIM2, USART1};

/// Board resources used by the slave.
pub struct Board {
    pub port: Port,
    pub micros: Micros,
    /// The four bits of the DIP switch.
    pub dip: u8,
}

impl Board {
    /// Initializes the board.
    pub fn new(device: Peripherals) -> Self {
        let rcc = device.RCC;
        rcc.ahb1enr().modify(|_, w| w.gpioaen().set_bit().gpiocen().set_bit());
        rcc.apb1enr().modify(|_, w| w.tim2en().set_bit());
        rcc.apb2enr().modify(|_, w| w.usart1en().set_bit());
        // Flash needs 5 wait states at 168 MHz.
        device.FLASH.acr().modify(|_, w| w.latency().ws5().prften().set_bit());
        let bus_hz = if is_fast(&rcc) { 84_000_000 } else { 16_000_000 };

        let dip = device.GPIOC.idr().read().bits() as u8 & 0b1111;
        let port = Port::new(device.USART1, device.GPIOA, bus_hz);
        Self { port, micros: Micros::new(device.TIM2, bus_hz), dip }
    }
}

/// 168 MHz from the internal oscillator, timers and UART at 84. Without the PLL, as in QEMU, all of
/// them stay at 16 MHz: correct on the bus, but too slow for answers within 50 µs.
fn is_fast(rcc: &RCC) -> bool {
    // 16 MHz / 8 * 168 / 2.
    // SAFETY: M, N and Q may hold values that the PLL cannot run with; these are within its limits.
    rcc.pllcfgr().write(|w| unsafe { w.pllm().bits(8).plln().bits(168).pllq().bits(7) });
    rcc.cr().modify(|_, w| w.pllon().set_bit());
    if !(0..100_000).any(|_| rcc.cr().read().pllrdy().bit_is_set()) {
        return false;
    }
    rcc.cfgr().modify(|_, w| w.ppre1().div4().ppre2().div2().sw().pll());
    while !rcc.cfgr().read().sws().is_pll() {}
    true
}

/// A 32-bit microsecond counter with a compare interrupt.
pub struct Micros {
    timer: TIM2,
}

impl Micros {
    fn new(timer: TIM2, clock_hz: u32) -> Self {
        timer.psc().write(|w| w.psc().set((clock_hz / 1_000_000 - 1) as u16));
        // The prescaler takes effect at an update event.
        timer.egr().write(|w| w.ug().set_bit());
        timer.dier().write(|w| w.cc1ie().set_bit());
        timer.cr1().write(|w| w.cen().set_bit());
        Self { timer }
    }

    pub fn now(&self) -> u32 {
        self.timer.cnt().read().bits()
    }

    /// Requests an interrupt and returns the current time: `micros` may already have passed, so
    /// that the interrupt is missed. It still comes once every 71 minutes.
    pub fn wake_at(&self, micros: u32) -> u32 {
        self.timer.ccr1().write(|w| w.ccr().set(micros));
        self.now()
    }

    /// Clears the interrupt.
    pub fn acknowledge(&self) {
        self.timer.sr().modify(|_, w| w.cc1if().clear_bit());
    }
}

/// The UART and the driver-enable pin of the transceiver. Only the UART interrupt uses it.
pub struct Port {
    uart: USART1,
    pins: GPIOA,
}

impl Port {
    fn new(uart: USART1, pins: GPIOA, clock_hz: u32) -> Self {
        pins.bsrr().write(|w| w.br8().set_bit());
        pins.afrh().modify(|_, w| w.afrh9().af7().afrh10().af7());
        pins.moder().modify(|_, w| w.moder8().output().moder9().alternate().moder10().alternate());
        let divider = clock_hz / axlewire::ikeya::BAUD;
        uart.brr().write(|w| {
            w.div_mantissa().set((divider / 16) as u16).div_fraction().set((divider % 16) as u8)
        });
        uart.cr1().write(|w| w.ue().set_bit().te().set_bit().re().set_bit().rxneie().set_bit());
        Self { uart, pins }
    }

    /// The received byte, if any. Reading it also clears an overrun.
    pub fn receive(&self) -> Option<u8> {
        let status = self.uart.sr().read();
        let is_new = status.rxne().bit_is_set();
        (is_new || status.ore().bit_is_set())
            .then(|| self.uart.dr().read().dr().bits() as u8)
            .filter(|_| is_new)
    }

    /// Sends the bytes from `next`, with the driver on until the last stop bit is out.
    pub fn send(&self, mut next: impl FnMut() -> Option<u8>) {
        loop {
            let status = self.uart.sr().read();
            if status.txe().bit_is_clear() {
                return;
            }
            if let Some(byte) = next() {
                self.pins.bsrr().write(|w| w.bs8().set_bit());
                self.uart.dr().write(|w| w.dr().set(byte.into()));
                self.uart.cr1().modify(|_, w| w.txeie().set_bit().tcie().clear_bit());
            } else if status.tc().bit_is_set() {
                self.pins.bsrr().write(|w| w.br8().set_bit());
                self.uart.cr1().modify(|_, w| w.txeie().clear_bit().tcie().clear_bit());
                return;
            } else {
                // The register is empty, but the last byte is still being shifted out.
                self.uart.cr1().modify(|_, w| w.txeie().clear_bit().tcie().set_bit());
                return;
            }
        }
    }
}
