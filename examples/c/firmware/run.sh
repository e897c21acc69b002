#!/usr/bin/env bash
# Builds the motor node for an STM32F405 and runs it in QEMU: run.sh [COMMAND ..]
#
# Without a command it runs until Ctrl-C, on a pseudo-terminal whose name it prints. With one it runs
# while the command does; PORT in it is that pseudo-terminal. With --build it only builds, and prints
# the name of the image. CC names the compiler, clang or arm-none-eabi-gcc; LIB the library, if it is
# built already; TWIN=yes takes the node in Rust, to compare; IMAGE is run instead of the node.
set -euo pipefail
from=$PWD
cd "$(dirname "$0")"
root=$(cd ../../.. && pwd)
target=${CARGO_TARGET_DIR:-$root/target}
[ -d "$target" ] || target=$PWD
core=thumbv7em-none-eabihf
name=c-node sources=(node.c hal.c)
if [ -n "${TWIN-}" ]; then name=c-twin sources=(hal.c); fi
build() (
    cd "$1"; shift
    bash "$root/.ci/cross" $core rustc --quiet "$@" --crate-type staticlib >&2
)
compile() {
    if [ -n "${TWIN-}" ]; then
        CARGO_TARGET_DIR=$target/twin build twin --release
        LIB=$(ls -t "$target"/twin/{.,cross}/$core/release/libaxlewire_c_twin.a 2>/dev/null | head -1) || [ -n "$LIB" ]
    elif [ -z "${LIB-}" ] && [ -f ../lib/$core/libaxlewire.a ]; then # in the zip
        LIB=../lib/$core/libaxlewire.a target=$PWD
    elif [ -z "${LIB-}" ]; then
        build "$root" --profile firmware -p axlewire-c --no-default-features
        # The newest: it may have been built with and without rustup's target.
        LIB=$(ls -t "$target"/{.,cross}/$core/firmware/libaxlewire_c.a 2>/dev/null | head -1) || [ -n "$LIB" ]
    fi
    CC=${CC:-clang}
    case $CC in
    *clang*) machine=(--target=$core -fuse-ld=lld) ;;
    *) machine=(-mthumb -Wl,--no-warn-execstack) ;;
    esac
    image=$target/$name.elf
    "$CC" "${machine[@]}" -mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard -std=c99 -Os \
        -Wall -Wextra -Wpedantic -Wconversion -Werror -ffreestanding -ffunction-sections -fdata-sections \
        -nostdlib -Wl,--gc-sections -T stm32f405.ld -I../include "${sources[@]}" "$LIB" -o "$image"
    # A panic that could happen would be linked.
    if nm "$image" | grep -i 'panic\|unwind'; then echo "the node can panic" >&2; exit 1; fi
}
image=${IMAGE-}
[ -n "$image" ] || compile
if [ "${1-}" = --build ]; then echo "$image"; exit; fi

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
