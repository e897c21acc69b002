#!/usr/bin/env bash
# Puts the headers and the library for this machine into a folder: build.sh OUT
#
# OUT/include and OUT/lib, with the files by which CMake and pkg-config find them.
set -euo pipefail
out=${1:?"where to? build.sh OUT"}
here=$(cd "$(dirname "$0")" && pwd)
target=${CARGO_TARGET_DIR:-$here/../../target}
unset CARGO_BUILD_TARGET
crate=(--manifest-path "$here/Cargo.toml")

# No panic may cross into C: it ends the program.
CARGO_PROFILE_RELEASE_PANIC=abort cargo rustc --release --quiet --target-dir "$target" \
    "${crate[@]}" --features std --crate-type staticlib
version=$(cargo pkgid "${crate[@]}")

mkdir -p "$out/include" "$out"/lib/{cmake/axlewire,pkgconfig}
cp -p "$here"/include/axlewire* "$out/include"
cp -p "$target/release/libaxlewire_c.a" "$out/lib/libaxlewire.a"
cp "$here"/package/*.cmake "$out/lib/cmake/axlewire"
cp "$here"/package/axlewire.pc "$out/lib/pkgconfig"
sed -i.bak "s/@VERSION@/${version##*@}/" "$out"/lib/pkgconfig/*.pc "$out"/lib/cmake/axlewire/*.cmake
rm "$out"/lib/{pkgconfig,cmake/axlewire}/*.bak
