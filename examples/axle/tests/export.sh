#!/usr/bin/env bash
# Installs the Python modules of the checks here into target/export, builds axle, runs export.py.
#
#   export.sh plot_browser.py    runs that one
#   export.sh --install          only installs
set -euo pipefail
cd "$(dirname "$0")/../../.."
venv=target/export
if ! [ -x $venv/bin/pip ]; then
    python3 -m venv $venv || { bash .ci/need python3-venv && python3 -m venv --clear $venv; }
fi
$venv/bin/pip install --quiet --disable-pip-version-check duckdb==2.0.1 jsonschema==4.26.0 \
    mcap==1.6.0 pandas==3.1.1 playwright==1.65.2 pyarrow==26.0.1
[ "${1:-}" != --install ] || exit 0
if [ -z "${AXLE:-}" ]; then
    cargo build --quiet -p axlewire-cli --all-features
    AXLE=${CARGO_TARGET_DIR:-target}/debug/axle
fi
AXLE=$AXLE exec $venv/bin/python examples/axle/tests/"${1:-export.py}"
