//! Clocks: one that goes backwards, and one combined with a delay.

use std::cell::RefCell;

use embedded_hal_async::delay::DelayNs;

use crate::rig::*;

#[test]
fn role_time_continues_after_a_clock_goes_backwards() {
    let clock = clock_that_says([100, 50, 70, 120].into_iter().cycle());
    let flood = (0..100).map(|_| bytes(1));
    // The recorder itself asserts that time never goes backwards.
    let mut driver = On::new(Recorder::default(), Port::reading(flood), clock);
    driver.service().unwrap();
    assert_eq!(driver.role().received.len(), 64);

    // One reading is an hour ahead: the steps before and after it still count.
    let hour = 3_600_000_000;
    let clock = clock_that_says([1000, hour + 1000, 1500, 2500, 2400, 2700]);
    let driver = On::new(Recorder::default(), Port::default(), clock);
    let times: Vec<u64> = (0..5).map(|_| driver.now().as_micros() - hour).collect();
    assert_eq!(times, [1000, 1000, 2000, 2000, 2300]);
}

#[test]
fn a_clock_and_a_delay_can_be_combined() {
    let said = RefCell::new(vec![]);
    struct Says<'a>(&'a RefCell<Vec<String>>);
    impl Clock for Says<'_> {
        fn now(&self) -> Instant {
            at_ms(7)
        }
        fn idle_until(&mut self, until: Instant) {
            self.0.borrow_mut().push(format!("idle until {}", until.as_micros()));
        }
    }
    impl DelayNs for Says<'_> {
        async fn delay_ns(&mut self, ns: u32) {
            self.0.borrow_mut().push(format!("{ns} ns"));
        }
        async fn delay_us(&mut self, us: u32) {
            self.0.borrow_mut().push(format!("{us} us"));
        }
        async fn delay_ms(&mut self, ms: u32) {
            self.0.borrow_mut().push(format!("{ms} ms"));
        }
    }
    let mut both = WithDelay { clock: Says(&said), delay: Says(&said) };
    assert_eq!(both.now(), at_ms(7));
    both.idle_until(at_ms(9));
    let world = World::default();
    world.block_on(async {
        both.delay_ns(1).await;
        both.delay_us(2).await;
        both.delay_ms(3).await;
    });
    assert_eq!(*said.borrow(), ["idle until 9000", "1 ns", "2 us", "3 ms"]);
}
