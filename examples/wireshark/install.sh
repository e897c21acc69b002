#!/usr/bin/env bash
# Installs the dissector and live capture for Wireshark and tshark into the folders of a user.
#
#   examples/wireshark/install.sh                 into those of this user
#   examples/wireshark/install.sh --to DIR        into those below DIR, as if it were the home
#   examples/wireshark/install.sh --axle PATH     the tool that captures; by default the one in PATH
#
# Prints what it has installed, and what else is needed. Run it again after an update.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)

usage() { sed -n '2,6s/^# \{0,1\}//p' "$0" >&2; exit 2; }
# In quotes that every shell knows; bash's own %q writes $'...', which sh may not know.
quoted() { printf "'%s'" "${1//\'/\'\\\'\'}"; }
home=$HOME axle=$(command -v axle || true)
while [ $# -gt 0 ]; do
    case $1 in
    --to) home=${2:-} ;;
    --axle) axle=${2:-} ;;
    *) usage ;;
    esac
    [ $# -ge 2 ] || usage
    shift 2
done
[ -d "$home" ] || { echo "there is no folder $home" >&2; exit 1; }
home=$(cd -- "$home" && pwd)

base=$home/.local/lib/wireshark
mkdir -p "$base/plugins" "$base/extcap"
# Beside, then renamed: Wireshark never reads half a file.
install -m 644 "$here/axle.lua" "$base/plugins/axle.lua.new"
mv "$base/plugins/axle.lua.new" "$base/plugins/axle.lua"
echo "dissector: $base/plugins/axle.lua"

if [ -z "$axle" ]; then
    echo "no live capture: axle is not in PATH (cargo install --path examples/axle, or --axle PATH)"
    exit 0
fi
axle=$(realpath -- "$axle")
[ -f "$axle" ] && [ -x "$axle" ] || { echo "$axle is not a program" >&2; exit 1; }
printf '#!/bin/sh\nexec %s extcap "$@"\n' "$(quoted "$axle")" >"$base/extcap/axle.new"
chmod 755 "$base/extcap/axle.new"
mv "$base/extcap/axle.new" "$base/extcap/axle"
echo "live capture: $base/extcap/axle"

# Before version 4.2 there is no such folder of a user.
folders=$(for program in tshark wireshark; do
    command -v $program >/dev/null && $program -G folders 2>/dev/null && break
done || true)
case $folders in
*[Pp]"ersonal Extcap"* | *"ersonal extcap"*) ;;
*Extcap*)
    global=$(sed -n 's/^Extcap path:[[:space:]]*//p' <<<"$folders")
    echo "This Wireshark looks for live captures in one folder only. Either link it there, as root:"
    echo "    ln -s $(quoted "$base/extcap/axle") $(quoted "$global/axle")"
    echo "or start it with WIRESHARK_EXTCAP_DIR=$(quoted "$base/extcap")"
    ;;
esac
