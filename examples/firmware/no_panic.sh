#!/usr/bin/env bash
# Proves that no panic is reachable in a program, or prints where one is.
#
#   examples/firmware/no_panic.sh PROGRAM ...   builds each so that it links only without panics
#   examples/firmware/no_panic.sh --self-test   checks that a planted panic is found in this way
#
# PROGRAM is ikeya_slave, ikeya_master, ucp_robot, or no_panic, which calls everything in the crate.
# Optimized as shipped: whatever the compiler cannot rule out counts as reachable.
set -euo pipefail
cd "$(dirname "$0")"
[ $# -gt 0 ] || { sed -n '4,8s/^# \?//p' "$0" >&2; exit 2; }
. ./toolchain.sh

# link FEATURE PROGRAM [ARGUMENT OF THE LINKER]
link() {
    "${cargo[0]}" rustc "${cargo[@]:2}" --quiet --locked --release --features "$1" --bin "$2" -- ${3:+-C link-arg="$3"}
}

objdump=$(command -v llvm-objdump || command -v arm-none-eabi-objdump || true)

# Links a program with its panics, and prints the functions that call one.
where_in() {
    [ -n "$objdump" ] || return 0
    link no-panic "$1" --defsym=a_panic_can_be_reached=0 || return 0
    "$objdump" -d --demangle "$out/$target/release/$1" | awk '
        /^[0-9a-f]+ <[^$].*>:$/ { caller = substr($0, index($0, "<")) }
        /[ \t](bl|b|b\.w|b\.n)[ \t].*<core::[a-z_:]*(panic|fail)/ && caller !~ /^<core::/ {
            sub(/.*<core/, "<core"); sub(/>.*/, ">"); print "  " caller " " $0
        }
    ' | sort -u
}

if [ "$1" = --self-test ]; then
    # As any other program is checked; a good one after it changes nothing. It must fail because of
    # the panic, not for another reason, and name the function.
    status=0
    said=$(./no_panic.sh planted_panic ikeya_slave 2>&1) || status=$?
    where=planted_panic::planted
    [ -n "$objdump" ] || where=
    [ $status = 1 ] && [[ $said == "planted_panic can panic:"*"$where"* && $said != *ikeya_slave* ]] && exit
    echo "the planted panic: status $status, $said" >&2
    exit 1
fi

failed=0
for program in "$@"; do
    said=$(link no-panic "$program" 2>&1) && continue
    failed=1
    if grep -q 'undefined.*a_panic_can_be_reached' <<<"$said"; then
        echo "$program can panic:" >&2
        where_in "$program" >&2
    else
        echo "$said" >&2
    fi
done
exit $failed
