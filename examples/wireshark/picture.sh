#!/usr/bin/env bash
# Draws wireshark.png: motors.pcapng in Wireshark, at the moment when a line becomes noisy.
#
#   examples/wireshark/picture.sh             needs the Debian packages wireshark, xvfb, xdotool and
#                                             imagemagick
#   examples/wireshark/picture.sh FILE.png    draws it there
set -euo pipefail
cd "$(dirname "$0")"
output=$(realpath "${1:-wireshark.png}")
for needed in wireshark:wireshark Xvfb:xvfb xdotool:xdotool import:imagemagick; do
    command -v "${needed%%:*}" >/dev/null || {
        echo "${needed%%:*} is missing: install the Debian package ${needed##*:}" >&2
        exit 3
    }
done

# The packet that is selected: an answer behind a stray byte.
packet=820 width=1100 height=680
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir -p "$folder/.config/wireshark"
cp ../captures/motors.pcapng "$folder"
cp colours "$folder/.config/wireshark/colorfilters"
cat >"$folder/.config/wireshark/preferences" <<'X'
gui.column.format: "No.", "%m", "Time, s", "%t", "From", "%s", "To", "%d", "Contents", "%i"
gui.update.enabled: FALSE
X
cat >"$folder/.config/wireshark/recent" <<X
gui.geometry_main_x: 0
gui.geometry_main_y: 0
gui.geometry_main_width: $width
gui.geometry_main_height: $height
gui.geometry_main_maximized: FALSE
X
bash install.sh --to "$folder" --axle /bin/true >/dev/null
cat >"$folder/shot.sh" <<X
wireshark -r motors.pcapng -g $packet >wireshark.log 2>&1 &
for _ in \$(seq 120); do
    xdotool search --onlyvisible --name motors.pcapng >/dev/null 2>&1 && break
    sleep 0.5
done
# The window is drawn; the second line of the details is opened.
sleep 3
xdotool mousemove 200 $((height - 277)) click 1
xdotool key shift+Right
sleep 2
import -window root shot.png
kill %1
X
# As root, Wireshark runs no scripts of users.
user=()
if [ "$(id -u)" = 0 ]; then
    chown -R nobody "$folder"
    user=(setpriv --reuid=nobody --regid=nogroup --clear-groups)
fi
(cd "$folder" && "${user[@]}" env HOME="$folder" XDG_RUNTIME_DIR="$folder" QT_QPA_PLATFORM=xcb \
    LC_ALL=C.UTF-8 xvfb-run -a -s "-screen 0 ${width}x${height}x24" bash shot.sh)
[ -s "$folder/shot.png" ] || { cat "$folder/wireshark.log" >&2; exit 1; }
convert "$folder/shot.png" -strip +dither -colors 48 "png8:$output"
echo "$output: $(stat -c %s "$output") bytes"
