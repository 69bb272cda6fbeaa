#!/usr/bin/env bash
# Whether a change made things slower: builds a base revision and this tree, runs both in turn on the
# same work, and prints CPU time as ratios (this tree over the base) with 95 % confidence intervals.
# Where valgrind is installed also instruction counts, which repeat to the last digits.
#
#   ./bench.sh --compare main [--repeats 12]
set -euo pipefail
cd "$(dirname "$0")"

usage() {
    sed -n '2,6s/^# \{0,1\}//p' "$0" >&2
    exit 2
}

base='' repeats=12
while [ $# -gt 0 ]; do
    case $1 in
        --compare) base=${2:-} && shift 2 || usage ;;
        --repeats) repeats=${2:-} && shift 2 || usage ;;
        *) usage ;;
    esac
done
[ -n "$base" ] && [[ $repeats =~ ^[0-9]+$ ]] && [ "$repeats" -ge 3 ] || usage
commit=$(git rev-parse --verify --quiet "$base^{commit}") || {
    echo "bench.sh: $base is no revision here" >&2
    exit 1
}

work=${CARGO_TARGET_DIR:-$PWD/target}/compare
mkdir -p "$work"
tree=$work/tree
if [ -e "$tree" ]; then
    git -C "$tree" checkout --quiet --detach "$commit"
else
    git worktree add --quiet --detach "$tree" "$commit"
fi
echo "== building $base and this tree"
CARGO_TARGET_DIR=$work/base cargo build --release --quiet --manifest-path "$tree/Cargo.toml"
cargo build --release --quiet
old=$work/base/release/lumigraph
new=${CARGO_TARGET_DIR:-$PWD/target}/release/lumigraph

echo "== scenes"
scenes=$work/scenes
if [ ! -e "$scenes/house" ]; then
    "$old" generate shelf --size 640x480 -o "$scenes/shelf" >/dev/null
    "$old" generate hallway --size 640x480 -o "$scenes/hallway" >/dev/null
    "$old" generate car --size 640x480 -o "$scenes/car" >/dev/null
    "$old" generate house --rooms 6 -o "$scenes/house" >/dev/null
fi

names=(exact-points field-points field-tunnel field-hull walk-ldi)
arguments() {
    local draw="--device cpu --frames $2 -o $work/out"
    case $1 in
        exact-points) echo "render $scenes/shelf --proxy points --renderer exact --path sweep $draw" ;;
        field-points) echo "render $scenes/shelf --proxy points --path sweep $draw" ;;
        field-tunnel) echo "render $scenes/hallway --proxy tunnel --path dolly $draw" ;;
        field-hull) echo "render $scenes/car --proxy hull --path orbit $draw" ;;
        walk-ldi) echo "walk $scenes/house --portals ldi $draw" ;;
    esac
}

# CPU seconds of a run.
TIMEFORMAT='%U %S'
seconds() {
    local spent
    rm -rf "$work/out"
    # The words are options; folders have no spaces that we made.
    # shellcheck disable=SC2086
    spent=$({ time "$1" $2 >/dev/null 2>"$work/log"; } 2>&1) || {
        cat "$work/log" >&2
        exit 1
    }
    awk '{ print $1 + $2 }' <<<"$spent"
}

echo "== $repeats repeats in turn"
for name in "${names[@]}"; do
    line=$(arguments "$name" 16)
    pairs=''
    for ((i = 0; i < repeats; i++)); do
        # Neither always goes first.
        if ((i % 2)); then
            b=$(seconds "$new" "$line") a=$(seconds "$old" "$line")
        else
            a=$(seconds "$old" "$line") b=$(seconds "$new" "$line")
        fi
        pairs+="$a $b"$'\n'
    done
    awk -v name="$name" '
        NF { x = log($2 / $1); n++; sum += x; squares += x * x; old += $1 }
        END {
            mean = sum / n
            spread = sqrt((squares - n * mean * mean) / (n - 1))
            # Student: from 4.3 for three repeats towards 1.96.
            half = (1.96 + 2.4 / (n - 1) + 2.9 / (n - 1) ^ 2.5) * spread / sqrt(n)
            printf "%-14s %7.2f s  %.3f (%.3f to %.3f)\n", name, old / n, exp(mean), \
                exp(mean - half), exp(mean + half)
        }' <<<"$pairs"
done

if command -v valgrind >/dev/null; then
    echo "== instructions, one thread"
    count() {
        rm -rf "$work/out"
        # shellcheck disable=SC2086
        valgrind --tool=callgrind --callgrind-out-file=/dev/null "$1" --threads 1 $2 2>&1 >/dev/null |
            awk '/Collected/ { print $NF }'
    }
    for name in "${names[@]}"; do
        line="$(arguments "$name" 1) --size 160x120"
        a=$(count "$old" "$line") b=$(count "$new" "$line")
        awk -v name="$name" -v a="$a" -v b="$b" \
            'BEGIN { printf "%-14s %14.0f  %.4f\n", name, a, b / a }'
    done
fi
