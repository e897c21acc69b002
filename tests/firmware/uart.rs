//! The USART of the firmware counts overruns and damage, which QEMU's own USART never has.

use crate::{qemu::check_uart, quiet::undisturbed};

#[test]
fn overruns_damage_losses_and_stack_are_counted_and_flush_waits_for_the_last_stop_bit() {
    undisturbed(|| {
        let Some((is_good, said)) = check_uart() else { return };
        assert!(is_good && said.contains("all as it should be"), "{said}");
    });
}
