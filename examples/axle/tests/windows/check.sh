#!/usr/bin/env bash
# The host tool on Windows, as far as wine goes: builds axle.exe with mingw, decodes captures with it,
# and runs it on a COM port. That is a pseudo-terminal, with motors simulated by the native tool. It
# has no line speed, hence --instant.
set -euo pipefail
cd "$(dirname "$0")/../../../.."
CARGO_TARGET_DIR=$(realpath -m "${CARGO_TARGET_DIR:-target}")
export CARGO_TARGET_DIR CARGO_TERM_COLOR=never CARGO_INCREMENTAL=0
here=$CARGO_TARGET_DIR/debug/axle

# Where the packages put wine.
find_wine() { dpkg -L wine64 | grep -m1 -E "/wine/$1(64)?\$"; }

# Runs a Windows program, with a time limit; \n ends its lines.
wine() { timeout 40 "$(find_wine wine)" "$@"; }

axle() { wine "$FOLDER/axle.exe" "$@"; }

# Shows what was found, and fails, unless a file has this line.
expect() { grep -q -e "$1" "$2" || { echo "no line $1 in:"; tail "$2"; return 1; }; }

# Waits until a file has this line.
await() {
    for _ in $(seq 200); do
        grep -q -e "$1" "$2" && return
        sleep 0.1
    done
    expect "$1" "$2"
}

# Fails unless a command fails with this exit code, and with this line.
expect_failure() {
    local code=$1 line=$2 status=0
    shift 2
    "$@" >"$FOLDER/out" 2>"$FOLDER/err" </dev/null || status=$?
    [ "$status" = "$code" ] || { echo "$*: exit code $status"; return 1; }
    expect "$line" "$FOLDER/err"
    [ "$(wc -l <"$FOLDER/err")" = 1 ]
}

decode() {
    local capture form
    for capture in ikeya ucp; do
        for form in --json ''; do
            "$here" decode --protocol $capture $form examples/captures/$capture.bin >"$FOLDER/here"
            axle decode --protocol $capture $form examples/captures/$capture.bin >"$FOLDER/there"
            [ -s "$FOLDER/here" ]
            cmp "$FOLDER/here" "$FOLDER/there"
            axle decode --protocol $capture $form - <examples/captures/$capture.bin | cmp - "$FOLDER/here"
        done
    done
    expect_failure 1 '^axle: cannot open "no such file": ' axle decode --protocol ucp 'no such file'
    expect_failure 2 '^axle: sim needs a pseudo-terminal' axle sim ikeya --node 1:velocity --help
    axle --help >"$FOLDER/there"
    "$here" --help >"$FOLDER/here"
    { diff "$FOLDER/here" "$FOLDER/there" || true; } | grep "^>" >"$FOLDER/new"
    # Only the line on sim.
    expect '^>   sim .*Not on this system' "$FOLDER/new"
    [ "$(wc -l <"$FOLDER/new")" = 1 ]
}

# A COM port that leads to this path.
plug() { ln -sfn "$2" "$WINEPREFIX/dosdevices/com$1"; }

