#!/usr/bin/env bash
# Makes pulseview.png: PulseView with the decoders of this folder, on the capture demo.sr.
#
#   examples/sigrok/picture.sh [OUT.png]
#
# Needs the Debian packages pulseview, xvfb and imagemagick. Exit code 3: one is missing.
set -euo pipefail
cd "$(dirname "$0")"
out=$(realpath "${1:-pulseview.png}")
if [ "${2:-}" != inside ]; then
    for tool in pulseview:pulseview Xvfb:xvfb import:imagemagick; do
        command -v "${tool%:*}" >/dev/null || {
            echo "${tool%:*} is missing: install the Debian package ${tool#*:}" >&2
            exit 3
        }
    done
    exec xvfb-run -a -s "-screen 0 1500x500x24" bash ./picture.sh "$out" inside
fi
scratch=$(mktemp -d)
viewer=
trap '[ -z "$viewer" ] || { kill "$viewer" || true; wait || true; }; rm -r "$scratch"' EXIT
mkdir -p "$scratch/home" "$scratch/run" "$scratch/decoders"
chmod 700 "$scratch/run"
cp -r axle_ikeya axle_ucp "$scratch/decoders"
# The set-up beside the capture has the decoders and the scale.
python3 make.py "$scratch/demo.sr"
export HOME=$scratch/home XDG_RUNTIME_DIR=$scratch/run SIGROKDECODE_DIR=$scratch/decoders
pulseview -qwindowgeometry 1500x500+0+0 -c -i "$scratch/demo.sr" >/dev/null 2>&1 &
viewer=$!
# It is drawn when two shots, a second apart, are the same and show more than a grey window.
for _ in $(seq 60); do
    sleep 1
    import -window root -crop 1500x455+0+0 +repage "$scratch/now.ppm"
    if [ "$(identify -format %k "$scratch/now.ppm")" -gt 60 ] &&
        cmp -s "$scratch/now.ppm" "$scratch/before.ppm"; then
        convert "$scratch/now.ppm" +dither -colors 64 -strip "png8:$scratch/out.png"
        mv "$scratch/out.png" "$out"
        exit 0
    fi
    mv "$scratch/now.ppm" "$scratch/before.ppm"
done
echo "PulseView did not draw the capture within a minute" >&2
exit 1
