//! Builds the C reference, always at -O3: axlewire is measured against it, so it must not change
//! with the Rust profile.

use std::{env, fmt::Write, fs, path::Path};

/// 0x8005 with its bits in wire order (ruling B1).
const POLYNOMIAL: u16 = 0xA001;

fn main() {
    let out = env::var_os("OUT_DIR").expect("cargo sets OUT_DIR");
    fs::write(Path::new(&out).join("crc_tables.h"), tables()).expect("OUT_DIR is writable");

    for source in ["axle_ref.c", "axle_ref.h"] {
        println!("cargo::rerun-if-changed=reference/{source}");
    }
    cc::Build::new()
        .file("reference/axle_ref.c")
        .include(out)
        .std("c11")
        .opt_level(3)
        .debug(false)
        .extra_warnings(true)
        .warnings_into_errors(true)
        .compile("axle_ref");
}

/// The two tables of the classic code: low and high byte of the CRC of each byte.
fn tables() -> String {
    let effects: Vec<u16> = (0..=255).map(effect).collect();
    let mut header = String::new();
    for (name, shift) in [("crc_low", 0), ("crc_high", 8)] {
        writeln!(header, "static const uint8_t {name}[256] = {{").expect("strings grow");
        for row in effects.chunks(16) {
            let row: Vec<String> =
                row.iter().map(|e| format!("{:#04x}", e >> shift & 0xFF)).collect();
            writeln!(header, "    {},", row.join(", ")).expect("strings grow");
        }
        writeln!(header, "}};").expect("strings grow");
    }
    header
}

/// CRC of one byte, bit by bit.
fn effect(byte: u16) -> u16 {
    (0..8).fold(byte, |crc, _| if crc & 1 == 1 { crc >> 1 ^ POLYNOMIAL } else { crc >> 1 })
}
