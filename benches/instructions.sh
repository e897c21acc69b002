#!/usr/bin/env bash
# Instructions per frame or CRC, counted by valgrind on x86-64 with AVX2, whatever else runs:
#
#   bash benches/instructions.sh > benches/instructions.txt
#
# `c_...` counts are of the C reference, and vary with its compiler.
set -euo pipefail
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

echo "# Instructions per frame or CRC; x86-64, $(rustc --version | cut -d' ' -f1-2). By: bash benches/instructions.sh"
"$program" list >"$scratch/list"
while read -r name frames; do
    # The second round adds only the work itself.
    once=$(count "$name" 1)
    twice=$(count "$name" 2)
    awk -v name="$name" -v frames="$frames" -v more=$((twice - once)) \
        'BEGIN { printf "%s %.1f\n", name, more / frames; exit more <= 0 }'
done <"$scratch/list"
