# Builds for thumbv7em: sourced by the scripts beside it, which stand in this folder.
#
# Uses the rustup target where it is installed, otherwise Debian's compiler. QEMU and lld come from
# Debian if they are missing; with INSTALL=no that is an error.
#
# Afterwards `out` is the target folder, `target` the target's name, `cargo` the words of a build,
# `compiler` its name and version.

target=thumbv7em-none-eabihf
out=${CARGO_TARGET_DIR:-$PWD/target}
export CARGO_TARGET_DIR=$out CARGO_TERM_COLOR=never

need() { bash ../../.ci/need "$@" || exit; }

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
