#!/usr/bin/env bash
# Instructions per frame, counted by valgrind: figures that do not depend on machine load.
#
#   bash benches/instructions.sh            count and print, `name instructions`
#   bash benches/instructions.sh --record   the same, into benches/instructions.txt
#   bash benches/instructions.sh --check    compare with the recorded ones, by .ci/judge.py
#
# `c_...` counts are of the C reference, and may vary with its compiler. Exit status 77 if this
# machine cannot count.
set -euo pipefail
# A failed count ends the script, even in a substitution.
shopt -s inherit_errexit
cd "$(dirname "$0")/.."
record=benches/instructions.txt
mode=${1:-}
case $mode in '' | --check | --record) ;; *) sed -n '2,9s/^# \{0,1\}//p' "$0" >&2; exit 2 ;; esac

skipped() {
    echo "SKIPPED: no instruction was counted: $1" >&2
    exit 77
}
[ "$(uname -sm)" = 'Linux x86_64' ] || skipped "the recorded counts are for Linux on x86-64"
command -v valgrind >/dev/null || skipped "valgrind is missing"

cargo build --quiet --profile bench -p axlewire-benches --bin instructions
program=${CARGO_TARGET_DIR:-target}/release/instructions
scratch=$(mktemp -d)
trap 'rm -r "$scratch"' EXIT

# Instructions of the whole program with this many rounds of one kind.
count() {
    valgrind --tool=callgrind --callgrind-out-file="$scratch/out" "$program" "$1" "$2" 2>"$scratch/log" ||
        { cat "$scratch/log" >&2; return 1; }
    awk '$1 == "summary:" || $1 == "totals:" { print $2; exit }' "$scratch/out" | grep '^[1-9]'
}

# Without AVX2 these are other programs.
judge=(--other c_)
grep -qw avx2 /proc/cpuinfo || {
    judge+=(--without _simd)
    echo "SKIPPED: the counts for AVX2, which this processor does not have" >&2
}

# The second round adds only the work itself.
measure() {
    local name frames once twice
    "$program" list >"$scratch/list"
    while read -r name frames; do
        [[ ${judge[*]} != *_simd || $name != *_simd ]] || continue
        once=$(count "$name" 1)
        twice=$(count "$name" 2)
        awk -v name="$name" -v frames="$frames" -v once="$once" -v twice="$twice" \
            'BEGIN { printf "%s %.1f\n", name, (twice - once) / frames }'
    done <"$scratch/list"
}

{
    echo "# Instructions per frame or CRC; x86-64, $(rustc --version | cut -d' ' -f1-2). By: bash benches/instructions.sh --record"
    measure
} | tee "$scratch/counts"
case $mode in
--record) .ci/judge.py $record "${judge[@]}" --record <"$scratch/counts" ;;
--check) .ci/judge.py $record "${judge[@]}" <"$scratch/counts" ;;
esac
