#!/usr/bin/env bash
# Draws the pictures of the README anew: the page of `axle watch` from simulated lines, bus.svg and
# rover.svg, and those of `axle plot` from our captures, motors.svg and drive.svg.
set -euo pipefail
cd "$(dirname "$0")"
mkdir -p screenshots
cargo test --quiet -p axlewire-cli --lib -- --ignored --exact \
    watch::page::shots::write_the_pictures
for name in motors drive; do
    cargo run --quiet -p axlewire-cli --features plot -- \
        plot "../captures/$name.pcapng" --force -o "screenshots/$name.svg"
done
