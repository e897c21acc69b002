#!/usr/bin/env bash
# Compares what the decoders show with `axle decode`: see check.py. Needs the Debian packages
# sigrok-cli and libsigrokdecode4.
set -euo pipefail
cd "$(dirname "$0")/../.."
if [ -z "${AXLE:-}" ]; then
    cargo build --quiet -p axlewire-cli --all-features
    AXLE=${CARGO_TARGET_DIR:-target}/debug/axle
fi
AXLE=$AXLE exec python3 examples/sigrok/check.py
