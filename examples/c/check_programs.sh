#!/usr/bin/env bash
# Builds the programs with gcc and clang in every standard, and runs them on simulated motors and
# rovers: plain, with sanitizers, and under valgrind. Needs cmake and pkg-config, too.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
target=${CARGO_TARGET_DIR:-$here/../../target}
work=$(mktemp -d)
simulator=
trap 'kill $simulator 2>/dev/null || true; rm -rf "$work"' EXIT
cd "$here/programs"

"$here/build.sh" "$work/out"
cargo build --release --quiet --target-dir "$target" --manifest-path "$here/../axle/Cargo.toml"

strict=(-Wall -Wextra -Wpedantic -Wconversion -Werror -I"$work/out/include" -Iros2/stand_in)
library=("$work/out/lib/libaxlewire.a" -lpthread -ldl -lm)
sanitized=(-g -fsanitize=address,undefined -fno-sanitize-recover=all)

# Builds all programs into a folder: build FOLDER C++ ARGUMENT..
build() {
    local into=$work/$1 std=$2 c cxx; shift 2
    mkdir -p "$into"
    case $into in *clang*) c=clang cxx=clang++ ;; *) c=gcc cxx=g++ ;; esac
    for program in rover_host classes; do
        $cxx -std=c++"$std" -fno-exceptions -fno-rtti "${strict[@]}" "$@" $program.cpp \
            "${library[@]}" -o "$into/$program"
    done
    $cxx -std=c++"$std" "${strict[@]}" "$@" ros2/*.cpp "${library[@]}" -o "$into/run_component"
    for of_c in 99 11 17; do
        $c -std=c$of_c "${strict[@]}" "$@" bus_master.c "${library[@]}" -o "$into/bus_master"
    done
}

# Starts a simulator on $work/line: simulate ARGUMENT..
simulate() {
    "$target/release/axle" sim "$@" --link "$work/line" >"$work/simulator.log" 2>&1 &
    simulator=$!
    until [ -e "$work/line" ]; do kill -0 "$simulator"; sleep 0.05; done
}

finish() {
    kill "$simulator" 2>/dev/null || true
    wait "$simulator" || true
    simulator=
    rm -f "$work/line"
}

# Runs all programs of a folder: run FOLDER [WRAPPER..]
run() {
    local from=$work/$1; shift
    echo "== ${from##*/} $*"
    "$@" "$from/classes"
    simulate ikeya --node 1:velocity --node 6:position
    "$@" "$from/bus_master" "$work/line" 1 1.5 | tail -1
    "$@" "$from/run_component" "$work/line" 1 | tail -1
    ! "$@" "$from/bus_master" "$work/line" 6 1.5 >"$work/log" 2>&1
    grep -q "node 6: node is in the other mode" "$work/log"
    finish
    simulate ucp
    "$@" "$from/rover_host" "$work/line" | tail -1
    finish
}

# A line that goes away while the motor turns: must_fail PROGRAM WORDS ARGUMENT..
must_fail() {
    local program=$1 words=$2; shift 2
    (sleep 1; kill "$simulator") &
    ! "$work/gcc-17/$program" "$work/line" "$@" >"$work/log" 2>&1
    grep -q "$words" "$work/log"
    finish
}

for compiler in gcc clang; do
    for std in 17 20 2b; do build $compiler-$std $std; done
    build $compiler-sanitized 17 "${sanitized[@]}"
    run $compiler-17
    run $compiler-sanitized
done
run clang-17 valgrind --quiet --error-exitcode=9 --leak-check=full \
    --suppressions="$here/programs/valgrind.supp"

echo "== the line goes away"
simulate ikeya --node 1:velocity
must_fail bus_master "node 1 may be moving" 1 1.5
simulate ikeya --node 1:velocity
must_fail run_component "the joint may be moving" 1
simulate ucp
must_fail rover_host "the rover may be moving"

echo "== cmake and pkg-config"
cmake -S . -B "$work/found" -DCMAKE_PREFIX_PATH="$work/out" >"$work/log"
cmake --build "$work/found" >"$work/log"
cmake -S . -B "$work/fetched" -DFETCH=ON >"$work/log"
cmake --build "$work/fetched" >"$work/log"
"$work/found/classes" && "$work/fetched/classes"
flags=$(PKG_CONFIG_PATH=$work/out/lib/pkgconfig pkg-config --cflags --libs axlewire)
# Split into words on purpose.
gcc bus_master.c $flags -o "$work/by-pkg-config"
echo "all programs do what they say"
