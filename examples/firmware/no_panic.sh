#!/usr/bin/env bash
# Proves that no panic is reachable in a program, or prints where one is.
#
#   examples/firmware/no_panic.sh PROGRAM ...   builds each so that it links only without panics
#
# Optimized as shipped: whatever the compiler cannot rule out counts as reachable. The program
# no_panic calls everything in the crate.
set -euo pipefail
cd "$(dirname "$0")"
[ $# -gt 0 ] || { sed -n '4p' "$0" >&2; exit 2; }
. ./toolchain.sh

# link PROGRAM [ARGUMENT OF THE LINKER]
link() {
    "${cargo[0]}" rustc "${cargo[@]:2}" --quiet --locked --release --features no-panic --bin "$1" -- ${2:+-C link-arg="$2"}
}

# Links a program with its panics, and prints the functions that call one.
where_in() {
    local objdump
    objdump=$(command -v llvm-objdump || command -v arm-none-eabi-objdump) || return 0
    link "$1" --defsym=a_panic_can_be_reached=0 || return 0
    "$objdump" -d --demangle "$out/$target/release/$1" | awk '
        /^[0-9a-f]+ <[^$].*>:$/ { caller = substr($0, index($0, "<")) }
        /[ \t](bl|b|b\.w|b\.n)[ \t].*<core::[a-z_:]*(panic|fail)/ && caller !~ /^<core::/ {
            sub(/.*<core/, "<core"); sub(/>.*/, ">"); print "  " caller " " $0
        }
    ' | sort -u
}

for program in "$@"; do
    said=$(link "$program" 2>&1) && continue
    grep -q 'undefined.*a_panic_can_be_reached' <<<"$said" || { echo "$said" >&2; exit 1; }
    echo "$program can panic:" >&2
    where_in "$program" >&2
    exit 1
done
