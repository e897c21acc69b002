#!/bin/bash -eu
# Builds all fuzz targets for OSS-Fuzz and ClusterFuzzLite, with a zip of seeds for each.
# Needs $SRC, $OUT, cargo-fuzz, python3 and a nightly toolchain; the base image has them.
cd "$SRC/axlewire"

mode=(-O --debug-assertions)
sanitizer=${SANITIZER:-address}
# A coverage build brings flags of its own and no sanitizer.
[ "$sanitizer" != coverage ] || sanitizer=none
toolchain=${FUZZ_TOOLCHAIN-}

targets=$(cargo fuzz list)
[ -n "$targets" ] || { echo "no fuzz targets" >&2; exit 1; }

# shellcheck disable=SC2086 # no word for the default toolchain
cargo ${toolchain:+"$toolchain"} fuzz build -s "$sanitizer" "${mode[@]}"

host=$(rustc -vV | sed -n 's/^host: //p')
for target in $targets; do
    cp "fuzz/target/$host/release/$target" "$OUT/$target"
    (cd "fuzz/seeds/$target" && python3 -m zipfile -c "$OUT/${target}_seed_corpus.zip" ./*)
    printf '[libfuzzer]\nmax_len = 1024\ntimeout = 20\n' >"$OUT/$target.options"
done
