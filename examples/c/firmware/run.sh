#!/usr/bin/env bash
# Builds the motor node for an STM32F405 and runs it in QEMU: run.sh [COMMAND ..]
#
# Without a command it runs until Ctrl-C, on a pseudo-terminal whose name it prints. With one it runs
# while the command does; PORT in it is that pseudo-terminal. CC names the compiler, clang or
# arm-none-eabi-gcc; LIB the library, if it is built already. The image is left in target/c-node.elf.
set -euo pipefail
from=$PWD
cd "$(dirname "$0")"
root=$(cd ../../.. && pwd)
target=${CARGO_TARGET_DIR:-$root/target}
[ -d "$target" ] || target=$PWD
core=thumbv7em-none-eabihf
if [ -z "${LIB-}" ]; then
    export CARGO_PROFILE_RELEASE_PANIC=abort CARGO_PROFILE_RELEASE_OPT_LEVEL=s \
        CARGO_PROFILE_RELEASE_LTO=fat CARGO_PROFILE_RELEASE_CODEGEN_UNITS=1
    (cd "$root" && bash .ci/cross $core rustc --quiet --release -p axlewire-c --no-default-features \
        --crate-type staticlib)
    LIB=$(find "$target" -path "*$core/release/libaxlewire_c.a" | head -1)
fi
CC=${CC:-clang}
case $CC in
*clang*) machine=(--target=$core -fuse-ld=lld) ;;
*) machine=(-mthumb) ;;
esac
image=$target/c-node.elf
"$CC" "${machine[@]}" -mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard -std=c99 -Os \
    -Wall -Wextra -Wpedantic -Wconversion -Werror -ffreestanding -ffunction-sections -fdata-sections \
    -nostdlib -Wl,--gc-sections -T stm32f405.ld -I../include node.c hal.c "$LIB" -o "$image"
# A panic that could happen would be linked.
if nm "$image" | grep -i 'panic\|unwind'; then echo "the node can panic" >&2; exit 1; fi

exec {lines}< <(exec setsid qemu-system-arm -M netduinoplus2 -display none -monitor none \
    -serial pty -kernel "$image" </dev/null 2>&1)
qemu=$!
trap 'kill -KILL "$qemu" 2>/dev/null || true' EXIT
read -r -u "$lines" line
port=$(grep -o '/dev/[^ ]*' <<<"$line") || { echo "$line" >&2; exit 1; }
if [ $# = 0 ]; then echo "port: $port"; wait "$qemu"; fi
# QEMU looks once a second whether the port is open.
exec {keep}<>"$port"
sleep 1.2
cd "$from"
"${@//PORT/$port}"
