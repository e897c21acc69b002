#!/usr/bin/env bash
# Makes a zip of the library for firmware, for people without Rust: release.sh OUT.zip
#
# A folder per core with libaxlewire.a, the header, the node for an STM32F405, licences, checksums.
# Each library is `no_std` and optimized for size; a panic, which nothing can cause, would stop the
# processor. CORES="thumbv7em-none-eabihf" builds for one core alone.
set -euo pipefail
out=$(realpath -m "${1:?"where to? release.sh OUT.zip"}")
cd "$(dirname "$0")/../.."
# Cortex-M0, M3, M4F and M7, M33, RISC-V.
cores=${CORES:-thumbv6m-none-eabi thumbv7m-none-eabi thumbv7em-none-eabihf thumbv8m.main-none-eabihf
    riscv32imc-unknown-none-elf}
version=$(cargo pkgid --manifest-path examples/c/Cargo.toml)
name=axlewire-${version##*@}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/$name"
for core in $cores; do
    bash .ci/cross "$core" rustc --quiet --profile firmware -p axlewire-c \
        --no-default-features --crate-type staticlib
    built=$(find "${CARGO_TARGET_DIR:-target}" -path "*$core/firmware/libaxlewire_c.a" | head -1)
    mkdir -p "$work/$name/lib/$core"
    cp "$built" "$work/$name/lib/$core/libaxlewire.a"
done
cp -r examples/c/{include,firmware,README.md} LICENSE-* "$work/$name"
rm -r "$work/$name/firmware/twin"
mkdir "$work/$name/doc"
cp src/safety.md src/guide/{ikeya,ucp}.md "$work/$name/doc"
# The same pages, where they are in the zip; what else is named is in the repository.
sed -i -E 's#\.\./\.\./src/(guide/)?(\w+\.md)#doc/\2#' "$work/$name/README.md"
cd "$work"
(cd "$name" && find . -type f ! -name SHA256SUMS -exec sha256sum {} + | sort -k2 >SHA256SUMS)
python3 -m zipfile -c "$out" "$name"
echo "$out"
