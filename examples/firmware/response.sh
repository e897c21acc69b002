#!/usr/bin/env bash
# Number of instructions from the interrupt of a request's last byte until a program writes the
# first byte of the answer to the data register: prints `least median most`.
#
#   examples/firmware/response.sh ikeya_slave   READ, answered by a velocity response
#   examples/firmware/response.sh ucp_robot     ping, answered by a pong
#
# A second argument is the image of another program that does the same, and says nothing.
#
# QEMU executes and logs single instructions, interrupts and register accesses. Its USART takes a
# line of text in one interrupt, so the maximum is larger than on a board.
set -euo pipefail
cd "$(dirname "$0")"

# Number of answers to count.
count=25
case ${1:-} in
ikeya_slave) request='\xAA \x01 \xBE \xD0' answer=55010000000031de ;;
ucp_robot) request='\xFD \xFF \x04 \x00 \x01 \x00 \x01 \x42' answer=fdff050001 ;;
*) sed -n '5,6s/^# \?//p' "$0" >&2; exit 2 ;;
esac
read -ra request <<<"$request"
image=${2:-$(./run.sh --build "$1")}
one_by_one=(-accel tcg,one-insn-per-tb=on)
qemu-system-arm --version | grep -q 'version [1-7]\.' && one_by_one=(-singlestep)

folder=$(mktemp -d)
qemu= counter=
trap 'kill -KILL $qemu $counter 2>/dev/null || true; wait 2>/dev/null; rm -rf "$folder"' EXIT
trap 'exit 130' INT TERM
mkfifo "$folder/log"

# 0x40011004 is the data register of USART1; exception 53 is its interrupt.
awk -v len=${#request[@]} '
    /^Trace / { steps++; next }
    /nvic_acknowledge_irq .*IRQ: 53 / { entered = steps; next }
    /memory_region_ops_read .* addr 0x40011004 / { if (++received % len == 0) { begun = entered; is_asked = 1 }; next }
    /memory_region_ops_write .* addr 0x40011004 / && is_asked { print steps - begun; is_asked = 0 }
' "$folder/log" >"$folder/counts" &
counter=$!
exec {lines}< <(
    exec qemu-system-arm -M netduinoplus2 -display none -monitor none -serial pty -serial stdio -kernel "$image" \
        "${one_by_one[@]}" -d exec,nochain -D "$folder/log" -trace nvic_acknowledge_irq \
        -trace memory_region_ops_read -trace memory_region_ops_write </dev/null 2>&1
)
qemu=$!
port=
while [ -z "$port" ] && read -r -t 20 -u "$lines" line; do
    port=$(grep -o '/dev/[^ ]*' <<<"$line" || echo "$line" >&2)
done
[ -n "$port" ] || { echo "QEMU did not start" >&2; exit 1; }
exec {bus}<>"$port"
stty -F "$port" raw -echo
cat <&"$bus" >"$folder/answers" 2>/dev/null &

# The first line shows that it runs; QEMU sees the open port after a second, and then another comes.
if [ $# = 1 ]; then for _ in 1 2 3; do read -r -t 20 -u "$lines" line; done; else sleep 3; fi
answered() { od -An -v -tx1 "$folder/answers" | tr -d ' \n' | { grep -o "$answer" || true; } | wc -l; }
have=0
# A request delayed too long by this machine does not count, so up to twice as many are sent.
for ((i = 0; have < count && i < 2 * count; i++)); do
    for byte in "${request[@]}"; do
        printf '%b' "$byte" >&"$bus"
        # The byte is processed before the next one comes, as on a line.
        sleep 0.002
    done
    for ((wait = 0, before = have; have == before && wait < 50; wait++)); do
        sleep 0.005
        have=$(answered)
    done
done
[ "$have" -ge "$count" ] || { echo "$have of $i requests were answered" >&2; exit 1; }
kill -KILL "$qemu"
wait "$counter"
sort -n "$folder/counts" | awk '{ all[NR] = $1 } END { print all[1], all[int((NR + 1) / 2)], all[NR]; exit !NR }'
