#!/usr/bin/env bash
# Compares what tshark (Debian package tshark) shows with `axle decode --json`: see check.py.
set -euo pipefail
cd "$(dirname "$0")/../.."
if [ -z "${AXLE:-}" ]; then
    cargo build --quiet -p axlewire-cli --all-features
    AXLE=${CARGO_TARGET_DIR:-target}/debug/axle
fi
AXLE=$AXLE exec python3 examples/wireshark/check.py
