#!/usr/bin/env bash
# Instructions per frame, counted by valgrind: figures that do not depend on machine load.
#
#   bash benches/instructions.sh            count and print, `name instructions`
#   bash benches/instructions.sh --record   the same, into benches/instructions.txt
#   bash benches/instructions.sh --check    fail when a count is more than 3 % over the recorded one
#
# `c_...` counts are of the C reference: recorded for comparison, not checked.
set -euo pipefail
cd "$(dirname "$0")/.."
record=benches/instructions.txt

if ! command -v valgrind >/dev/null; then
    echo "instructions: skipped, valgrind is missing"
    exit
fi
if [ "$(uname -m)" != x86_64 ]; then
    echo "instructions: skipped, the recorded counts are for x86-64"
    exit
fi

cargo build --quiet --profile bench -p axlewire-benches --bin instructions
program=${CARGO_TARGET_DIR:-target}/release/instructions
scratch=$(mktemp -d)
trap 'rm -r "$scratch"' EXIT

# Instructions of the whole program with this many rounds of one kind.
count() {
    valgrind --tool=callgrind --callgrind-out-file="$scratch/out" "$program" "$1" "$2" 2>"$scratch/log" ||
        { cat "$scratch/log" >&2; return 1; }
    awk '$1 == "summary:" || $1 == "totals:" { print $2; exit }' "$scratch/out"
}

# The second round adds only the work itself.
measure() {
    local name frames once twice
    while read -r name frames; do
        # Without AVX2 this is another program.
        [[ $name != *_simd ]] || grep -qw avx2 /proc/cpuinfo || continue
        once=$(count "$name" 1)
        twice=$(count "$name" 2)
        awk -v name="$name" -v frames="$frames" -v once="$once" -v twice="$twice" \
            'BEGIN { printf "%s %.1f\n", name, (twice - once) / frames }'
    done < <("$program" list)
}

case ${1:-} in
'') measure ;;
--record)
    measure >"$scratch/counts"
    {
        echo "# Instructions per frame or CRC; x86-64, $(rustc --version | cut -d' ' -f1-2). By: bash benches/instructions.sh --record"
        cat "$scratch/counts"
    } >"$record"
    cat "$record"
    ;;
--check)
    measure >"$scratch/counts"
    awk '
        /^#/ { next }
        NR == FNR { recorded[$1] = $2; next }
        $2 !~ /^[0-9.]+$/ || $2 <= 0 { print $1 ": not counted"; bad = 1 }
        { counted[$1] = $2; print $1, $2, "recorded", ($1 in recorded) ? recorded[$1] : "nothing" }
        END {
            for (name in counted) if (!(name in recorded)) { print name ": not recorded"; bad = 1 }
            for (name in recorded) if (!(name in counted) && name !~ /_simd$/) { print name ": recorded, but not counted"; bad = 1 }
            for (name in counted) if (name !~ /^c_/ && (name in recorded) && counted[name] > 1.03 * recorded[name]) {
                print name ": more than 3 % over the recorded count"; bad = 1
            }
            exit bad
        }' "$record" "$scratch/counts"
    ;;
*)
    sed -n '2,8s/^# \{0,1\}//p' "$0" >&2
    exit 2
    ;;
esac
