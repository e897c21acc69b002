#!/usr/bin/env bash
# Runs the proof of the page.
#
#   examples/web/check.sh           all of it, some minutes
#   examples/web/check.sh --quick   builds it, and opens it once
#
# Needs what build.sh needs, and Chromium: its path in CHROMIUM, or /usr/bin/chromium.
set -euo pipefail
cd "$(dirname "$0")"
target=$(realpath -m "${CARGO_TARGET_DIR:-../../target}")
page=$target/web/page shots=$target/web/screenshots
cargo fmt --check
cargo clippy --quiet --target-dir "$target/web/host" -- -D warnings
./build.sh "$page"
npx prettier --print-width 100 --log-level warn --check index.html page tests vite.config.ts
if [ "${1-}" = --quick ]; then
    STORY='aMotorRuns|stopIsSeen|aCaptureIsListed' exec node tests/page.mjs "$page/index.html" "$shots"
fi
cargo build --quiet --release -p axlewire-cli --manifest-path ../../Cargo.toml --target-dir "$target"
node tests/roles.mjs
node tests/values.mjs "$target/release/axle" "$target/web/scratch"
node tests/page.mjs "$page/index.html" "$shots"
node tests/speed.mjs "$target/release/axle" "$target/web/scratch" "$page/index.html"
