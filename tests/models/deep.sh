#!/bin/sh
# Searches every world of tests/models.rs to its full depth and prints the depth, states and time of
# each. Takes about half an hour and 4 GB; MODELS_DEPTH=5 gives all worlds that depth, and
# `deep.sh deep_host deep_robot` searches only those of UCP, in about five minutes.
set -eu
cd "$(dirname "$0")/../.."
exec cargo test --release -p axlewire --test models -- --ignored --nocapture --test-threads 1 "$@"
