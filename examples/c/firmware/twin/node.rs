//! The node of `node.c` in Rust, on the same stand-in for ST's HAL: the same calls in the same
//! order, without the border to C.
#![no_std]
#![allow(missing_docs, non_snake_case)]

use core::{
    ffi::c_int,
    sync::atomic::{AtomicBool, AtomicU16, Ordering},
};

use axlewire::{
    endpoint::{Arrival, Endpoint, Transmit, Unsent},
    ikeya::{Mode, NodeId, Rps, Slave, Target, slave::SlaveConfig},
    time::{Duration, Instant, Wrapping32},
};
use panic_halt as _;

const STEP: Duration = Duration::from_millis(1);
const DRIVER_ENABLE_PORT: usize = 0x4002_0000;
const DRIVER_ENABLE: u16 = 1 << 8;
const SIZE: usize = 256;

#[repr(C)]
pub struct Uart {
    _private: [u32; 2],
}

unsafe extern "C" {
    static mut huart1: Uart;
    fn HAL_Init() -> c_int;
    fn HAL_UARTEx_ReceiveToIdle_DMA(uart: *mut Uart, to: *mut u8, size: u16) -> c_int;
    fn HAL_UART_Transmit(uart: *mut Uart, from: *const u8, size: u16, timeout_ms: u32) -> c_int;
    fn HAL_GPIO_WritePin(port: usize, pin: u16, state: c_int);
    fn HAL_Micros() -> u32;
    fn HAL_IsEmulated() -> c_int;
}

static mut RING: [u8; SIZE] = [0; SIZE];
static FILLED: AtomicU16 = AtomicU16::new(0);
static HAS_ENDED: AtomicBool = AtomicBool::new(false);

#[unsafe(no_mangle)]
pub extern "C" fn HAL_UARTEx_RxEventCallback(_: *mut Uart, size: u16) {
    FILLED.store(size % SIZE as u16, Ordering::Relaxed);
}

#[unsafe(no_mangle)]
pub extern "C" fn HAL_UART_ErrorCallback(_: *mut Uart) {
    HAS_ENDED.store(true, Ordering::Relaxed);
}

struct Node {
    slave: Slave,
    timer: Wrapping32,
    taken: usize,
    rps: f32,
    empty_at: Instant,
    held_up_after: Duration,
}

impl Node {
    fn now(&mut self) -> Instant {
        // SAFETY: reads a register.
        self.timer.at(unsafe { HAL_Micros() })
    }

    fn hand_in(&mut self, bytes: &[u8]) {
        let now = self.now();
        let since = self.empty_at;
        let is_old = now - since > self.held_up_after;
        let arrival = if is_old { Arrival::Between { since, now } } else { Arrival::Now(now) };
        self.slave.handle_input(bytes, arrival);
    }

    fn receive(&mut self) {
        let looked_at = self.now();
        let end = usize::from(FILLED.load(Ordering::Relaxed));
        // SAFETY: DMA writes elsewhere in the ring.
        let ring: &[u8; SIZE] = unsafe { &*&raw const RING };
        if end < self.taken {
            self.hand_in(ring.get(self.taken..).unwrap_or_default());
            self.taken = 0;
        }
        self.hand_in(ring.get(self.taken..end).unwrap_or_default());
        self.taken = end;
        self.empty_at = looked_at;
        self.slave.handle_timeout(looked_at);
        if HAS_ENDED.load(Ordering::Relaxed) {
            self.begin_to_receive();
        }
    }

    fn begin_to_receive(&mut self) {
        HAS_ENDED.store(false, Ordering::Relaxed);
        FILLED.store(0, Ordering::Relaxed);
        self.taken = 0;
        let ring = (&raw mut RING).cast();
        // SAFETY: the ring stays where it is.
        unsafe { HAL_UARTEx_ReceiveToIdle_DMA(&raw mut huart1, ring, SIZE as u16) };
    }

    fn answer(&mut self) {
        loop {
            let now = self.now();
            let Some(frame) = self.slave.poll_transmit(now) else { return };
            // SAFETY: writes a register.
            unsafe { HAL_GPIO_WritePin(DRIVER_ENABLE_PORT, DRIVER_ENABLE, 1) };
            // SAFETY: the frame stays where it is during the call.
            let sent = unsafe {
                HAL_UART_Transmit(&raw mut huart1, frame.as_ptr(), frame.len() as u16, 2)
            };
            if sent != 0 {
                let now = self.now();
                self.slave.handle_transmit(Transmit::Unsent(Unsent::CutOff), now);
            }
            // SAFETY: writes a register.
            unsafe { HAL_GPIO_WritePin(DRIVER_ENABLE_PORT, DRIVER_ENABLE, 0) };
        }
    }

    fn turn(&mut self, now: Instant) {
        let speed = match self.slave.command(now) {
            Some(Target::Velocity(speed)) => speed.get(),
            _ => 0.0,
        };
        self.rps += (speed - self.rps) / 16.0;
        let is_still = self.rps > -1e-3 && self.rps < 1e-3;
        self.slave
            .set_velocity(Rps::new(if is_still { 0.0 } else { self.rps }).unwrap_or_default());
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn main() -> c_int {
    // SAFETY: each function of the HAL is called as its description says.
    let is_emulated = unsafe {
        HAL_Init();
        HAL_IsEmulated() != 0
    };
    let mut config = if is_emulated { SlaveConfig::usb_adapter() } else { SlaveConfig::direct() };
    config.watchdog = Some(Duration::from_millis(500));
    config.two_wire = true;
    let timer = Wrapping32::new();
    // SAFETY: reads a register.
    let begin = timer.at(unsafe { HAL_Micros() });
    let slave = Slave::new(NodeId::N1, Mode::Velocity, config, begin);
    let held_up_after = slave.line_rules().held_up_after.unwrap_or(Duration::from_micros(u32::MAX));
    let mut node = Node { slave, timer, taken: 0, rps: 0.0, empty_at: begin, held_up_after };
    node.begin_to_receive();
    let mut step_at = node.now();
    node.empty_at = step_at;
    loop {
        node.receive();
        node.answer();
        if node.now() < step_at {
            continue;
        }
        let now = node.now();
        node.turn(now);
        step_at = node.now() + STEP;
    }
}
