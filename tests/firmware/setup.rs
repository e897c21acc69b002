//! The registers that the images write at their start, from QEMU's log. QEMU has neither pins nor
//! baud rates, so nothing else would notice a wrong one; a board would be mute.

use crate::names::*;

/// Everything that is written to the register at this address.
fn written(log: &str, address: u32) -> Vec<u32> {
    let number = |line: &str, name: &str| {
        let mut words = line.split_ascii_whitespace().skip_while(|&word| word != name);
        u32::from_str_radix(words.nth(1)?.strip_prefix("0x")?, 16).ok()
    };
    log.lines()
        .filter(|line| line.starts_with("memory_region_ops_write "))
        .filter(|line| number(line, "addr") == Some(address))
        .filter_map(|line| number(line, "value"))
        .collect()
}

/// Two bits for each of these pins.
const fn pairs(pins: &[u32], bits: u32) -> u32 {
    let (mut all, mut at) = (0, 0);
    while at < pins.len() {
        all |= bits << (2 * pins[at]);
        at += 1;
    }
    all
}

#[test]
fn the_images_set_up_clocks_pins_and_baud_rates_as_the_board_needs_them() {
    // Dividers of 84 MHz and 42 MHz, rounded to nearest: 500,000, 115,200 and 115,200 bit/s.
    for (program, divider) in [(Program::Slave, 168), (Program::Master, 168), (Program::Robot, 729)]
    {
        let Some(mut board) = Board::start_logged(program) else { return };
        board.report_when("started", |_| true);
        let log = board.accesses();
        let is = |name, address, value| {
            let all = written(&log, address);
            assert!(all.contains(&value), "{program:?}: {name} is {all:X?}, not {value:X}");
        };
        is("BRR of USART1", 0x4001_1008, divider);
        is("BRR of USART2", 0x4000_4408, 365);
        // UE, RXNEIE, TE and RE: 8 data bits, no parity; CR2 with one stop bit is not written.
        for (name, base) in [("USART1", 0x4001_1000), ("USART2", 0x4000_4400)] {
            assert_eq!(written(&log, base + 0xC).first(), Some(&0x202C), "CR1 of {name}");
            assert_eq!(written(&log, base + 0x10), [], "CR2 of {name}");
        }
        is("AHB1ENR", 0x4002_3830, 1);
        is("APB1ENR", 0x4002_3840, 1 << 17 | 1);
        is("APB2ENR", 0x4002_3844, 1 << 4);
        // Alternate functions of pins 2, 3, 9 and 10; outputs 5 and 8.
        is("MODER", 0x4002_0000, pairs(&[2, 3, 9, 10], 0b10) | pairs(&[5, 8], 0b01));
        is("PUPDR", 0x4002_000C, pairs(&[3, 10], 0b01));
        is("AFRL", 0x4002_0020, 0x7700);
        is("AFRH", 0x4002_0024, 0x0770);
        // One microsecond of QEMU's timer.
        is("PSC of TIM2", 0x4000_0028, 999);
    }
}

#[test]
fn the_lamp_of_the_robot_is_on_after_a_command_with_it_and_off_after_one_without() {
    let Some(mut board) = Board::start_logged(Program::Robot) else { return };
    let mut wire = Wire::new(board.bus());
    board.report_when("off", |told| told.at("lamp") == 0);
    let command = MotorControl::new(0, 0).unwrap();
    for (index, is_on) in [(0, true), (1, false)] {
        wire.send(command.with_front_led(is_on).frame(index).as_bytes());
        board.report_when("switched", |told| told.at("lamp") == i64::from(is_on));
    }
    // Set and reset bits of PA5.
    let mut lamp: Vec<bool> = written(&board.accesses(), 0x4002_0018)
        .into_iter()
        .filter(|value| value & (1 << 21 | 1 << 5) != 0)
        .map(|value| value == 1 << 5)
        .collect();
    lamp.dedup();
    assert_eq!(lamp, [false, true, false]);
}
