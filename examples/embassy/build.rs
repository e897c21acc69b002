//! The linker script of cortex-m-rt; embassy-stm32 brings the memory map of the processor.

fn main() {
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
}
