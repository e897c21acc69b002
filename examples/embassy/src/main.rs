//! The robot side of a rover link with embassy: takes commands over USART1, drives two wheels,
//! reports.
//!
//! STM32F405, internal oscillator, 168 MHz. PA9 and PA10 are the UART to the Linux board, PA6 and
//! PA7 carry the speeds of the left and right wheels as PWM, PB0 and PB1 their directions (low is
//! forward), and PB5 is the lamp. PA0 measures the battery through a divide-by-4 divider.

#![no_std]
#![no_main]

use axlewire::{
    drive::{WithDelay, asynch::Driver},
    time::{Duration, Instant},
    ucp::{
        BAUD, Robot, Telemetry,
        message::OtaStatus,
        robot::{RobotConfig, RobotEvent},
    },
};
use embassy_executor::Spawner;
use embassy_stm32::{
    Config, Peri,
    adc::{Adc, SampleTime},
    bind_interrupts,
    gpio::{AnyPin, Level, Output, OutputType, Speed},
    peripherals::{TIM3, USART1},
    rcc::{AHBPrescaler, APBPrescaler, Pll, PllMul, PllPDiv, PllPreDiv, PllSource, Sysclk},
    time::khz,
    timer::low_level::CountingMode,
    timer::simple_pwm::{PwmPin, SimplePwm, SimplePwmChannel},
    usart::{self, BufferedInterruptHandler, BufferedUart},
    wdg::IndependentWatchdog,
};
use panic_halt as _;

bind_interrupts!(struct Irqs {
    USART1 => BufferedInterruptHandler<USART1>;
});

/// Interval between battery measurements, and longest interval between checks of the command.
const PERIOD: Duration = Duration::from_millis(50);

/// Longest time for one loop iteration before the processor is reset, which stops the wheels.
const HANG_US: u32 = 500_000;

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let p = embassy_stm32::init(clocks());
    let mut dog = IndependentWatchdog::new(p.IWDG, HANG_US);

    let (left, right) =
        (PwmPin::new(p.PA6, OutputType::PushPull), PwmPin::new(p.PA7, OutputType::PushPull));
    let pwm = SimplePwm::new(
        p.TIM3,
        Some(left),
        Some(right),
        None,
        None,
        khz(20),
        CountingMode::default(),
    );
    let pwm = pwm.split();
    let low = |pin: Peri<'static, AnyPin>| Output::new(pin, Level::Low, Speed::Low);
    let mut left = Wheel::new(pwm.ch1, low(p.PB0.into()));
    let mut right = Wheel::new(pwm.ch2, low(p.PB1.into()));
    let mut lamp = low(p.PB5.into());
    let (mut adc, mut battery) = (Adc::new(p.ADC1), p.PA0);

    // Ample room for bytes received while a 44-byte report is sent.
    let (mut sent, mut received) = ([0; 128], [0; 256]);
    let mut config = usart::Config::default();
    config.baudrate = BAUD;
    let uart = BufferedUart::new(p.USART1, p.PA10, p.PA9, &mut sent, &mut received, Irqs, config);
    let Ok(uart) = uart else { panic!("115,200 bit/s is not possible with this clock") };

    let clock = || Instant::from_micros(embassy_time::Instant::now().as_micros());
    let robot = Robot::new(RobotConfig::default(), clock());
    let mut rover = Driver::new(robot, uart, WithDelay { clock, delay: embassy_time::Delay });
    dog.unleash();
    loop {
        dog.pet();
        let raw = adc.blocking_read(&mut battery, SampleTime::CYCLES84);
        let now = rover.now();
        rover.role_mut().set_telemetry(&measured(raw), now);

        // Returns early when the command changes. A failed port is retried, and meanwhile the
        // robot's watchdog keeps running, so the command is queried below whatever this call
        // returns.
        let _ = rover.next_command(PERIOD).await;
        while let Some(event) = rover.poll_event() {
            if let RobotEvent::UpdateRequested { .. } = event {
                // This board has no boot loader. An update requested by a motor command expects no
                // answer, and then this call does nothing.
                let now = rover.now();
                rover.role_mut().answer_update(OtaStatus::Forbidden, now);
            }
        }
        let now = rover.now();
        let command = rover.role().command(now);
        let (left_pct, right_pct) = command.wheels_pct();
        left.turn(left_pct);
        right.turn(right_pct);
        lamp.set_level(if command.front_led() == 0 { Level::Low } else { Level::High });
    }
}

/// Telemetry for a 12-bit ADC reading: 4095 is 13.2 V. Three cells range from 9.6 V to 12.6 V.
fn measured(raw: u16) -> Telemetry {
    let voltage_dv = u32::from(raw.min(4095)) * 132 / 4095;
    let battery_pct = voltage_dv.saturating_sub(96).min(30) * 100 / 30;
    Telemetry {
        battery_pct: battery_pct as u16,
        voltage_dv: voltage_dv as u8,
        ..Telemetry::default()
    }
}

/// A motor driver with one input for the speed and one for the direction.
struct Wheel<'d> {
    speed: SimplePwmChannel<'d, TIM3>,
    back: Output<'d>,
}

impl<'d> Wheel<'d> {
    fn new(mut speed: SimplePwmChannel<'d, TIM3>, back: Output<'d>) -> Self {
        speed.set_duty_cycle_fully_off();
        speed.enable();
        Self { speed, back }
    }

    fn turn(&mut self, percent: i16) {
        self.back.set_level(if percent < 0 { Level::High } else { Level::Low });
        self.speed.set_duty_cycle_percent(percent.unsigned_abs().min(100) as u8);
    }
}

/// 168 MHz from the internal oscillator of 16 MHz.
fn clocks() -> Config {
    let mut config = Config::default();
    let rcc = &mut config.rcc;
    rcc.pll_src = PllSource::HSI;
    let (prediv, mul, divp) = (PllPreDiv::DIV8, PllMul::MUL168, Some(PllPDiv::DIV2));
    rcc.pll = Some(Pll { prediv, mul, divp, divq: None, divr: None });
    rcc.sys = Sysclk::PLL1_P;
    rcc.ahb_pre = AHBPrescaler::DIV1;
    rcc.apb1_pre = APBPrescaler::DIV4;
    rcc.apb2_pre = APBPrescaler::DIV2;
    config
}
