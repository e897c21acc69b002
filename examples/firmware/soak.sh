#!/usr/bin/env bash
# Two firmware images in QEMU, the master's line and the slave's connected back to back, for some
# minutes: prints the exchanges, and fails if anything was lost or the counts do not add up.
#
#   examples/firmware/soak.sh [MINUTES]      2 by default
#
# `soak_master` reads and commands `ikeya_slave` as fast as the line allows, and both count. A strike
# (no answer within 100 ms) is a fault, unless the machine halted QEMU meanwhile: then the strikes
# must explain every request without its answer.
set -euo pipefail
cd "$(dirname "$0")"
seconds=$((60 * ${1:-2}))
images=$(dirname "$(./run.sh --build soak_master ikeya_slave | head -1)")
folder=$(mktemp -d)
ids=
# With KILL, because QEMU prints a message for other signals.
trap 'for id in $ids; do kill -KILL "$id"; done 2>/dev/null; wait 2>/dev/null; rm -rf "$folder"' EXIT
trap 'exit 130' INT TERM

# board NAME IMAGE LINE: runs it; its text goes to NAME.text, and a byte into NAME.in asks for it.
board() {
    mkfifo "$folder/$1.in" "$folder/$1.out"
    cat "$folder/$1.out" >"$folder/$1.text" &
    ids="$ids $!"
    qemu-system-arm -M netduinoplus2 -display none -monitor none -kernel "$images/$2" \
        -chardev "socket,id=line,path=$folder/line,$3" -serial chardev:line \
        -chardev "pipe,id=text,path=$folder/$1" -serial chardev:text </dev/null 2>"$folder/$1.errors" &
    ids="$ids $!"
    pids+=($!)
}

pids=()
# The slave first: a USART that has not been started drops incoming bytes. It waits for the master.
board slave ikeya_slave server=on,wait=off
for _ in $(seq 500); do [ -s "$folder/slave.text" ] && break; sleep 0.02; done
board master soak_master server=off

# Lateness of naps beside QEMU, ms: what the machine does to it.
while begin=${EPOCHREALTIME/./}; do
    sleep 0.05
    echo $(((${EPOCHREALTIME/./} - begin) / 1000 - 50))
done >"$folder/late" &
ids="$ids $!"

sleep "$seconds"
for id in "${pids[@]}"; do
    kill -0 "$id" || { echo "QEMU has ended: $(cat "$folder"/*.errors)" >&2; exit 1; }
done
# Both at once: they may be a few exchanges apart.
printf '?' | tee "$folder/master.in" >"$folder/slave.in"
sleep 0.3

# The counts of the last whole line of each role, as variables: m_reads, s_reads and so on.
for role in master slave; do
    eval "$(grep -a "^$role .* ms [0-9]*.$" "$folder/$role.text" | tail -1 | tr -d '\r' |
        awk -v role="${role:0:1}" '{ for (i = 2; i < NF; i += 2) print role "_" $i "=" $(i + 1) }')"
done
late=$(sort -n "$folder/late" | tail -1)
awk -v n="$m_replies" -v ms="$m_ms" -v s="$m_strikes" -v late="$late" 'BEGIN {
    printf "%d exchanges in %.1f minutes, %.0f a second; %d strikes; ", n, ms / 60000, n * 1000 / ms, s
    printf "a nap beside them was late by up to %d ms\n", late
}'

failed=0
# check WHAT CONDITION: an arithmetic expression.
check() { (($2)) || { echo "FAILED: $1 ($2)" >&2; failed=1; }; }
# Both lines are from about the same moment: half a second apart on a busy machine.
apart=$((50 + m_replies * 500 / m_ms))
near() { check "$1" "$2 - $3 <= apart && $3 - $2 <= apart"; }
unanswered=$((m_requests - m_replies - m_strikes)) unsaid=$((s_reads - s_replies - s_overtaken - s_expired))
# The master sends WRITE and READ in turn, so that one that is lost shows at any moment.
unheard=$((m_writes - m_reads - s_writes + s_reads))
check "hardly anything was said" "$m_replies >= $seconds * 20"
check "the requests of the master" "$unanswered == 0 || $unanswered == 1"
check "readings that were not told" "$m_exchanges == $m_replies"
check "the READs of the master" "$m_reads == $m_requests"
check "the requests of the slave" "$unsaid == 0 || $unsaid == 1"
check "no node but this one" "$s_foreign == 0"
near "READs sent and heard" "$m_reads" "$s_reads"
check "WRITEs sent and heard" "-1 <= $unheard && $unheard <= 1"
near "answers sent and heard" "$m_replies" "$s_replies"
check "bytes that the master lost" "$m_overruns + $m_lost + $m_damaged + $m_lost_events == 0"
check "bytes that the slave lost" "$s_overruns + $s_lost + $s_damaged + $s_skipped == 0"
# Of an answer that a halt has cut in two, the rest comes too late.
check "bad answers" "$m_late <= $m_strikes && $m_early <= $m_strikes && $m_crc_errors <= $m_strikes"
check "bytes outside packets" "$m_skipped <= 8 * $m_strikes && $m_stale <= 8 * $m_strikes"
check "every byte is in a frame" "$m_received <= $m_framed + 8"
# 100 ms without an answer.
check "strikes on a machine that was not busy" "$m_strikes == 0 || $late >= 50"
exit $failed
