#!/usr/bin/env bash
# Two firmware images in QEMU, the master's line and the slave's connected back to back, for some
# minutes: prints the exchanges, and fails if anything was lost or the counts do not add up.
#
#   examples/firmware/soak.sh [MINUTES]      2 by default
#
# `soak_master` reads and commands `ikeya_slave` as fast as the line allows. Both count for
# themselves, and no other program touches the bytes between them. A strike (an answer that did not
# come within 100 ms) is a fault, unless the machine halted QEMU meanwhile: then the strikes must
# explain every request without its answer.
set -euo pipefail
cd "$(dirname "$0")"
minutes=${1:-2}
seconds=$(awk -v m="$minutes" 'BEGIN { if (m !~ /^[0-9.]+$/ || m <= 0) exit 1; printf "%d", m * 60 }') ||
    { sed -n '5p' "$0" >&2; exit 2; }

./run.sh --build soak_master ikeya_slave >/dev/null
images=$(dirname "$(./run.sh --build ikeya_slave)")
folder=$(mktemp -d)
ids=
# With KILL, because QEMU prints a message for other signals.
trap 'for id in $ids; do kill -KILL "$id"; done 2>/dev/null; wait 2>/dev/null; rm -rf "$folder"' EXIT
trap 'exit 130' INT TERM

# board NAME IMAGE LINE: runs it; its text goes to NAME.text, and a byte into NAME.ask asks for it.
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
exec {ask_slave}>"$folder/slave.in" {ask_master}>"$folder/master.in"

# Lateness of naps beside QEMU, ms: what the machine does to it.
(
    while :; do
        begin=${EPOCHREALTIME/./}
        sleep 0.05
        echo $(((${EPOCHREALTIME/./} - begin) / 1000 - 50))
    done
) >"$folder/late" &
ids="$ids $!"

# last NAME: the last whole line of a role.
last() { grep -a "^\(master\|slave\) .* ms [0-9]*.$" "$folder/$1.text" | tail -1 | tr -d '\r'; }
# value NAME COUNT: the number after this word in the line that was kept.
value() { awk -v n="$2" '{ for (i = 1; i < NF; i++) if ($i == n) print $(i + 1) }' "$folder/$1.last"; }

sleep "$seconds"
for id in "${pids[@]}"; do
    kill -0 "$id" 2>/dev/null || { echo "QEMU has ended: $(cat "$folder"/*.errors)" >&2; exit 1; }
done
# Both at once: they may be a few exchanges apart.
printf '?' >&"$ask_master"
printf '?' >&"$ask_slave"
sleep 0.3
last master >"$folder/master.last"
last slave >"$folder/slave.last"

m_reads=$(value master reads) m_writes=$(value master writes) m_ms=$(value master ms)
requests=$(value master requests) replies=$(value master replies) strikes=$(value master strikes)
exchanges=$(value master exchanges) abnormal=$(value master abnormal)
s_reads=$(value slave reads) s_writes=$(value slave writes) answers=$(value slave replies)
overtaken=$(value slave overtaken) expired=$(value slave expired) foreign=$(value slave foreign)
late=$(sort -n "$folder/late" | tail -1)
awk -v n="$replies" -v ms="$m_ms" -v s="$strikes" -v late="$late" 'BEGIN {
    rate = n * 1000 / ms
    printf "%d exchanges in %.1f minutes, %.0f a second; %d strikes; ten million would take %.0f minutes; ", n, ms / 60000, rate, s, 1e7 / rate / 60
    printf "a nap beside them was late by up to %d ms\n", late
}'
echo "master: $m_reads READ, $m_writes WRITE, $requests requests, $replies answers, $strikes strikes, $abnormal times abnormal"
echo "slave:  $s_reads READ, $s_writes WRITE, $answers answers, $overtaken overtaken, $expired expired"

failed=0
check() { local what=$1; shift; [ "$@" ] || { echo "FAILED: $what ($*)" >&2; failed=1; }; }
# Both lines are from about the same moment: half a second apart on a busy machine.
near() { local apart=$(($2 - $3)); check "$1" "${apart#-}" -le $((50 + replies * 500 / m_ms)); }
check "hardly anything was said" "$replies" -ge $((seconds * 20))
check "the requests of the master" $((requests - replies - strikes)) -ge 0
check "the requests of the master" $((requests - replies - strikes)) -le 1
check "readings that were not told" "$exchanges" = "$replies"
check "the READs of the master" "$m_reads" = "$requests"
check "the requests of the slave" $((s_reads - answers - overtaken - expired)) -ge 0
check "the requests of the slave" $((s_reads - answers - overtaken - expired)) -le 1
check "no node but this one" "$foreign" = 0
near "READs sent and heard" "$m_reads" "$s_reads"
# The master sends them in turn, so that one that is lost shows at any moment.
unheard=$((m_writes - m_reads - (s_writes - s_reads)))
check "WRITEs sent and heard" "${unheard#-}" -le 1
near "answers sent and heard" "$replies" "$answers"
for board in master slave; do
    for name in overruns lost damaged; do
        check "$name of the $board" "$(value $board $name)" = 0
    done
done
check "bytes outside packets at the slave" "$(value slave skipped)" = 0
check "events that were not told" "$(value master lost_events)" = 0
# Of an answer that a halt has cut in two, the rest comes too late.
for name in late early crc_errors; do
    check "$name of the master" "$(value master $name)" -le "$strikes"
done
for name in skipped stale; do
    check "$name of the master" "$(value master $name)" -le $((8 * strikes))
done
check "every byte is in a frame" "$(value master received)" -le $(($(value master framed) + 8))
# 100 ms without an answer.
[ "$strikes" = 0 ] || check "strikes on a machine that was not busy" "$late" -ge 50
exit $failed
