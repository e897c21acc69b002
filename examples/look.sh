#!/usr/bin/env bash
# Runs the commands of the README's section "Look at it in other tools", as they are written there,
# on a simulated rover, and counts the reports in what each of them gives. No window is opened:
# tshark captures in place of Wireshark, and sigrok-cli reads what PulseView would show.
#
#   AXLE=PATH examples/look.sh      PATH is a build of axle with all features
#
# Needs tshark, sigrok-cli, and the modules mcap and pyarrow of python3, or of PYTHON. Exit code 3:
# one of them is missing.
set -euo pipefail
cd "$(dirname "$0")/.."
python=$(realpath -s "$(command -v "${PYTHON:-python3}")") axle=$(realpath "${AXLE:?is not set: a build of axle}")

for tool in tshark sigrok-cli; do
    command -v $tool >/dev/null || {
        echo "$tool is missing: install the Debian package $tool" >&2
        exit 3
    }
done
for module in mcap pyarrow; do
    "$python" -c "import $module" 2>/dev/null || {
        echo "the Python module $module is missing: pip install $module" >&2
        exit 3
    }
done

# Everything runs in a folder of its own, which is the home, too.
work=$(mktemp -d)
mkdir "$work/bin" "$work/examples"
cp "$axle" "$work/bin/axle"
cp -r examples/wireshark examples/sigrok "$work/examples"
here=(env -C "$work" HOME="$work" PATH="$work/bin:$PATH" LC_ALL=C.UTF-8 PYTHONDONTWRITEBYTECODE=1
    WIRESHARK_EXTCAP_DIR="$work/.local/lib/wireshark/extcap")

# Wireshark loads no script if it runs as root: it and the simulator are those of an ordinary user.
as_user=("${here[@]}")
if [ "$(id -u)" = 0 ]; then
    as_user+=(setpriv --reuid nobody --regid "$(id -g nobody)" --clear-groups)
fi

# The one command of the section that contains this, without its comment, on the line of this run.
command_with() {
    local found
    found=$(awk '/^## /{on = /Look at it in other tools/} /^```/{code = !code; next} on && code' \
        README.md | grep -F -- "$1" | sed "s/ *#.*//; s|/tmp/rover|$work/rover|")
    [ "$(wc -l <<<"$found")" = 1 ] && [ -n "$found" ] || {
        echo "README.md: '$1' is in $(grep -c . <<<"$found" || true) lines, expected 1" >&2
        return 1
    }
    echo "$found"
}

# Sums up indices of reports, one per line.
sum() { awk '{ count += 1; sum += $1 } END { print count + 0 " reports, sum of indices " sum + 0 }'; }

# Compares such sums.
expect() {
    [ "$2" = "$3" ] || { echo "$1: $2, expected $3" >&2; return 1; }
    echo "$1: $2"
}

"${here[@]}" "$(command_with wireshark/install.sh)" --axle "$work/bin/axle" >/dev/null
"${here[@]}" bash -c "$(command_with sigrok/axle_)"
# The simulator makes its link there.
chmod 777 "$work"
simulator=$(command_with 'axle sim')
"${as_user[@]}" ${simulator% &} >"$work/log" &
sim=$!
trap 'kill $sim 2>/dev/null || true; wait $sim 2>/dev/null || true; rm -rf "$work"' EXIT
for _ in $(seq 100); do
    [ -e "$work/rover" ] && break
    sleep 0.1
done

live=$(command_with 'wireshark -k')
seen=$("${as_user[@]}" ${live/wireshark -k/tshark -c 60 -a duration:30 -T fields -e axle_ucp.message} \
    2>/dev/null | grep -c report || true)
[ "$seen" -ge 50 ] || { echo "Wireshark: $seen reports in 60 packets" >&2; exit 1; }
echo "Wireshark: $seen reports in 60 packets"

"${here[@]}" $(command_with 'axle record') >/dev/null
reports=$("${here[@]}" axle decode --json drive.pcapng |
    sed -n '/"message":"report"/s/.*"index":\([0-9]*\),.*/\1/p' | sum)
[ "${reports%% *}" -ge 100 ] || { echo "record: only $reports" >&2; exit 1; }

drawn=$(command_with pulseview)
"${here[@]}" ${drawn% && pulseview *} >/dev/null
expect PulseView "$("${here[@]}" sigrok-cli -i drive.sr -P uart:rx=RX:baudrate=115200,axle_ucp \
    -A axle_ucp=packets | sed -n 's/.*: report, index \([0-9]*\):.*/\1/p' | sum)" "$reports"

"${here[@]}" $(command_with '.mcap') >/dev/null 2>&1
expect Foxglove "$("${here[@]}" "$python" -c "
import json
from mcap.reader import make_reader
with open('drive.mcap', 'rb') as file:
    for _, _, message in make_reader(file).iter_messages(topics=['ucp.report']):
        print(json.loads(message.data)['index'])
" | sum)" "$reports"

"${here[@]}" $(command_with '.parquet') >/dev/null 2>&1
expect Parquet "$("${here[@]}" "$python" -c "
import pyarrow.parquet
table = pyarrow.parquet.read_table('drive.parquet/ucp.report.parquet')
print(*table['index'].to_pylist(), sep='\n')
" | sum)" "$reports"

# The values are compared by examples/axle/tests/plot_browser.py.
"${here[@]}" $(command_with 'axle plot') >/dev/null 2>&1
points=$({ grep -o '"name":"front left"[^]]*' "$work/drive.html" || true; } | sed 's/.*"x":\[//' | tr , '\n' | wc -l)
expect plot "$points points" "${reports%% *} points"
