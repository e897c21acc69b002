#!/usr/bin/env bash
# Builds the programs with gcc and clang in every standard, and runs them on simulated motors and
# rovers: plain, with sanitizers, and under valgrind. Needs cmake and pkg-config, too.
set -Eeuo pipefail
here=$(cd "$(dirname "$0")" && pwd)
target=${CARGO_TARGET_DIR:-$here/../../target}
work=$(mktemp -d)
simulator=
trap 'echo "line $LINENO failed" >&2' ERR
trap 'kill $simulator 2>/dev/null || true; rm -rf "$work"' EXIT
cd "$here/programs"

"$here/build.sh" "$work/out"
cargo build --release --quiet --target-dir "$target" --manifest-path "$here/../axle/Cargo.toml"

strict=(-Wall -Wextra -Wpedantic -Wconversion -Werror -I"$work/out/include" -Iros2/stand_in)
library=("$work/out/lib/libaxlewire.a" -lpthread -ldl -lm)
sanitized=(-g -fsanitize=address,undefined -fno-sanitize-recover=all)

# Builds all programs into a folder: build FOLDER COMPILER C C++ ARGUMENT..
build() {
    local into=$work/$1 c=$2 of_c=$3 of_cxx=$4; shift 4
    local cxx=g++
    [ "$c" = gcc ] || cxx=clang++
    mkdir -p "$into"
    $c -std=c"$of_c" "${strict[@]}" "$@" bus_master.c "${library[@]}" -o "$into/bus_master"
    $c -std=c"$of_c" "${strict[@]}" "$@" usual.c "${library[@]}" -o "$into/usual"
    for program in bus_host rover_host classes; do
        $cxx -std=c++"$of_cxx" -fno-exceptions -fno-rtti "${strict[@]}" "$@" $program.cpp \
            "${library[@]}" -o "$into/$program"
    done
    $cxx -std=c++"$of_cxx" "${strict[@]}" "$@" ros2/*.cpp "${library[@]}" -o "$into/run_component"
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

# Fails, and says these words: must_fail WORDS COMMAND..
must_fail() {
    local words=$1; shift
    if "$@" >"$work/log" 2>&1 || ! grep -q "$words" "$work/log"; then
        cat "$work/log"
        echo "does not fail with: $words" >&2
        exit 1
    fi
}

# Runs all programs of a folder: run FOLDER [WRAPPER..]
run() {
    local from=$work/$1; shift
    echo "== ${from##*/} $*"
    "$@" "$from/classes"
    [ $# -gt 0 ] || "$from/usual" >"$work/log"
    simulate ikeya --node 1:velocity --node 6:position
    "$@" "$from/bus_master" "$work/line" 1 1.5 | tail -1
    "$@" "$from/bus_host" "$work/line" 1 6 | tail -1
    must_fail "node is in the other mode" "$@" "$from/bus_host" "$work/line" 6 1
    "$@" "$from/run_component" "$work/line" 1 | tail -1
    must_fail "node 6: node is in the other mode" "$@" "$from/bus_master" "$work/line" 6 1.5
    finish
    simulate ucp
    "$@" "$from/rover_host" "$work/line" | tail -1
    finish
}

# Waits until the simulator tells this.
await() {
    for _ in {1..100}; do
        if grep -Eq "$1" "$work/simulator.log"; then return; fi
        sleep 0.1
    done
    echo "the simulator does not tell: $1" >&2
    return 1
}

# The line goes away while it moves: must_notice WORDS PROGRAM ARGUMENT..
must_notice() {
    local words=$1 program=$2; shift 2
    (await "turning|moving"; kill "$simulator") &
    must_fail "$words" "$work/gcc/$program" "$work/line" "$@"
    finish
}

for compiler in gcc clang; do
    build $compiler $compiler 99 17
    build newer $compiler 11 20
    build newest $compiler 17 2b -O2
    run $compiler
done
build sanitized gcc 99 17 "${sanitized[@]}"
run sanitized
run clang valgrind --quiet --error-exitcode=9 --leak-check=full \
    --suppressions="$here/programs/valgrind.supp"

echo "== a port in use, bad settings, signals, endless times"
g++ -std=c++17 "${strict[@]}" "${sanitized[@]}" "$here/tests/port.cpp" "${library[@]}" -o "$work/port"
simulate ikeya --node 1:velocity
"$work/port" "$work/line"
finish

echo "== the line goes away"
simulate ikeya --node 1:velocity
must_notice "node 1 may be moving" bus_master 1 1.5
simulate ikeya --node 1:velocity
must_notice "the joint may be moving" run_component 1
simulate ikeya --node 1:velocity --node 6:position
must_notice "a motor may be moving" bus_host 1 6
simulate ucp
must_notice "the rover may be moving" rover_host

echo "== a bus or a rover ends while it moves: it is stopped"
cat >"$work/leave.cpp" <<'END'
#include <axlewire_linux.hpp>
int main(int, char **argv) {
    const std::chrono::milliseconds second{1000};
#ifdef ROVER
    const std::chrono::milliseconds before_dead_man{300};
    axle::SerialRover rover{argv[1]};
    if (rover.run_for(second) || !rover.drive(20, 0) || rover.run_for(before_dead_man)) return 1;
#else
    axle::SerialBus bus{argv[1]};
    if (bus.discover() || !bus.set_velocity(1, 2.0f) || bus.run_for(second)) return 1;
#endif
    return 0;
}
END
g++ -std=c++17 "${strict[@]}" "${sanitized[@]}" "$work/leave.cpp" "${library[@]}" -o "$work/leave"
simulate ikeya --node 1:velocity
"$work/leave" "$work/line"
await "command 0.00 rps"
await "at rest at [1-9]"
finish
g++ -std=c++17 "${strict[@]}" -DROVER "$work/leave.cpp" "${library[@]}" -o "$work/leave"
simulate ucp
"$work/leave" "$work/line"
await "at rest after"
# The first command is a stop, too. One by the watchdog would be none.
[ "$(grep -c "command: speed 0" "$work/simulator.log")" = 2 ]
finish

echo "== cmake and pkg-config"
cmake -S . -B "$work/found" -DCMAKE_PREFIX_PATH="$work/out" >"$work/log"
cmake --build "$work/found" >"$work/log"
cmake -S . -B "$work/fetched" -DFETCH=ON >"$work/log"
cmake --build "$work/fetched" >"$work/log"
"$work/found/classes" && "$work/fetched/classes"
flags=$(PKG_CONFIG_PATH=$work/out/lib/pkgconfig pkg-config --cflags --libs axlewire)
# Split into words on purpose.
gcc bus_master.c $flags -o "$work/by-pkg-config"
if command -v cargo-cinstall >/dev/null; then
    cargo cinstall --release -p axlewire-c --target-dir "$target/capi" --prefix "$work/shared" \
        --libdir lib >"$work/log" 2>&1
    flags=$(PKG_CONFIG_PATH=$work/shared/lib/pkgconfig pkg-config --cflags --libs axlewire)
    gcc usual.c $flags -o "$work/by-cargo-c"
    LD_LIBRARY_PATH=$work/shared/lib "$work/by-cargo-c" >"$work/log"
    nm -D "$work/by-cargo-c" | grep 'axle_crc16@libaxlewire.so.0.1' >/dev/null
fi
echo "all programs do what they say"
