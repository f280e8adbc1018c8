#!/usr/bin/env bash
# Same bits for any number of ranks: runs one simulated block on 1, 2, 3 and 4 ranks and compares the digests.
# usage: digests.sh MEGABLOCK SCENE FRAMES
set -euo pipefail
megablock=$1 scene=$2 frames=$3
work=$(mktemp -d); trap 'rm -rf "$work"' EXIT
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
"$megablock" simulate --scene "$scene" --frames "$frames" --outliers 0.01 -o "$work/block" >/dev/null
printf 'tiles:\n  tile_max_frames: %d\n' $((frames / 8)) >> "$work/block/block.yaml"
"$megablock" run "$work/block/block.yaml" -j "$work/job1" --quiet
reference=$("$megablock" status "$work/job1" --digest)
echo "1 rank: $reference"
for ranks in 2 3 4; do
  mpirun --bind-to none --oversubscribe --mca mpi_yield_when_idle 1 -n $ranks \
    "$megablock" run "$work/block/block.yaml" -j "$work/job$ranks" --quiet
  digest=$("$megablock" status "$work/job$ranks" --digest)
  echo "$ranks ranks: $digest"
  [ "$digest" = "$reference" ] || { echo "digest differs on $ranks ranks"; exit 1; }
done
