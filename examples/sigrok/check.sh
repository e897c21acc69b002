#!/usr/bin/env bash
# Checks the sigrok decoders against `axle decode`, on rendered captures with noise.
#
#   examples/sigrok/check.sh             silent but for what was compared
#   examples/sigrok/check.sh --planted   also damages the decoders in many ways; each must be found
#
# Exit code 3: sigrok-cli is missing.
#
# Builds axle, unless AXLE is the path of one. Needs the Debian packages sigrok-cli and
# libsigrokdecode4.
set -euo pipefail
cd "$(dirname "$0")/../.."
if ! command -v sigrok-cli >/dev/null; then
    echo "sigrok-cli is missing: install the Debian packages sigrok-cli and libsigrokdecode4" >&2
    exit 3
fi
if [ -z "${AXLE:-}" ]; then
    cargo build --quiet -p axle --bin axle
    AXLE=${CARGO_TARGET_DIR:-target}/debug/axle
fi
exec python3 examples/sigrok/check.py "$AXLE" "$@"
