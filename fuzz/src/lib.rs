//! Bodies of the fuzz targets: plain functions of bytes, so that `cargo test` can run them too
//! (`tests/fuzz_seeds.rs`).

pub mod bodies;
pub mod roles;
