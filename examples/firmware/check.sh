#!/usr/bin/env bash
# Checks the firmware in QEMU: the images end to end, their stacks and responses, and that none can
# panic. Stops at the first failure; takes about 45 s once everything is built.
#
#   examples/firmware/check.sh             prints the costs, `name value limit`
#   examples/firmware/check.sh --record    also writes them to costs.txt
set -euo pipefail
shopt -s inherit_errexit
cd "$(dirname "$0")"
record=/dev/null
case ${1:-} in '') ;; --record) record=costs.txt ;; *) sed -n '5,6s/^# *//p' "$0" >&2; exit 2 ;; esac
programs=(ikeya_slave ikeya_master ucp_robot)
# Instructions from the last byte of a request to the answer, at most. A slave has 50 µs, at 168
# MHz and 1.5 cycles per instruction (ruling I9). A robot sends reports meanwhile; of many runs none
# took more than 2000. The benchmark's stack, bytes: a tenth above its use.
declare -A limit=([response_ikeya_slave]=5600 [response_ucp_robot]=2400 [stack_bench]=2304)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

images=$(dirname "$(./run.sh --build "${programs[@]}" uart_check bench | head -1)")
# From the top, where cargo is not configured to build for a board. The tests mostly wait, so more
# run than there are cores.
(cd ../.. && AXLEWIRE_FIRMWARE=required AXLEWIRE_FIRMWARE_IMAGES=$images \
    cargo test --quiet --test firmware -- --nocapture --test-threads=1) >"$folder/tests" 2>&1 ||
    { cat "$folder/tests"; exit 1; }
grep '[1-9][0-9]* passed' "$folder/tests"
./no_panic.sh "${programs[@]}" no_panic
echo "no panic is reachable"

# The largest value of any test; each test compares it with its limit. The benchmark prints its own.
stack() {
    if [ "$1" = bench ]; then
        bench_in_qemu "$images/bench" | awk '$1 == "stack" { print $2 }'
    else
        grep -o "stack $1 [0-9]*" "$folder/tests" | sort -n -k3 | tail -1 | cut -d' ' -f3
    fi | grep .
}

. ./toolchain.sh
# cost NAME VALUE: a line; fails beyond the limit.
cost() {
    echo "$1 $2 ${limit[$1]:--}"
    [ "$2" -ge 1 ] && [ "$2" -le "${limit[$1]:-$2}" ] || { echo "$1 exceeds its limit" >&2; return 1; }
}
costs() {
    local program response
    echo "# In QEMU; by: examples/firmware/check.sh --record"
    for program in "${programs[@]}" bench; do
        cost "flash_$program" "$(bytes "$images/$program" '\\.vector_table|\\.text|\\.rodata|\\.data')"
        cost "ram_$program" "$(bytes "$images/$program" '\\.data|\\.bss|\\.uninit')"
        cost "stack_$program" "$(stack "$program")"
        [ -n "${limit[response_$program]:-}" ] || continue
        response=$(CARGO_TARGET_DIR=$out ./response.sh "$program")
        cost "response_$program" "$(cut -d' ' -f2 <<<"$response")"
    done
}
costs >"$folder/costs"
tee "$record" <"$folder/costs"
