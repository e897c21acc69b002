#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| axlewire_fuzz::run("drive_bus", data));
