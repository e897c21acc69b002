#!/bin/sh
# Searches every world of tests/models.rs to its full depth and prints depth, states and time of
# each. Takes about half an hour and 4 GB; MODELS_DEPTH=5 makes all worlds alike, and
# `deep.sh deep_host deep_robot` searches those of UCP alone, in some five minutes.
set -eu
cd "$(dirname "$0")/../.."
exec cargo test --release -p axlewire --test models -- --ignored --nocapture --test-threads 1 "$@"
