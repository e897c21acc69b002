#!/usr/bin/env bash
# Makes include/axlewire.h from the documentation and the types of this package.
#
#   examples/c/header.sh           writes it
#   examples/c/header.sh --check   fails if it is not what it would write
#
# Needs cbindgen (`cargo install cbindgen`), which reads the package with its macros expanded.
set -euo pipefail
cd "$(dirname "$0")"
export RUSTC_BOOTSTRAP=1 CARGO_EXPAND_TARGET_DIR=$PWD/../../target/header
made=$CARGO_EXPAND_TARGET_DIR/axlewire.h
mkdir -p "$CARGO_EXPAND_TARGET_DIR"
cbindgen --quiet --config cbindgen.toml --crate axlewire-c --output "$made"
# A negative number in an expression of the user's.
sed -i.bak -E 's/^(#define [A-Z0-9_]+) (-[0-9]+)$/\1 (\2)/' "$made"
case ${1-} in
    --check) diff -u include/axlewire.h "$made" ;;
    *) cp "$made" include/axlewire.h ;;
esac
