#!/usr/bin/env bash
# Runs the proof of this package: the header, the tests beside Rust, every recorded frame in C, the
# programs by gcc and clang on simulated lines, and the node in QEMU. Some three minutes when built.
#
# Needs cbindgen, gcc, clang, valgrind, cppcheck, doxygen, cmake, pkg-config, python3, QEMU and, if it
# is there, arm-none-eabi-gcc.
set -euo pipefail
cd "$(dirname "$0")"
target=${CARGO_TARGET_DIR:-$PWD/../../target}
./header.sh --check
cargo test --quiet -p axlewire-c
./check_vectors.sh
cppcheck --quiet --error-exitcode=1 --enable=warning,performance,portability \
    -Iinclude programs firmware tests/vectors.c
(cat <<'END'
INPUT = include/axlewire.h
GENERATE_LATEX = NO
GENERATE_HTML = NO
GENERATE_XML = YES
QUIET = YES
WARN_AS_ERROR = FAIL_ON_WARNINGS
END
echo "OUTPUT_DIRECTORY = $target/doxygen") | doxygen -
./check_programs.sh
cargo build --quiet --release -p axlewire-cli
echo "== a node in QEMU"
./firmware/run.sh "$target/release/axle" spin -p PORT --node 1 --rps 2 --for 2 | tee "$target/c-node.log"
grep -q '2.00 rps$' "$target/c-node.log"
grep -q 'stopped and confirmed' "$target/c-node.log"
echo "== the same node in C and in Rust: bytes of flash, instructions from a READ to its answer"
cost() {
    local image flash
    image=$(TWIN=$1 ./firmware/run.sh --build) || return
    flash=$(size "$image" | awk 'NR == 2 { print $1 + $2 }')
    echo "$flash $(../firmware/response.sh ikeya_slave "$image" | cut -d" " -f2)"
}
of_c=$(cost "")
of_rust=$(cost yes)
read -r c_flash c_steps <<<"$of_c"
read -r flash steps <<<"$of_rust"
echo "C $c_flash $c_steps, Rust $flash $steps"
# The border is not free, but may not grow: 1.39 and 1.7 times as much.
if [ $((c_flash * 100)) -gt $((flash * 140)) ] || [ "$c_steps" -gt $((steps * 2)) ]; then
    echo "the border has grown" >&2
    exit 1
fi
if command -v arm-none-eabi-gcc >/dev/null; then
    CC=arm-none-eabi-gcc ./firmware/run.sh --build
    ./tests/platformio/run.sh
fi
