//! A USART with one queue per direction.
//!
//! The interrupt only moves bytes: a received byte from the data register into a queue, a queued
//! byte into the data register. The main loop does the decoding, answering and all other slow work.
//!
//! Why not decode in the interrupt: at 500 kbit/s a byte comes every 20 µs and must be fetched
//! before the next one is complete. Moving a byte takes less than 1 µs; a decoder may have to
//! search a whole packet for one byte, and a role sends answers. The price is the delay from the
//! interrupt to the main loop, less than 1 µs on an otherwise idle processor.

use core::{
    cell::{Cell, OnceCell},
    convert::Infallible,
    ops::Deref,
    sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed},
};

use cortex_m::peripheral::NVIC;
use critical_section::{CriticalSection, Mutex};
use heapless::spsc::Queue as Spsc;
use stm32f4::stm32f405::{Interrupt, usart1::RegisterBlock};

use crate::text_line::TextLine;

/// Queue between an interrupt and the main loop, 511 bytes: 10 ms of a full 500 kbit/s line.
pub type Queue = Spsc<u8, 512>;

/// A queue that both sides access in a critical section.
///
/// It is taken out of its cell and put back: no cell is ever found borrowed, so nothing can panic.
/// It is not split into two ends, because those read the queue's length at run time and divide by
/// it.
struct Shared(Mutex<Cell<Option<&'static mut Queue>>>);

impl Shared {
    const fn new() -> Self {
        Self(Mutex::new(Cell::new(None)))
    }

    /// Runs `work` on the queue; `None` before there is one.
    fn with<T>(&self, work: impl FnOnce(&mut Queue) -> T) -> Option<T> {
        critical_section::with(|cs| {
            let cell = self.0.borrow(cs);
            let queue = cell.take()?;
            let result = work(queue);
            cell.set(Some(queue));
            Some(result)
        })
    }
}

/// Set by every interrupt of a USART: there may be something to do.
static HAPPENED: AtomicBool = AtomicBool::new(false);

/// Whether an interrupt of a USART has been served since the last call.
pub fn has_happened(_: CriticalSection<'_>) -> bool {
    // Load and store cannot be interrupted in a critical section.
    let happened = HAPPENED.load(Relaxed);
    HAPPENED.store(false, Relaxed);
    happened
}

/// State shared by the interrupt of a USART and the main loop. `U` is its register block.
pub struct Channel<U> {
    interrupt: Interrupt,
    usart: Mutex<OnceCell<U>>,
    inbox: Shared,
    outbox: Shared,
    /// Number of bytes lost by the hardware because the previous one was still in the data
    /// register.
    overruns: AtomicU32,
    /// Number of bytes that arrived while the queue was full: the main loop was too slow.
    lost: AtomicU32,
    /// Number of bytes with a framing error or noise in the middle of a bit. They are still
    /// received.
    damaged: AtomicU32,
}

impl<U: Deref<Target = RegisterBlock> + Send> Channel<U> {
    /// A channel that does nothing until [`start`](Self::start).
    pub const fn new(interrupt: Interrupt) -> Self {
        Self {
            interrupt,
            usart: Mutex::new(OnceCell::new()),
            inbox: Shared::new(),
            outbox: Shared::new(),
            overruns: AtomicU32::new(0),
            lost: AtomicU32::new(0),
            damaged: AtomicU32::new(0),
        }
    }

    /// Starts the USART, 8N1, with its clock divided by `divider`, and returns its port.
    ///
    /// Call it once, with the USART's clock enabled; the caller unmasks the interrupt.
    pub fn start(
        &'static self,
        usart: U,
        divider: u32,
        [inbox, outbox]: [&'static mut Queue; 2],
    ) -> Port<U> {
        usart.brr().write(|w| {
            w.div_mantissa().set((divider >> 4) as u16);
            w.div_fraction().set((divider & 0xF) as u8)
        });
        usart.cr1().write(|w| w.ue().enabled().te().enabled().re().enabled().rxneie().enabled());
        critical_section::with(|cs| {
            self.inbox.0.borrow(cs).set(Some(inbox));
            self.outbox.0.borrow(cs).set(Some(outbox));
            // A second start finds the cell full and changes nothing.
            let _ = self.usart.borrow(cs).set(usart);
        });
        Port(self)
    }

    /// The interrupt handler.
    pub fn serve(&self) {
        self.on_usart(|usart| {
            // Status first: reading the data register after it clears the error flags.
            let status = usart.sr().read();
            if status.ore().bit_is_set() {
                count(&self.overruns);
            }
            if status.rxne().bit_is_set() || status.ore().bit_is_set() {
                let byte = usart.dr().read().bits() as u8;
                if status.fe().bit_is_set() || status.nf().bit_is_set() {
                    count(&self.damaged);
                }
                if status.rxne().bit_is_set() {
                    self.receive(byte);
                }
            }
            if usart.cr1().read().txeie().bit_is_set() {
                self.feed(usart);
            }
        });
        HAPPENED.store(true, Relaxed);
    }

    fn receive(&self, byte: u8) {
        if self.inbox.with(|inbox| inbox.enqueue(byte).is_ok()) != Some(true) {
            count(&self.lost);
        }
    }

    /// Fills the data register; disables the interrupt once nothing is left to send.
    ///
    /// On a board the register is full after two bytes. In QEMU it never is.
    fn feed(&self, usart: &RegisterBlock) {
        while usart.sr().read().txe().bit_is_set() {
            let Some(byte) = self.outbox.with(Queue::dequeue).flatten() else {
                usart.cr1().modify(|_, w| w.txeie().disabled());
                return;
            };
            usart.dr().write(|w| w.dr().set(byte.into()));
        }
    }

    /// Enables the interrupt that sends queued bytes.
    fn wake_sender(&self) {
        self.on_usart(|usart| {
            usart.cr1().modify(|_, w| w.txeie().enabled());
        });
        // An empty data register triggers it at once, except in QEMU.
        NVIC::pend(self.interrupt);
    }

    /// Whether everything has been sent and the last stop bit has left the pin.
    fn is_sent(&self) -> bool {
        // In this order: a byte that has left the queue is in the data register, and TC is 0.
        self.outbox.with(|outbox| outbox.is_empty()) != Some(false)
            && self.on_usart(|usart| usart.sr().read().tc().bit_is_set()) != Some(false)
    }

    fn on_usart<T>(&self, work: impl FnOnce(&RegisterBlock) -> T) -> Option<T> {
        critical_section::with(|cs| self.usart.borrow(cs).get().map(|usart| work(usart)))
    }

    /// Number of bytes lost by the hardware because the previous one had not been fetched.
    pub fn overruns(&self) -> u32 {
        self.overruns.load(Relaxed)
    }

    /// Number of bytes lost because the queue was full.
    pub fn lost(&self) -> u32 {
        self.lost.load(Relaxed)
    }

    /// Number of bytes with a wrong stop bit or noise within a bit.
    pub fn damaged(&self) -> u32 {
        self.damaged.load(Relaxed)
    }
}

impl TextLine {
    /// Adds the counts of lost and damaged bytes of a USART.
    pub fn losses<U: Deref<Target = RegisterBlock> + Send>(
        &mut self,
        channel: &Channel<U>,
    ) -> &mut Self {
        self.count("overruns", channel.overruns())
            .count("lost", channel.lost())
            .count("damaged", channel.damaged())
    }
}

/// Only the interrupt counts, and it does not interrupt itself.
fn count(counter: &AtomicU32) {
    counter.store(counter.load(Relaxed).wrapping_add(1), Relaxed);
}

/// Main loop side of a [`Channel`]: a port with the traits of `embedded-io`.
pub struct Port<U: 'static>(&'static Channel<U>);

impl<U: Deref<Target = RegisterBlock> + Send> Port<U> {
    /// The next received byte, if there is one.
    pub fn poll_byte(&mut self) -> Option<u8> {
        self.0.inbox.with(Queue::dequeue).flatten()
    }

    /// Queues all of `bytes` if there is room, otherwise nothing; returns whether there was room.
    /// Never waits.
    pub fn try_send(&mut self, bytes: &[u8]) -> bool {
        let outbox = &self.0.outbox;
        let has_room = outbox.with(|it| it.capacity().saturating_sub(it.len()) >= bytes.len());
        // Nothing else fills the queue, so the room remains. A few bytes at a time, because
        // interrupts are off meanwhile and the other line's next byte must not wait longer than 20
        // µs.
        let queued = has_room == Some(true)
            && bytes.chunks(16).all(|chunk| {
                outbox.with(|it| chunk.iter().all(|&byte| it.enqueue(byte).is_ok())) == Some(true)
            });
        self.0.wake_sender();
        queued
    }
}

impl<U> embedded_io::ErrorType for Port<U> {
    type Error = Infallible;
}

impl<U: Deref<Target = RegisterBlock> + Send> embedded_io::ReadReady for Port<U> {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.0.inbox.with(|inbox| !inbox.is_empty()) == Some(true))
    }
}

impl<U: Deref<Target = RegisterBlock> + Send> embedded_io::Read for Port<U> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let mut count = 0;
        while count == 0 && !buffer.is_empty() {
            for slot in &mut *buffer {
                let Some(byte) = self.poll_byte() else { break };
                *slot = byte;
                count += 1;
            }
        }
        Ok(count)
    }
}

impl<U: Deref<Target = RegisterBlock> + Send> embedded_io::Write for Port<U> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let mut count = 0;
        while count == 0 && !bytes.is_empty() {
            for &byte in bytes {
                if self.0.outbox.with(|outbox| outbox.enqueue(byte).is_ok()) == Some(false) {
                    break;
                }
                count += 1;
            }
            self.0.wake_sender();
        }
        Ok(count)
    }

    /// Waits until the last stop bit is out, as a driver-enable pin requires. The interrupt
    /// receives bytes meanwhile.
    fn flush(&mut self) -> Result<(), Infallible> {
        while !self.0.is_sent() {
            core::hint::spin_loop();
        }
        Ok(())
    }
}
