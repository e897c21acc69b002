#!/usr/bin/env bash
# Puts the headers and the library for this machine into a folder: build.sh OUT
#
# OUT/include and OUT/lib, with the files by which CMake and pkg-config find them.
set -euo pipefail
out=${1:?"where to? build.sh OUT"}
here=$(cd "$(dirname "$0")" && pwd)
target=${CARGO_TARGET_DIR:-$here/../../target}

# No panic may cross into C: it ends the program.
CARGO_PROFILE_RELEASE_PANIC=abort cargo rustc --release --quiet --target-dir "$target" \
    --manifest-path "$here/Cargo.toml" --features std --crate-type staticlib
mkdir -p "$out/include" "$out/lib"
cp "$here"/include/axlewire* "$out/include"
cp "$target/release/libaxlewire_c.a" "$out/lib/libaxlewire.a"
