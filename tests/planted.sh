#!/usr/bin/env bash
# Whether tests catch faults: some are planted one by one (render/src/planted.rs), and for each some
# test that is named here must fail. Where none does, the tests are not worth much.
set -euo pipefail
cd "$(dirname "$0")/.."

log=$(mktemp)
trap 'rm -f "$log"' EXIT

# The fault, then what `cargo test --workspace` is to run.
caught() {
    local fault=$1
    shift
    if LUMIGRAPH_PLANTED=$fault cargo test --workspace "$@" >"$log" 2>&1; then
        echo "$fault: no test of \"$*\" notices" >&2
        exit 1
    fi
    # A build that fails catches nothing.
    if ! grep -q '^test result: FAILED' "$log"; then
        cat "$log" >&2
        exit 1
    fi
    echo "$fault: caught by $(grep -c '^test .* FAILED$' "$log") of" \
        "$(grep -c '^test .* \.\.\. ' "$log") tests of \"$*\""
}

caught shifted-field --test pictures near::a_triangulated
caught turned-penalty --test pictures goals::resolution
caught missing-constraint --lib triangulation::
caught front-to-back --test pictures ldi_order::
caught dropped-view --test pictures -- near::the_field near::pictures
