//! The fuzz targets. Each body is a plain function of bytes, so that `cargo test` runs it over the
//! checked-in seeds, too (`tests/fuzz_seeds.rs`).

#[path = "../../tests/models/kit.rs"]
#[allow(dead_code, reason = "the models use more of it")]
mod kit;
#[path = "../../tests/harness/rulings.rs"]
#[allow(dead_code, reason = "the tests use more of it")]
mod rulings;
mod targets;

/// Runs the target of this name.
///
/// # Panics
///
/// If the library fails a check, or if there is no such target.
pub fn run(name: &str, data: &[u8]) {
    let target = targets::ALL.iter().find(|target| target.name == name).expect("a target");
    (target.body)(data, &mut targets::Tally::default());
}
