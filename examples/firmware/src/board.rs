//! The board: an STM32F405, two USARTs, two pins.
//!
//! | function | pins |
//! |---|---|
//! | the line: motor bus or rover link | USART1, TX PA9, RX PA10 |
//! | driver enable of an RS485 transceiver, high while sending | PA8 |
//! | text, 115,200 bit/s: one line per second, and one per received byte | USART2, TX PA2, RX PA3 |
//! | lamp of the robot, active high | PA5 |

use core::convert::Infallible;

use cortex_m::peripheral::NVIC;
use embedded_hal::digital::{ErrorType, OutputPin};
use stm32f4::stm32f405::{GPIOA, Interrupt, Peripherals, USART1, USART2};

use crate::{
    clock::{self, Clock},
    config::Configs,
    stack::Stack,
    text_line::TextLine,
    uart::{Channel, Port, Queue},
};

/// Interrupt side of the line.
pub static BUS: Channel<USART1> = Channel::new(Interrupt::USART1);

/// Interrupt side of the text port.
pub static TEXT: Channel<USART2> = Channel::new(Interrupt::USART2);

/// Speed of the text port, bit/s.
const TEXT_BAUD: u32 = 115_200;

/// All resources of a program.
pub struct Board {
    /// Clock, with sleeping.
    pub clock: Clock,
    /// The line.
    pub bus: Port<USART1>,
    /// Driver enable of the line's transceiver.
    pub driver_enable: Pin<8>,
    /// The text port.
    pub text: Port<USART2>,
    /// The robot's lamp.
    pub lamp: Pin<5>,
    /// Deepest use of the stack.
    pub stack: Stack,
    /// Configurations of the roles.
    pub configs: Configs,
}

impl Board {
    /// The board with its line at `baud` bit/s; `None` on a second call.
    pub fn take(baud: u32) -> Option<Self> {
        let (core, chip) = (cortex_m::Peripherals::take()?, Peripherals::take()?);
        let bus_queues = [
            cortex_m::singleton!(: Queue = Queue::new())?,
            cortex_m::singleton!(: Queue = Queue::new())?,
        ];
        let text_queues = [
            cortex_m::singleton!(: Queue = Queue::new())?,
            cortex_m::singleton!(: Queue = Queue::new())?,
        ];
        let is_emulated = clock::is_emulated(&chip.RCC);
        clock::speed_up(&chip.RCC, &chip.FLASH);
        chip.RCC.ahb1enr().modify(|_, w| w.gpioaen().enabled());
        chip.RCC.apb1enr().modify(|_, w| w.tim2en().enabled().usart2en().enabled());
        chip.RCC.apb2enr().modify(|_, w| w.usart1en().enabled());

        let pins: &'static GPIOA = cortex_m::singleton!(: GPIOA = chip.GPIOA)?;
        // Without a transceiver, the receiver would read a floating pin.
        pins.pupdr().modify(|_, w| w.pupdr3().pull_up().pupdr10().pull_up());
        pins.afrl().modify(|_, w| w.afrl2().af7().afrl3().af7());
        pins.afrh().modify(|_, w| w.afrh9().af7().afrh10().af7());
        pins.moder().modify(|_, w| {
            w.moder2().alternate().moder3().alternate();
            w.moder9().alternate().moder10().alternate();
            w.moder5().output().moder8().output()
        });

        let clock = Clock::new(chip.TIM2, core.SYST, is_emulated);
        let bus = BUS.start(chip.USART1, divider(clock::APB2_HZ, baud), bus_queues);
        let text = TEXT.start(chip.USART2, divider(clock::APB1_HZ, TEXT_BAUD), text_queues);
        // SAFETY: unmasking can break a critical section based on priority masks; there is none.
        unsafe {
            NVIC::unmask(Interrupt::USART1);
            NVIC::unmask(Interrupt::USART2);
        }
        let (driver_enable, lamp, stack) = (Pin(pins), Pin(pins), Stack::new());
        let configs = Configs::new(is_emulated);
        Some(Self { clock, bus, driver_enable, text, lamp, stack, configs })
    }
}

impl TextLine {
    /// Adds the counts of lost and damaged bytes of the line: the same for all programs.
    pub fn bus_losses(&mut self) -> &mut Self {
        self.losses(&BUS)
    }
}

/// Divider of a USART's clock, rounded to nearest.
///
/// 500,000 bit/s is exact, 115,200 bit/s is 0.02 % fast on APB2 and 0.11 % slow on APB1.
const fn divider(clock_hz: u32, baud: u32) -> u32 {
    match (clock_hz + baud / 2).checked_div(baud) {
        Some(divider) => divider,
        None => u32::MAX,
    }
}

/// Pin PA`N`, an output.
pub struct Pin<const N: u8>(&'static GPIOA);

impl<const N: u8> ErrorType for Pin<N> {
    type Error = Infallible;
}

impl<const N: u8> OutputPin for Pin<N> {
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.bsrr().write(|w| w.bs(N).set_());
        Ok(())
    }

    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.bsrr().write(|w| w.br(N).set_bit());
        Ok(())
    }
}
