#!/usr/bin/env bash
# Runs the proof of this package, in an environment of its own: some ten minutes the first time.
#
#   examples/python/check.sh           all of it
#   examples/python/check.sh --quick   only the tests without engines
#
# Needs Rust, Python 3.11 or later with venv, and Java for Spark; for the sanitizers also a nightly
# compiler and clang.
set -euo pipefail
cd "$(dirname "$0")"
target=$(realpath -m "${CARGO_TARGET_DIR:-../../target}")
python=$target/python/bin/python
[ -x "$python" ] || python3 -m venv "$target/python"
export PATH=$target/python/bin:$PATH CARGO_TARGET_DIR=$target/wheel
unset VIRTUAL_ENV
pip=("$python" -m pip install --quiet --disable-pip-version-check)
"${pip[@]}" -r tests/requirements.txt
export VIRTUAL_ENV=$target/python

maturin develop --quiet --release
if [ "${1-}" = --quick ]; then
    exec "$python" -m pytest -q tests/test_bytes.py tests/test_capture.py tests/test_live.py
fi

echo "== lints and types"
"${pip[@]}" -r tests/engines.txt
cargo fmt --check
cargo clippy --quiet -- -D warnings
./stubs.sh --check
mypy --strict axlewire tests/typed_program.py
pyright --pythonpath "$python" axlewire tests/typed_program.py

echo "== tests"
"$python" -m pytest -q tests

echo "== the notebook"
jupyter execute docs/tour.ipynb

echo "== the wheel, in an environment of its own"
fresh=$(mktemp -d)
trap 'rm -rf "$fresh"' EXIT
"$python" -m pip wheel --quiet --no-deps --wheel-dir "$fresh" .
ls -l "$fresh"/*.whl
[ "$(stat -c %s "$fresh"/*.whl)" -lt 6000000 ]
python3 -m venv "$fresh/venv"
"$fresh/venv/bin/pip" install --quiet --disable-pip-version-check "$fresh"/*.whl
(cd "$fresh" && venv/bin/python -c '
import axlewire, sys
assert "site-packages" in axlewire.__file__
capture = axlewire.read(sys.argv[1])
assert len(capture["report"]) == 849, capture
' "$OLDPWD/../captures/drive.pcapng")

echo "== the address sanitizer"
RUSTFLAGS=-Zsanitizer=address cargo +nightly build --quiet --target x86_64-unknown-linux-gnu \
    --no-default-features --features abi3 --target-dir "$target/asan"
cp -r axlewire "$fresh/axlewire"
cp "$target/asan/x86_64-unknown-linux-gnu/debug/libaxlewire_python.so" \
    "$fresh/axlewire/_axlewire.abi3.so"
preload=$(clang -print-file-name=libclang_rt.asan-x86_64.so)
tests=$PWD/tests
cd "$fresh"
LD_PRELOAD=$preload ASAN_OPTIONS=detect_leaks=0 PYTHONPATH=$fresh "$python" -c '
import axlewire, sys
assert axlewire.__file__.startswith(sys.argv[1]), axlewire.__file__
' "$fresh"
LD_PRELOAD=$preload ASAN_OPTIONS=detect_leaks=0 PYTHONPATH=$fresh \
    "$python" -m pytest -q -p no:cacheprovider -k 'not constant_memory' \
    "$tests/test_bytes.py" "$tests/test_capture.py"
