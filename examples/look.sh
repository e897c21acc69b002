#!/usr/bin/env bash
# Runs the commands of the README's section "Pictures", as they are written there,
# on a simulated rover, and counts the reports in what each of them gives. No window is opened:
# tshark captures in place of Wireshark, and sigrok-cli reads what PulseView would show.
#
# Needs the Debian packages tshark, sigrok-cli and libsigrokdecode4. AXLE is a build of axle with
# all features; without it, one is made.
set -euo pipefail
cd "$(dirname "$0")/.."
bash examples/axle/tests/export.sh --install
[ -n "${AXLE:-}" ] || cargo build --quiet -p axlewire-cli --all-features
python=$PWD/target/export/bin/python

# Everything runs in a folder of its own, which is the home, too, with stand-ins for the windows.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/bin" "$work/examples"
cp "${AXLE:-${CARGO_TARGET_DIR:-target}/debug/axle}" "$work/bin/axle"
cp -r examples/wireshark examples/sigrok "$work/examples"
for it in cargo pulseview; do ln -s "$(type -P true)" "$work/bin/$it"; done
cat >"$work/bin/wireshark" <<X
#!/bin/sh
# The simulator may not be there yet.
timeout 10 sh -c "until [ -e $work/rover ]; do sleep 0.1; done"
shift
exec tshark -c 60 -a duration:30 -T fields -e axle_ucp.message "\$@" >$work/live.txt
X
chmod 755 "$work" "$work/bin/wireshark"
here=(env -C "$work" HOME="$work" PATH="$work/bin:$PATH" LC_ALL=C.UTF-8 PYTHONDONTWRITEBYTECODE=1
    WIRESHARK_EXTCAP_DIR="$work/.local/lib/wireshark/extcap")
# Wireshark loads no script if it runs as root: all is run by an ordinary user then.
if [ "$(id -u)" = 0 ]; then
    chown -R nobody "$work"
    here+=(setpriv --reuid nobody --regid "$(id -g nobody)" --clear-groups)
fi
commands=$(awk '/^## /{on = /Pictures/} /^```/{code = !code; next} on && code' \
    README.md)
commands="trap 'kill %1' EXIT; ${commands//\/tmp\/rover/$work/rover}"
"${here[@]}" bash -ec "$commands" >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }

cd "$work"
reports=$("${here[@]}" axle decode --json drive.pcapng | grep -c '"message":"report"')
live=$(grep -c report live.txt)
echo "$live reports in 60 packets of Wireshark, $reports in the recording"
[ "$live" -ge 50 ]
[ "$reports" -ge 100 ]
# Name, number of reports, and how many it must be.
expect() { echo "$1: $2 reports"; [ "$2" = "${3:-$reports}" ]; }
expect PulseView "$("${here[@]}" sigrok-cli -i drive.sr -A axle_ucp=packets \
    -P uart:rx=RX:baudrate=115200,axle_ucp | grep -c ': report, index')"
expect Foxglove "$("$python" -c "from mcap.reader import make_reader
file = make_reader(open('drive.mcap', 'rb'))
print(sum(1 for _ in file.iter_messages(topics=['ucp.report'])))")"
expect Parquet "$("$python" -c "import pyarrow.parquet
print(len(pyarrow.parquet.read_table('drive.parquet/ucp.report.parquet')))")"
# Of reports that came at once, a page has one.
times=$("${here[@]}" axle decode --json drive.pcapng | grep '"message":"report"' |
    grep -o '"t":[0-9.]*' | sort -u | wc -l)
expect plot "$(grep -o '"name":"front left"[^]]*' drive.html | sed 's/.*"x":.//' | tr , '\n' |
    wc -l)" "$times"
