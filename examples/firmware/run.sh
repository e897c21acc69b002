#!/usr/bin/env bash
# Runs firmware in QEMU. PROGRAM is ikeya_slave, ikeya_master or ucp_robot.
#
#   examples/firmware/run.sh PROGRAM                 runs until Ctrl-C; prints the port and the text
#   examples/firmware/run.sh PROGRAM -- COMMAND ...  runs while COMMAND does; replaces PORT in it
#   examples/firmware/run.sh --build PROGRAM ...     only builds; prints the image paths
#
# The port is a pseudo-terminal; its speed does not matter. Lines from the firmware begin with
# "firmware: ". The compiler and QEMU come from Debian if they are missing.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
usage() { sed -n '2,6s/^# \?//p' "$0" >&2; exit 2; }

# In a subshell: variables set by the build must not reach the command.
build() (
    cd "$here"
    . ./toolchain.sh
    "${cargo[@]}" --quiet --locked --release --features board $(printf -- '--bin %s ' "$@") >&2
    printf "$out/$target/release/%s\n" "$@"
)

case ${1:-} in
--build) [ $# -gt 1 ] || usage; shift; build "$@"; exit ;;
ikeya_slave | ikeya_master | ucp_robot) program=$1 ;;
*) usage ;;
esac
shift
[ $# = 0 ] || { [ "$1" = -- ] && [ $# -gt 1 ]; } || usage
image=$(build "$program")

# In a separate session: Ctrl-C goes to the command, which may have to stop a motor first.
exec {lines}< <(
    exec setsid qemu-system-arm -M netduinoplus2 -display none -monitor none -serial pty -serial stdio \
        -kernel "$image" </dev/null 2>&1
)
qemu=$!
# With KILL, because QEMU prints a message for other signals.
trap 'kill -KILL "$qemu" 2>/dev/null || true' EXIT
trap 'exit 130' INT TERM
# "char device redirected to /dev/pts/3 (label serial0)"
port=
while [ -z "$port" ] && read -r -u "$lines" line; do
    port=$(grep -o '/dev/[^ ]*' <<<"$line" || echo "$line" >&2)
done
[ -n "$port" ] || { echo "QEMU did not start" >&2; exit 1; }
# QEMU checks a closed port only once a second, so it is kept open; but not if the firmware sends
# unprompted and nothing may be reading, because QEMU stalls while the port is full.
[ $# = 0 ] && [ "$program" != ikeya_slave ] || exec {keep}<>"$port"

# Skips a line that equals the previous one except for the time.
show() {
    local line last=
    while read -r -u "$lines" line; do
        line=${line%$'\r'}
        [ "${line% ms *}" = "$last" ] || echo "firmware: $line"
        last=${line% ms *}
    done
}

if [ $# = 0 ]; then
    echo "port: $port"
    show
else
    shift
    show &
    # Wait until QEMU has seen that the port is open.
    sleep 1.2
    "${@//PORT/$port}"
fi
