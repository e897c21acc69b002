#!/usr/bin/env bash
# Makes the wheel that people install: release.sh OUT [OPTIONS OF MATURIN]
#
# One for all versions of Python from 3.11 on; with --zig, for each Linux with glibc 2.17 or newer.
# Needs maturin (`pip install "maturin[zig]"`).
set -euo pipefail
mkdir -p "$1"
out=$(cd "$1" && pwd)
shift
cd "$(dirname "$0")"
# With the licences of what is linked into it; its program names no folder of this machine.
command -v cargo-bundle-licenses >/dev/null || cargo install --quiet --locked cargo-bundle-licenses
cargo bundle-licenses --format yaml --output LICENSES-OF-DEPENDENCIES.yaml 2>/dev/null
RUSTFLAGS="--remap-path-prefix=$(cd ../.. && pwd)=/axlewire \
    --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}/registry=/cargo" \
    maturin build --quiet --release --locked --out "$out" "$@"
