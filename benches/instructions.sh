#!/usr/bin/env bash
# Instructions per frame or CRC, counted by valgrind on x86-64 with AVX2, whatever else runs:
#
#   bash benches/instructions.sh > benches/instructions.txt
#   bash benches/instructions.sh --check    fails if one is more than 3 % above the recorded one
#
# `c_...` counts are of the C reference, and vary with its compiler.
set -euo pipefail
shopt -s inherit_errexit
cd "$(dirname "$0")/.."
cargo build --quiet --profile bench -p axlewire-contenders --bin instructions
program=${CARGO_TARGET_DIR:-target}/release/instructions
scratch=$(mktemp -d)
trap 'rm -r "$scratch"' EXIT

# Instructions of the whole program with this many rounds of one kind.
count() {
    valgrind --tool=callgrind --callgrind-out-file="$scratch/out" "$program" "$1" "$2" 2>"$scratch/log" ||
        { cat "$scratch/log" >&2; return 1; }
    awk '$1 == "summary:" || $1 == "totals:" { print $2; exit }' "$scratch/out"
}

measure() {
    local kinds
    kinds=$("$program" list)
    echo "# Instructions per frame or CRC; x86-64, $(rustc --version | cut -d' ' -f1-2). By: bash benches/instructions.sh"
    while read -r name frames; do
        # The second round adds only the work itself.
        once=$(count "$name" 1)
        twice=$(count "$name" 2)
        awk -v name="$name" -v frames="$frames" -v more=$((twice - once)) \
            'BEGIN { printf "%s %.1f\n", name, more / frames; exit more <= 0 }'
    done <<<"$kinds"
}

# Prints those of ours that grew.
grown() {
    awk 'NR == FNR { recorded[$1] = $2; next }
        !/^(#|c_)/ && $2 > 1.03 * recorded[$1] { print $1 " grew from " recorded[$1] " to " $2; bad = 1 }
        END { exit bad }' benches/instructions.txt -
}

case ${1:-} in
--check) measure | grown ;;
*) measure ;;
esac
