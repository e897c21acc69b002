//! A slave of a motor bus with RTIC: receives all traffic, answers its own READs within 50 µs.
//!
//! STM32F405. PA9 and PA10 are the UART at 500 kbit/s, PA8 enables the driver of the RS485
//! transceiver, PC0 to PC3 are the DIP switch.

#![no_std]
#![no_main]

mod board;

use panic_halt as _;

#[rtic::app(device = stm32f4::stm32f405, dispatchers = [EXTI0])]
mod app {
    use axlewire::{
        endpoint::Endpoint,
        ikeya::{
            Position, Rps, Slave, Target,
            slave::{DipSwitch, IdReading, SlaveConfig, SlaveEvent},
        },
        time::{Duration, Instant, Wrapping32},
    };
    use heapless::spsc::{Consumer, Producer, Queue};
    use rtic_sync::signal::{Signal, SignalReader, SignalWriter};
    use stm32f4::stm32f405::Interrupt;

    use crate::board::{Board, Micros, Port};

    #[shared]
    struct Shared {
        micros: Micros,
    }

    #[local]
    struct Local {
        port: Port,
        heard: Producer<'static, u8>,
        answer: Consumer<'static, u8>,
        line_woke: SignalWriter<'static, ()>,
        micros_woke: SignalWriter<'static, ()>,
        slave: Slave,
        hear: Consumer<'static, u8>,
        say: Producer<'static, u8>,
        woken: SignalReader<'static, ()>,
    }

    #[init(local = [
        received: Queue<u8, 64> = Queue::new(),
        to_send: Queue<u8, 32> = Queue::new(),
        bell: Signal<()> = Signal::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let Board { port, micros, dip } = Board::new(cx.device);
        let (heard, hear) = cx.local.received.split();
        let (say, answer) = cx.local.to_send.split();
        let (wake, woken) = cx.local.bell.split();

        let mut config = SlaveConfig::direct();
        config.watchdog = Some(Duration::from_millis(500));
        // With the reading that covers ids 1 to 8, every switch setting is a valid id (ruling I2).
        let slave = DipSwitch::from_bits(dip).and_then(|dip| {
            let node = dip.node_id(IdReading::ValuePlusOne)?;
            Ok(Slave::new(node, dip.mode(), config, Instant::from_micros(0)))
        });
        let Ok(mut slave) = slave else { panic!("every 4-bit switch setting has an id") };
        // The motor of this example starts at position 0.
        slave.set_position(Position::new(0, 0));
        // It is spawned only here, so there is room.
        let _ = talk::spawn();
        let (line_woke, micros_woke) = (wake.clone(), wake);
        (
            Shared { micros },
            Local { port, heard, answer, line_woke, micros_woke, slave, hear, say, woken },
        )
    }

    /// Moves bytes between the UART and the queues. Only this task uses the UART.
    #[task(binds = USART1, priority = 3, local = [port, heard, answer, line_woke])]
    fn line(cx: line::Context) {
        let line::LocalResources { port, heard, answer, line_woke, .. } = cx.local;
        if let Some(byte) = port.receive() {
            // If there is no room, or after an overrun, a byte is missing and the CRC fails.
            let _ = heard.enqueue(byte);
            line_woke.write(());
        }
        port.send(|| answer.dequeue());
    }

    /// Runs at the time requested by the slave.
    #[task(binds = TIM2, priority = 2, shared = [micros], local = [micros_woke])]
    fn late(mut cx: late::Context) {
        cx.shared.micros.lock(|micros| micros.acknowledge());
        cx.local.micros_woke.write(());
    }

    /// The slave itself, woken by bytes and by time.
    #[task(priority = 1, shared = [micros], local = [slave, hear, say, woken])]
    async fn talk(mut cx: talk::Context) {
        let talk::LocalResources { slave, hear, say, woken, .. } = cx.local;
        let clock = Wrapping32::new();
        loop {
            let now = clock.at(cx.shared.micros.lock(|micros| micros.now()));
            while let Some(byte) = hear.dequeue() {
                slave.handle_input(&[byte], now);
            }
            slave.handle_timeout(now);
            // The answer is due within 50 µs, so it goes first.
            if let Some(answer) = slave.poll_transmit(now) {
                for &byte in answer {
                    // There is room: two answers are never in flight together.
                    let _ = say.enqueue(byte);
                }
                rtic::pend(Interrupt::USART1);
            }
            while let Some(event) = slave.poll_event() {
                // Your motor goes here. This one follows commands instantly.
                match event {
                    SlaveEvent::Command(Target::Velocity(speed)) => slave.set_velocity(speed),
                    SlaveEvent::Command(Target::Position(at)) => slave.set_position(at),
                    SlaveEvent::Watchdog => slave.set_velocity(Rps::ZERO),
                    _ => {}
                }
            }
            if let Some(at) = slave.poll_timeout() {
                let counter = cx.shared.micros.lock(|micros| micros.wake_at(at.as_micros() as u32));
                if clock.at(counter) >= at {
                    continue;
                }
            }
            woken.wait().await;
        }
    }
}
