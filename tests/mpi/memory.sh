#!/usr/bin/env bash
# Tests that the merge gives the same bits with tiles and factors in memory, on the scratch disk, or (factors) computed
# again, on one rank and on three. The messages of the run prove that each way was used. With 'full', the scratch disk
# becomes full during the run instead (skipped with 77 without the permission to mount one).
# usage: memory.sh MEGABLOCK [full]
set -euo pipefail
megablock=$1
work=$(mktemp -d); trap 'umount "$work/full/scratch" 2>/dev/null || true; rm -rf "$work"' EXIT
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
"$megablock" simulate --scene aerial --frames 160 --outliers 0.01 -o "$work/block" >/dev/null
printf 'tiles:\n  tile_max_frames: 20\n' >> "$work/block/block.yaml"
"$megablock" run "$work/block/block.yaml" -j "$work/reference" --quiet >/dev/null
reference=$("$megablock" status "$work/reference" --digest)

# run NAME RANKS PATTERN SWITCHES...: the same digest, and a line that fits the pattern
run() {
  local name=$1 ranks=$2 pattern=$3; shift 3
  mpirun --bind-to none --oversubscribe --mca mpi_yield_when_idle 1 -n "$ranks" \
    "$megablock" run "$work/block/block.yaml" -j "$work/$name" "$@" >/dev/null 2>"$work/$name.log"
  local line digest
  line=$(grep -o '[0-9]* of [0-9]* tiles in scratch; factors: .*' "$work/$name.log")
  digest=$("$megablock" status "$work/$name" --digest)
  echo "$name: $digest, $line"
  [ "$digest" = "$reference" ] || { echo "digest differs, $reference in memory"; exit 1; }
  [[ $line =~ $pattern ]] || { echo "expected: $pattern"; exit 1; }
  [ -z "$(ls -A "$work/$name/scratch" 2>/dev/null)" ] || { echo "files left in scratch"; exit 1; }
}
if [ "${2:-}" = full ]; then
  "$megablock" adjust "$work/block/block.yaml" -j "$work/full" --quiet >/dev/null
  mkdir -p "$work/full/scratch"
  # Room for the tiles and a third of the factors.
  mount -t tmpfs -o size=2500k tmpfs "$work/full/scratch" 2>/dev/null || { echo "no right to mount a tmpfs"; exit 77; }
  run full 2 ' [1-9][0-9]* spilled .* [1-9][0-9]* subtrees' --memory 0.2
  exit
fi
run kept 1 '^0 of .* 0 spilled .* 0 subtrees'
run spilled_1 1 '^[1-9].* [1-9][0-9]* spilled .* 0 subtrees' --memory 0.2
run spilled_3 3 '^[1-9].* [1-9][0-9]* spilled .* 0 subtrees' --memory 0.2
run recomputed_1 1 '^0 of .* 0 spilled .* [1-9][0-9]* subtrees' --memory 0.2 --scratch 0
run recomputed_3 3 '^0 of .* 0 spilled .* [1-9][0-9]* subtrees' --memory 0.2 --scratch 0
run both_2 2 ' [1-9][0-9]* spilled .* [1-9][0-9]* subtrees' --memory 0.2 --scratch 1