# Native processes to end.
started=()
end() { [ ${#started[@]} = 0 ] || kill -9 "${started[@]}" 2>/dev/null || true; }

ports() {
    cd "$FOLDER"
    # Where it is allowed, other processes do not delay the answers.
    local soon=
    if chrt -f 10 true 2>/dev/null; then soon='chrt -f 10'; fi
    $soon "$here" sim ikeya --node 1:velocity --node 3:position >sim &
    started+=($!)
    await '^pty: ' sim
    plug 7 "$(sed -n 's/^pty: //p' sim)"
    plug 17 "$(sed -n 's/^pty: //p' sim)"

    axle scan --port COM7 --instant >out
    expect '^2 nodes answer.$' out
    # Above COM9 Windows wants a prefix, which is added or was given.
    axle scan --port COM17 --instant >out
    expect '^2 nodes answer.$' out
    axle scan --port '\\.\COM17' --instant >out
    expect '^2 nodes answer.$' out
    expect_failure 1 '^axle: cannot use port "COM9": .* (no such port, or another program' \
        axle scan --port COM9

    axle spin --port COM7 --instant --node 1 --rps 2 --for 2 --record spin.pcapng >out
    expect 'node 1: .* rps, stopped and confirmed$' out
    expect 'node 1: turning at 2.00 rps' sim
    await 'node 1: at rest' sim
    same_decoding spin.pcapng
    expect 'write  *1  2.0 rps$' decoded

    # Ctrl-C, Ctrl-Break, a closed window.
    local event spin
    for event in 0 1 2; do
        rm -f now
        wine press.exe $event now axle.exe spin --port COM7 --instant --node 1 --rps 3.$event --for 500 >out &
        spin=$!
        await "command 3.${event}0 rps" sim
        touch now
        wait $spin
        tail -n 1 out >last
        expect 'node 1: .* rps, stopped and confirmed$' last
        grep 'node 1: command' sim | tail -n 1 >last
        expect 'command 0.00 rps' last
    done

    # What a killed tool leaves behind, stop stops.
    "$(find_wine wine)" axle.exe spin --port COM7 --instant --node 1 --rps 4 --for 500 >out &
    spin=$!
    started+=($spin)
    await 'command 4.00 rps' sim
    kill -9 $spin
    { wait $spin || true; } 2>/dev/null
    axle stop --port COM7 --instant >out
    expect '^node 1: .* rps, stopped and confirmed$' out
    expect '^silent, not stopped: 2, 4, 5, 6, 7, 8$' out
    grep 'node 1: command' sim | tail -n 1 >last
    expect 'command 0.00 rps' last

    # A program that sleeps instead of waiting at the port, without the tool.
    $soon "$here" sim ucp >rover &
    started+=($!)
    await '^pty: ' rover
    plug 6 "$(sed -n 's/^pty: //p' rover)"
    wine rover.exe COM6 >out
    expect '^\[[1-9].* rpm, [0-9.]* V$' out
    expect '^told to stop$' out

    python3 "$OLDPWD/examples/axle/tests/windows/talk.py" "$OLDPWD/examples/captures/ikeya.bin" >talk &
    started+=($!)
    await '^/dev/' talk
    plug 8 "$(cat talk)"
    axle record --port COM8 --baud 115200 --protocol ikeya --for 1 --output line.pcapng --force >out
    same_decoding line.pcapng
    tail -n "$(wc -l <out)" decoded | cmp - out
    # Some of the 20 rounds, each of 11 frames.
    [ "$(grep -c read_request decoded)" -gt 20 ]
}

# Decodes a recording natively, and in the same way on Windows.
same_decoding() {
    "$here" decode "$1" >decoded
    axle decode "$1" | cmp - decoded
}

bash .ci/need gcc-mingw-w64-x86-64-win32 wine64
target=x86_64-pc-windows-gnu
# Debian's compiler uses its own target folder, see .ci/cross.
programs=("$CARGO_TARGET_DIR/"{,cross/}"$target/debug/"{axle,rover}.exe)
rm -f "${programs[@]}"
export CARGO_PROFILE_DEV_DEBUG=0
bash .ci/cross $target build --quiet -p axlewire-cli -p host-examples --bin axle --bin rover
bash .ci/cross $target check --quiet -p axlewire --lib --features serialport,tokio
cargo build --quiet -p axlewire-cli --bin axle

FOLDER=$(mktemp -d)
# A prefix of its own, so that no other program under wine is ended.
export FOLDER WINEPREFIX=$FOLDER/prefix WINEDEBUG=-all WINEDLLOVERRIDES=mscoree,mshtml=
clean() {
    end
    timeout 20 "$(find_wine wineserver)" -k >/dev/null 2>&1 || true
    rm -rf "$FOLDER"
}
trap clean EXIT
for program in "${programs[@]}"; do [ ! -e "$program" ] || cp "$program" "$FOLDER"; done
x86_64-w64-mingw32-gcc -shared -o "$FOLDER/bcryptprimitives.dll" examples/axle/tests/windows/random.c -ladvapi32
x86_64-w64-mingw32-gcc -o "$FOLDER/press.exe" examples/axle/tests/windows/press.c
mkdir "$WINEPREFIX"
timeout 120 "$(find_wine wineserver)" -p >/dev/null 2>&1
wine "$FOLDER/axle.exe" --version >/dev/null 2>&1

decode
echo "axle.exe decodes as axle does"
ports
echo "axle.exe scans, turns and stops motors and records on a COM port"
