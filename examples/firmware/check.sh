#!/usr/bin/env bash
# Checks the firmware in QEMU: prints one line per result, the costs, then `N passed, N failed`.
#
#   examples/firmware/check.sh             also compares the costs with costs.txt, by .ci/judge.py
#   examples/firmware/check.sh --record    writes costs.txt, unless a check fails
#
# Exit status 1 if a check failed. QEMU and a compiler for thumbv7em come from Debian if they are
# missing. Takes about 45 s once everything is built.
set -uo pipefail
cd "$(dirname "$0")" || exit
programs=(ikeya_slave ikeya_master ucp_robot)
# Instructions from the last byte of a request to the answer, at most. A slave has 50 µs, at 168
# MHz and 1.5 cycles per instruction (ruling I9). A robot sends reports meanwhile; of many runs none
# took more than 2000.
declare -A budget=([ikeya_slave]=5600 [ucp_robot]=2400)
# The benchmark's stack, bytes: a tenth above its use.
stack_of_bench=2304
case ${1:-} in '') record=() ;; --record) record=(--record) ;; *) sed -n '4,5s/^# *//p' "$0" >&2; exit 2 ;; esac

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
    [ "$median" -ge 1 ] && [ "$median" -le "${budget[$1]}" ]
}

micros() { awk -v n="$1" 'BEGIN { printf "%.1f", n * 1.5 / 168 }'; }

. ./sections.sh

# A line per cost, as .ci/judge.py reads them: bytes, and instructions.
costs() {
    local program median
    echo "# In QEMU; by: examples/firmware/check.sh --record"
    for program in "${programs[@]}" bench; do
        echo "flash_$program $(bytes "$(image "$program")" '\\.vector_table|\\.text|\\.rodata|\\.data') -"
        echo "ram_$program $(bytes "$(image "$program")" '\\.data|\\.bss|\\.uninit') -"
        echo "stack_$program $(cat "$folder/stack_$program") -"
        [ -z "${budget[$program]:-}" ] || {
            read -r _ median _ <"$folder/response_$program"
            echo "response_$program $median ${budget[$program]}"
        }
    done
}

# The robot's response depends on what it sends meanwhile: it only has to keep its limit.
costs_are_as_recorded() {
    costs >"$folder/costs"
    ../../.ci/judge.py costs.txt --other response_ucp_robot "${record[@]}" <"$folder/costs" >"$folder/judged" ||
        { cat "$folder/judged" >&2; return 1; }
    tail -1 "$folder/judged"
}

table() {
    local program median
    cost() { sed -n "s/^$1_$program \([0-9]*\) .*/\1/p" "$folder/costs"; }
    echo '| program | flash | static RAM | stack | last byte of a request to first of the answer |'
    echo '|---|---|---|---|---|'
    for program in "${programs[@]}" bench; do
        median=$(cost response)
        echo "| \`$program\` | $(cost flash) | $(cost ram) | $(cost stack)" \
            "| $([ -n "$median" ] && echo "$median instructions, $(micros "$median") µs" || echo -) |"
    done
}

check "images" build
check "end to end" end_to_end
for program in "${programs[@]}"; do check "stack of $program" stack "$program"; done
check "stack of bench" stack_of_bench
for program in "${!budget[@]}"; do check "response of $program" response "$program"; done
for program in "${programs[@]}"; do check "no panic in $program" no_panic "$program"; done
check "no panic in the crate" no_panic no_panic
check "a planted panic" planted
[ $failed = 0 ] || record=()
check "costs, as recorded" costs_are_as_recorded
echo
table
echo
echo "$passed passed, $failed failed"
[ $failed = 0 ]
