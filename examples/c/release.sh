#!/usr/bin/env bash
# Makes a zip of the library for firmware, for people without Rust, and one that Arduino and
# PlatformIO take as a library: release.sh OUT.zip [ARDUINO.zip]
#
# A folder per core with libaxlewire.a, the header, the node for an STM32F405, licences, checksums.
# Each library is `no_std` and optimized for size; a panic, which nothing can cause, would stop the
# processor. CORES="thumbv7em-none-eabihf" builds for one core alone.
set -euo pipefail
out=$(realpath -m "${1:?"where to? release.sh OUT.zip [ARDUINO.zip]"}")
arduino=${2:+$(realpath -m "$2")}
cd "$(dirname "$0")/../.."
# Cortex-M0, M3, M4F and M7, M33, RISC-V.
cores=${CORES:-thumbv6m-none-eabi thumbv7m-none-eabi thumbv7em-none-eabihf thumbv8m.main-none-eabihf
    riscv32imc-unknown-none-elf}
version=$(cargo pkgid --manifest-path examples/c/Cargo.toml)
name=axlewire-${version##*@}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/$name"
# Where a build looks for a library: by the name of the processor and the kind of its FPU.
places() {
    case $1 in
    thumbv6m-*) echo cortex-m0 cortex-m0plus ;;
    # Its code runs on the larger ones, too, where numbers are passed as without an FPU.
    thumbv7m-*) echo cortex-m3 cortex-m4/fpv4-sp-d16-softfp \
        {cortex-m7,cortex-m33}/fpv5-{sp-,}d16-softfp ;;
    thumbv7em-*) echo {cortex-m4,cortex-m7}{,/fpv4-sp-d16-hard} \
        {cortex-m7,imxrt1062}/fpv5-{sp-,}d16-hard ;;
    thumbv8m*) echo cortex-m33{,/fpv4-sp-d16-hard,/fpv5-sp-d16-hard} ;;
    riscv*) echo esp32c3 ;;
    esac
}
for core in $cores; do
    bash .ci/cross "$core" rustc --quiet --profile firmware -p axlewire-c \
        --no-default-features --crate-type staticlib
    # The newest: it may have been built with and without rustup's target.
    built=$(ls -t "${CARGO_TARGET_DIR:-target}"/{.,cross}/"$core"/firmware/libaxlewire_c.a \
        2>/dev/null | head -1) || [ -n "$built" ]
    mkdir -p "$work/$name/lib/$core"
    cp "$built" "$work/$name/lib/$core/libaxlewire.a"
    for place in $(places "$core"); do
        install -D -m 644 "$built" "$work/axlewire/src/$place/libaxlewire.a"
    done
done
cp -r examples/c/arduino/* LICENSE-* "$work/axlewire"
cp examples/c/include/axlewire.{h,hpp} "$work/axlewire/src"
sed -i "s/^version=.*/version=${version##*@}/" "$work/axlewire/library.properties"
cp -r examples/c/{include,firmware,README.md} LICENSE-* "$work/$name"
rm -r "$work/$name/firmware/twin"
mkdir "$work/$name/doc"
cp src/safety.md src/guide/{ikeya,ucp}.md "$work/$name/doc"
install -D -m 644 -t "$work/$name/examples/captures" examples/captures/*.bin
# Links to items of the Rust crate lead nowhere here.
sed -i -E 's#\[([^]]+)\]\((crate|super)[^)]*\)#\1#g; s#\[(`[^`]+`)\]([^(]|$)#\1\2#g; /^\[.*\]: (crate|super)/d' "$work/$name"/doc/*
# The README without what takes the repository; the same pages, where they are in the zip.
awk 'BEGIN{on = 1} /^## /{on = /Firmware/} on' "$work/$name/README.md" >"$work/README.md"
mv "$work/README.md" "$work/$name"
there=$(sed -n 's/^repository = "\([^"]*\)".*/\1/p' Cargo.toml)/blob/v${version##*@}
sed -i -E "s#\.\./\.\./src/(guide/)?(\w+\.md)#doc/\2#; s#\]\(\.\./\.\./#]($there/#g
    s#\]\((programs|arduino|tests|firmware/twin)/#]($there/examples/c/\1/#g
    s#examples/c/firmware/run.sh target/release/axle#firmware/run.sh axle#; s#\`rustup target add thumb[^,]*, ##
    s# On Debian and Ubuntu it installs.*##; s#\`(examples/c/release|tests/platformio/run).sh[^\`]*\`#& of the repository#" "$work/$name/README.md"
cp -r "$work/$name/doc" "$work/axlewire/extras"
cd "$work"
(cd "$name" && find . -type f ! -name SHA256SUMS -exec sha256sum {} + | sort -k2 >SHA256SUMS)
python3 -m zipfile -c "$out" "$name"
[ -z "$arduino" ] || python3 -m zipfile -c "$arduino" axlewire
echo "$out $arduino"
