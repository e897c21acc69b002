//! Gives each symbol of the shared library the version of its name, such as `libaxlewire.so.0.1`:
//! a program then never takes the functions of another version.
use std::env;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=CARGO_C_CARGO");
    // Only cargo-c builds a shared library. Of the usual linkers only GNU ld knows the option.
    if env::var_os("CARGO_C_CARGO").is_some()
        && env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "linux")
    {
        println!("cargo::rustc-cdylib-link-arg=-fuse-ld=bfd");
        println!("cargo::rustc-cdylib-link-arg=-Wl,--default-symver");
    }
}
