#!/usr/bin/env bash
# Builds the page if it is not there, and serves it.
#
#   examples/web/run.sh [PORT]
set -euo pipefail
cd "$(dirname "$0")"
page=$(realpath -m "${CARGO_TARGET_DIR:-../../target}/web/page")
[ -e "$page/index.html" ] || ./build.sh "$page"
port=${1:-8080}
echo "http://127.0.0.1:$port/ (or open $page/index.html); Ctrl-C ends it"
exec python3 -m http.server --bind 127.0.0.1 --directory "$page" "$port" 2>/dev/null
