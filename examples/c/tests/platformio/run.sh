#!/usr/bin/env bash
# Builds the sketch with PlatformIO against the library for Arduino, and turns its motor in QEMU.
#
# The platforms and cores of real boards cannot be had from PyPI: this folder takes their place.
# Needs arm-none-eabi-gcc, QEMU, and PlatformIO with SCons (`pip install platformio scons`), which it
# installs into an environment of its own.
set -euo pipefail
cd "$(dirname "$0")"
root=$(cd ../../../.. && pwd)
target=$(realpath -m "${CARGO_TARGET_DIR:-$root/target}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python=$target/platformio/bin/python
[ -x "$target/platformio/bin/pio" ] || python3 -m venv "$target/platformio"
"$python" -m pip install --quiet platformio==6.2.0 scons==4.11.1

CORES=thumbv7em-none-eabihf ../../release.sh "$work/c.zip" "$work/arduino.zip"
mkdir "$work"/{project,project/src}
python3 -m zipfile -e "$work/arduino.zip" "$work/project/lib"
cp ../../arduino/examples/motor_node/motor_node.ino "$work/project/src"
cat >"$work/project/platformio.ini" <<END
[env:qemu]
platform = symlink://$PWD
board = qemu
framework = arduino
END
# PlatformIO would fetch SCons from its own registry.
export PLATFORMIO_CORE_DIR=$work/core PLATFORMIO_SETTING_ENABLE_TELEMETRY=no
scons=$work/core/packages/tool-scons
mkdir -p "$scons"
echo 'from SCons.Script.Main import main; main()' >"$scons/scons.py"
echo '{"name": "tool-scons", "version": "4.41101.0", "system": "*"}' >"$scons/package.json"
cat >"$scons/.piopm" <<'END'
{"type": "tool", "name": "tool-scons", "version": "4.41101.0",
 "spec": {"owner": "platformio", "name": "tool-scons"}}
END
"$target/platformio/bin/pio" run --project-dir "$work/project"
IMAGE=$work/project/.pio/build/qemu/program.elf ../../firmware/run.sh \
    "${AXLE:-$target/release/axle}" spin -p PORT --node 1 --rps 2 --for 2 | tee "$work/log"
grep -q '2.00 rps$' "$work/log"
grep -q 'stopped and confirmed' "$work/log"
