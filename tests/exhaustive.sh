#!/usr/bin/env bash
# Runs the proofs of tests/exhaustive.rs one after another and prints how long each took.
#
#   bash tests/exhaustive.sh                    all
#   bash tests/exhaustive.sh reads checksum     those with one of these words in their names
#
# Uses all cores.
set -euo pipefail
cd "$(dirname "$0")/.."
proofs=(cargo test --release --quiet -p axlewire --test exhaustive --)
TIMEFORMAT='%R s, %U s of processor time'

all=$("${proofs[@]}" --list --ignored | sed -n 's/: test$//p')
names=
for word in "${@:-::}"; do
    found=$(grep -F -- "$word" <<<"$all") || { echo "no proof has $word in its name; there are"; echo "$all"; exit 1; }
    names+=$found$'\n'
done
names=$(sort -u <<<"$names")
said=$(mktemp)
trap 'rm "$said"' EXIT
for name in $names; do
    echo "== $name"
    # A run of nothing would also be a success: the result says that it was one.
    time "${proofs[@]}" --ignored --exact "$name" --nocapture &>"$said" &&
        grep -q '^test result: ok. 1 passed' "$said" || { cat "$said"; exit 1; }
    sed '/^$/d; /^\.$/d; /^running /d; /^test result: /d; / has been running /d; s/^\.  /   /' "$said"
done
