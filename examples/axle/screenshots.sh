#!/usr/bin/env bash
# Draws the pictures of the README anew, from simulated lines: screenshots/bus.svg, rover.svg.
set -euo pipefail
cd "$(dirname "$0")"
mkdir -p screenshots
cargo test --quiet -p axle --bin axle -- --ignored --exact \
    watch::page::shots::write_the_pictures
