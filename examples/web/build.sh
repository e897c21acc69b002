#!/usr/bin/env bash
# Builds the page: one file, OUT/index.html, which needs no network and no server.
#
#   examples/web/build.sh OUT
#   examples/web/build.sh OUT --site    with the docs of the crate and the guide in OUT/doc
#
# Needs Rust, node 20 or later, and for the browser's target either `rustup target add
# wasm32-unknown-unknown` or Debian's compiler, which is installed.
set -euo pipefail
out=$(realpath -m "$1")
cd "$(dirname "$0")"
target=$(realpath -m "${CARGO_TARGET_DIR:-../../target}")
version=$(sed -n 's/^wasm-bindgen = "=\(.*\)"/\1/p' Cargo.toml)
[ "$(wasm-bindgen --version 2>/dev/null)" = "wasm-bindgen $version" ] ||
    cargo install --quiet --debug wasm-bindgen-cli --version "$version" --config profile.dev.debug=0

CARGO_TARGET_DIR=$target bash ../../.ci/cross wasm32-unknown-unknown build --quiet --release
# The newer one: of a target of rustup, or of Debian's compiler.
wasm=wasm32-unknown-unknown/release/axlewire_web.wasm
[ "$target/$wasm" -nt "$target/cross/$wasm" ] && wasm=$target/$wasm || wasm=$target/cross/$wasm
wasm-bindgen --target web --out-dir pkg "$wasm"
npm ci --silent
npx wasm-opt -Oz --converge --enable-bulk-memory --enable-bulk-memory-opt --enable-multivalue \
    --enable-mutable-globals --enable-nontrapping-float-to-int --enable-reference-types \
    --enable-sign-ext --strip-debug --strip-producers --strip-target-features pkg/axlewire_web_bg.wasm \
    -o pkg/axlewire_web_bg.wasm
npx tsc --noEmit
[ "${2-}" != --site ] || export VITE_DOCS=doc/axlewire/index.html
npx vite build --logLevel warn --outDir "$out" --emptyOutDir
[ -z "${VITE_DOCS-}" ] || (cd ../.. &&
    cargo doc --quiet --no-deps --all-features -p axlewire --target-dir "$target/web" &&
    cp -r "$target/web/doc" "$out/doc")
ls -l "$out"
