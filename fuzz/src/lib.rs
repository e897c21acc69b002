//! What the fuzz targets run. The bodies are plain functions of bytes, so that `cargo test` runs
//! them too: `tests/fuzz_seeds.rs`.

pub mod bodies;
pub mod roles;
