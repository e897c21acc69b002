#!/usr/bin/env bash
# Checks the firmware in QEMU: prints one line per result, the costs, then `N passed, N failed`.
#
#   examples/firmware/check.sh
#
# Exit status 1 if a check failed. QEMU and a compiler for thumbv7em come from Debian if they are
# missing. Takes about 45 s once everything is built.
set -uo pipefail
cd "$(dirname "$0")" || exit
programs=(ikeya_slave ikeya_master ucp_robot)
# 50 µs at 168 MHz and 1.5 cycles per instruction (ruling I9).
budget=5600
# Limit of the benchmark's stack, bytes.
stack_of_bench=3072

passed=0 failed=0
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
trap 'exit 130' INT TERM

# check NAME COMMAND ...: the last line printed by the command is its result.
check() {
    local name=$1 begun=$SECONDS status=passed
    shift
    if "$@" >"$folder/out" 2>"$folder/err"; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1)) status=FAILED
    fi
    printf '%-7s%-42s%4d s  %s\n' "$status" "$name" $((SECONDS - begun)) "$(tail -1 "$folder/out")"
    [ $status = passed ] || sed 's/^/    /' "$folder/err"
}

build() { ./run.sh --build "${programs[@]}" uart_check bench >"$folder/images" && [ "$(wc -l <"$folder/images")" = $((${#programs[@]} + 2)) ]; }
image() { grep "/$1\$" "$folder/images"; }

# Also fails if the tests were compiled out. They mostly wait, so more run than there are cores.
end_to_end() {
    local images
    images=$(dirname "$(image ikeya_slave)")
    # From the top, where cargo is not configured to build for a board.
    (
        cd ../.. && AXLEWIRE_FIRMWARE=required AXLEWIRE_FIRMWARE_IMAGES=$images \
            cargo test --quiet --test firmware -- --nocapture --test-threads=4
    ) >"$folder/tests" 2>&1
    local status=$?
    [ $status = 0 ] || cat "$folder/tests" >&2
    grep -o '[0-9]* passed' "$folder/tests"
    [ $status = 0 ] && grep -q '[1-9][0-9]* passed' "$folder/tests"
}

# The largest value of any test; each test compares it with its limit.
stack() {
    grep -o "stack $1 [0-9]*" "$folder/tests" | sort -n -k3 | tail -1 | cut -d' ' -f3 | tee "$folder/stack_$1" | grep . ||
        { echo "no test reported it" >&2; false; }
}

# The stack of the benchmark, which has no test: it prints the value itself and is checked here.
stack_of_bench() {
    timeout 120 qemu-system-arm -M netduinoplus2 -nographic -icount shift=0 \
        -semihosting-config enable=on,target=native -kernel "$(image bench)" </dev/null >"$folder/bench" || return
    awk '$1 == "stack" { print $2 }' "$folder/bench" | tee "$folder/stack_bench" | grep '^[1-9]' &&
        [ "$(cat "$folder/stack_bench")" -le "$stack_of_bench" ]
}

no_panic() { ./no_panic.sh "$1" && echo "none is reachable"; }
planted() { ./no_panic.sh --self-test && echo found; }

# response PROGRAM
response() {
    local median
    ./response.sh "$1" >"$folder/response_$1" || return
    median=$(cut -d' ' -f2 "$folder/response_$1")
    echo "$median instructions, $(micros "$median") µs"
    [ "$median" -ge 1 ] && [ "$median" -le "$budget" ]
}

micros() { awk -v n="$1" 'BEGIN { printf "%.1f", n * 1.5 / 168 }'; }

. ./sections.sh

figures() {
    local program median
    echo '| program | flash | static RAM | stack | last byte of a request to first of the answer |'
    echo '|---|---|---|---|---|'
    for program in "${programs[@]}" bench; do
        read -r _ median _ 2>/dev/null <"$folder/response_$program" || median=
        echo "| \`$program\` | $(bytes "$(image "$program")" '\\.vector_table|\\.text|\\.rodata|\\.data')" \
            "| $(bytes "$(image "$program")" '\\.data|\\.bss|\\.uninit') | $(cat "$folder/stack_$program")" \
            "| $([ -n "$median" ] && echo "$median instructions, $(micros "$median") µs" || echo -) |"
    done
}

check "images" build
check "end to end" end_to_end
for program in "${programs[@]}"; do check "stack of $program" stack "$program"; done
check "stack of bench" stack_of_bench
for program in ikeya_slave ucp_robot; do check "response of $program, within 50 us" response "$program"; done
for program in "${programs[@]}"; do check "no panic in $program" no_panic "$program"; done
check "no panic in the crate" no_panic no_panic
check "a planted panic" planted
echo
figures
echo
echo "$passed passed, $failed failed"
[ $failed = 0 ]
