#!/usr/bin/env bash
# Runs every recorded frame through a program in C: by gcc and clang with their sanitizers, and
# under valgrind.
#
# Needs gcc, clang, valgrind and python3.
set -euo pipefail
cd "$(dirname "$0")"
target=${CARGO_TARGET_DIR:-$PWD/../../target}
out=$(mktemp -d)
trap 'rm -r "$out"' EXIT
cargo build --quiet --package axlewire-c
python3 tests/vectors.py >"$out/vectors.inc"
build() {
    local compiler=$1 program=$2
    shift 2
    "$compiler" -std=c99 -gdwarf-4 -O1 -Wall -Wextra -Wpedantic -Wconversion -Werror "$@" \
        -Iinclude -I"$out" tests/vectors.c "$target/debug/libaxlewire_c.a" -lpthread -ldl -lm \
        -o "$out/$program"
}
for compiler in gcc clang; do
    build "$compiler" sanitized -fsanitize=address,undefined -fno-sanitize-recover=all
    echo "$compiler, sanitizers: $("$out/sanitized")"
    build "$compiler" plain
    echo "$compiler, valgrind: $(valgrind --quiet --leak-check=full --error-exitcode=1 "$out/plain")"
done
