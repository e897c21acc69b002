#!/usr/bin/env bash
# Cost of axlewire on a Cortex-M4: builds for thumbv7em, runs in QEMU, prints `name value goal`.
#
#   examples/firmware/bench.sh > examples/firmware/figures.txt
#
# Instructions first, then flash in bytes; `-` means no goal. Fails if a figure exceeds its goal.
set -euo pipefail
# A failed measurement ends the script, even in a substitution.
shopt -s inherit_errexit
cd "$(dirname "$0")"
. ./toolchain.sh
command -v readelf >/dev/null || need binutils
roles=(master slave host robot)
"${cargo[@]}" --quiet --locked --release --bins
"${cargo[@]}" --quiet --locked --profile fast $(printf -- '--bin size_%s ' empty crc both "${roles[@]}")

# name program sections goal: size of the program beyond the empty one.
over_empty() {
    echo "$1 $(($(bytes "$out/$target/$2" "$3") - $(bytes "$out/$target/${2%/*}/size_empty" "$3"))) $4"
}
flash='\\.text|\\.rodata|\\.data'

figures=$(
    echo "# $compiler"
    bench_in_qemu "$out/$target/release/bench"
    over_empty flash_crc release/size_crc "$flash" 350
    over_empty flash_ikeya8_slice release/size_ikeya8 "$flash" 230
    over_empty flash_ucp44_slice release/size_ucp44 "$flash" 370
    over_empty flash_both_slices release/size_both "$flash" 600
    # 10 % more than before stops were repeated until a motor is still: 8316 bytes.
    over_empty flash_master release/size_master "$flash" 9148
    for role in slave host robot; do over_empty "flash_$role" "release/size_$role" "$flash" -; done
    # All constants together, so that no table goes unnoticed.
    for part in crc both "${roles[@]}"; do
        over_empty "constants_${part}_opt3" "fast/size_$part" '\\.rodata' 64
    done
)
echo "$figures"
awk '!/^#/ && ($3 != "-" && $2 > $3 || $2 < 0) { print $1 " exceeds its goal" > "/dev/stderr"; bad = 1 } END { exit bad }' <<<"$figures"
