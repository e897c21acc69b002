//! The USART of the firmware counts overruns and damage, which QEMU's own USART never has; the
//! clock sleeps in virtual time.

use crate::qemu::check_uart;

#[test]
fn losses_and_stack_are_counted_flush_waits_for_the_last_stop_bit_and_no_sleep_is_too_long() {
    // In virtual time, which does not depend on the machine.
    let Some((is_good, said)) = check_uart() else { return };
    assert!(is_good && said.contains("all as it should be"), "{said}");
}
