#!/usr/bin/env bash
# Checks the dissector with tshark, on captures and on live lines: see check.py.
#
#   examples/wireshark/check.sh              everything; exit code 3 if tshark is missing
#   examples/wireshark/check.sh --planted    damages of the dissector, each of which must be found
set -euo pipefail
cd "$(dirname "$0")/../.."
command -v tshark >/dev/null || {
    echo "tshark is missing: install the Debian package tshark" >&2
    exit 3
}
cargo build --quiet -p axle --bin axle
# CARGO_TARGET_DIR may be set.
target=$(cargo metadata --format-version 1 --no-deps | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
AXLE=$target/debug/axle exec python3 examples/wireshark/check.py "$@"
