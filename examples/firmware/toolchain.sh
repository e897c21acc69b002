# Builds for thumbv7em, with the rustup target if it is installed, otherwise with Debian's compiler;
# sourced by the other scripts. Sets `out`, the target folder; `target`, the target's name; `cargo`,
# the build command; `compiler`, its name and version. With INSTALL=no, status 77 if one is missing.
target=thumbv7em-none-eabihf
out=${CARGO_TARGET_DIR:-$PWD/target}
export CARGO_TARGET_DIR=$out CARGO_TERM_COLOR=never

need() { bash ../../.ci/need "$@" || exit 77; }

# Flags, compiler, libraries and wrappers of the caller's build are not meant for this one.
for name in $(compgen -e | grep -E '^(RUSTC|RUSTFLAGS|RUSTDOC|CARGO_(BUILD|ENCODED|LLVM|PROFILE)_|LLVM_PROFILE|__CARGO)'); do
    unset "$name"
done
unset LD_LIBRARY_PATH

command -v qemu-system-arm >/dev/null || need qemu-system-arm
if [ -d "$(rustc --print sysroot)/lib/rustlib/$target" ]; then
    cargo=(cargo build) compiler=$(rustc --version)
else
    need rustc-web cargo-web rust-web-src lld
    RUSTC=$(dpkg -L rustc-web | grep -m1 'bin/rustc$')
    export RUSTC RUSTC_BOOTSTRAP=1 CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER=ld.lld
    cargo=("$(dpkg -L cargo-web | grep -m1 'bin/cargo$')" build -Zbuild-std=core)
    compiler=$("$RUSTC" --version)
fi

# Runs the benchmark image: `name value goal` per figure.
bench_in_qemu() {
    timeout 120 qemu-system-arm -M netduinoplus2 -nographic -icount shift=0 \
        -semihosting-config enable=on,target=native -kernel "$1" </dev/null
}

# Number of bytes in the sections of image $1 whose names match $2. Fails if there is none.
bytes() {
    local sizes
    sizes=$(readelf -SW "$1" | sed 's/^ *\[ *[0-9]*\] *//' | awk -v s="^($2)\$" '$1 ~ s { print "+ 0x" $5 }')
    [ -n "$sizes" ] || { echo "no section of $1 matches $2" >&2; return 1; }
    echo $((0 $sizes))
}
