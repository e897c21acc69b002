#!/usr/bin/env bash
# Makes what people install of the tool, for one target: release.sh TARGET OUT
#
# An archive with the program, man pages, completions and licences; for Linux also a package of
# Debian. With x86_64-, aarch64-unknown-linux-musl and armv7-unknown-linux-musleabihf the program is
# static, and needs nothing of the system.
set -euo pipefail
target=$1
mkdir -p "$2"
out=$(cd "$2" && pwd)
cd "$(dirname "$0")/../.."
build=${CARGO_TARGET_DIR:-$PWD/target}
version=$(cargo pkgid -p axlewire-cli)
version=${version##*[@#]}
name=axle-$version-$target
# No folder of this machine is in the program.
export "CARGO_TARGET_$(tr 'a-z-' 'A-Z_' <<<"$target")_RUSTFLAGS=--remap-path-prefix=$PWD=/axlewire \
    --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}/registry=/cargo"
bash .ci/cross "$target" build --quiet --release --locked -p axlewire-cli --bin axle
# The newest: it may have been built with and without rustup's target.
program=$(ls -t "$build"/{.,cross}/"$target"/release/axle{,.exe} 2>/dev/null | head -1) || [ -n "$program" ]

pages=$(dirname "$program")/pages
rm -rf "$pages"
mkdir -p "$pages/completions"
axle() { cargo run --quiet --bin axle -- "$@"; }
axle man "$pages/man"
axle completions bash >"$pages/completions/axle"
axle completions zsh >"$pages/completions/_axle"
axle completions fish >"$pages/completions/axle.fish"
cp "$program" LICENSE-* "$pages"
# Its links lead to the repository.
there=$(sed -n 's/^repository = "\([^"]*\)".*/\1/p' Cargo.toml)/blob/v$version
sed -E "s#\]\(\.\./\.\./#]($there/#g; s#\]\(\.\./#]($there/examples/#g; s#\]\(([a-z])#]($there/examples/axle/\1#g" \
    examples/axle/README.md | sed "s#$there/examples/axle/https:#https:#g" >"$pages/README.md"
sed -E "s#\]\(([A-Z]+\.md)#]($there/\1#g" CHANGELOG.md >"$pages/CHANGELOG.md"
# The licences of what is linked into it.
command -v cargo-bundle-licenses >/dev/null || cargo install --quiet --locked cargo-bundle-licenses
(cd examples/axle && cargo bundle-licenses --format yaml --output "$pages/LICENSES-OF-DEPENDENCIES.yaml" 2>/dev/null)
rm -rf "${build:?}/$name"
mv "$pages" "$build/$name"
case $target in
*windows*) (cd "$build" && python3 -m zipfile -c "$out/$name.zip" "$name") ;;
# The same bytes for the same content.
*linux*) tar --sort=name --owner=0 --group=0 --numeric-owner --mtime=@0 -C "$build" -c "$name" | gzip -9n >"$out/$name.tar.gz" ;;
*) tar -C "$build" -czf "$out/$name.tar.gz" "$name" ;;
esac
mv "$build/$name" "$pages"
case $target in
*linux*)
    command -v cargo-deb >/dev/null || cargo install --quiet --locked cargo-deb
    CARGO_TARGET_DIR=$(cd "$(dirname "$program")/../.." && pwd) cargo deb --quiet -p axlewire-cli \
        --no-build --no-strip --target "$target" --output "$out/"
    ;;
esac
ls "$out" | grep -F "$target" || true
