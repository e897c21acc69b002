#!/usr/bin/env bash
# Cost of axlewire on a Cortex-M4: builds for thumbv7em, runs in QEMU, prints `name value goal`.
#
#   examples/firmware/bench.sh            prints the figures
#   examples/firmware/bench.sh --check    also compares them with figures.txt: fails above +3 %,
#                                         above a goal, and if nothing is measured
#   examples/firmware/bench.sh --record   writes figures.txt
#
# Instructions first, then flash in bytes; `-` means no goal. Uses the rustup target if it is
# installed, otherwise Debian's compiler; QEMU and lld come from Debian if they are missing.
set -euo pipefail
# A failed measurement ends the script, even in a substitution.
shopt -s inherit_errexit
cd "$(dirname "$0")"
mode=${1:-}
case $mode in '' | --check | --record) ;; *) sed -n '2,7s/^# \?//p' "$0" >&2; exit 2 ;; esac

. ./toolchain.sh
command -v readelf >/dev/null || need binutils
"${cargo[@]}" --quiet --locked --release --bins
fast=(--bin size_empty --bin size_crc --bin size_both)
for role in master slave host robot; do fast+=(--bin "size_$role"); done
"${cargo[@]}" --quiet --locked --profile fast "${fast[@]}"

. ./sections.sh

# name program sections goal: size of the program beyond the empty one.
over_empty() {
    local image=$out/$target/$2
    echo "$1 $(($(bytes "$image" "$3") - $(bytes "${image%/*}/size_empty" "$3"))) $4"
}

figures=$(
    timeout 120 qemu-system-arm -M netduinoplus2 -nographic -icount shift=0 \
        -semihosting-config enable=on,target=native -kernel "$out/$target/release/bench" </dev/null
    flash='\\.text|\\.rodata|\\.data'
    over_empty flash_crc release/size_crc "$flash" 350
    over_empty flash_ikeya8_slice release/size_ikeya8 "$flash" 230
    over_empty flash_ucp44_slice release/size_ucp44 "$flash" 370
    over_empty flash_both_slices release/size_both "$flash" 600
    # The goal allows a fifth for owed stops on top of the previous size, 6964 bytes.
    over_empty flash_master release/size_master "$flash" 8356
    for role in slave host robot; do
        over_empty "flash_$role" "release/size_$role" "$flash" -
    done
    # All constants together, so that no table goes unnoticed.
    over_empty constants_crc_opt3 fast/size_crc '\\.rodata' 64
    over_empty constants_both_opt3 fast/size_both '\\.rodata' 64
    for role in master slave host robot; do
        over_empty "constants_${role}_opt3" "fast/size_$role" '\\.rodata' 64
    done
)
echo "# $compiler"
echo "$figures"
if grep -vE '^[a-z0-9_]+ [0-9]+ ([0-9]+|-)$' <<<"$figures"; then
    echo "invalid figure" >&2
    exit 1
fi

case $mode in
--record)
    { echo "# $compiler"; echo "$figures"; } >figures.txt
    ;;
--check)
    [ "$(head -1 figures.txt)" = "# $compiler" ] || echo "recorded with another compiler: $(head -1 figures.txt)"
    awk '
        /^#/ { next }
        NR == FNR { recorded[$1] = $2; next }
        !($1 in recorded) { print "not recorded: " $1; bad = 1; next }
        { seen[$1] = 1 }
        # Constants may be 0.
        $2 == 0 && recorded[$1] > 0 { print $1 " was not measured: " $2; bad = 1; next }
        $3 != "-" && $2 > $3 { print $1 " is " $2 ", but its goal is " $3; bad = 1 }
        $2 > recorded[$1] * 1.03 { print $1 " grew from " recorded[$1] " to " $2; bad = 1 }
        END {
            for (name in recorded) if (!(name in seen)) { print "not measured: " name; bad = 1 }
            exit bad
        }
    ' figures.txt <(echo "$figures")
    # The documents must show the recorded figures.
    recorded() { sed -n "s/^$1 \([0-9]*\) .*/\1/p" figures.txt; }
    for role in Master Slave Host Robot; do
        row="| $(recorded "flash_${role,,}") |.*| $(recorded "ram_${role,,}") |"
        grep -q "$row" <(grep -F "| \`$role\`" ../../BENCHMARKS.md) ||
            { echo "BENCHMARKS.md: the row of $role does not match $row" >&2; exit 1; }
    done
    grep -qF "READ to its answer | $(recorded read_to_answer) |" ../../BENCHMARKS.md
    grep -qF "needs $(recorded read_to_answer) instructions" ../../README.md
    ;;
esac
