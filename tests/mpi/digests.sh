#!/usr/bin/env bash
# Tests that the bits of a result do not depend on the number of ranks and threads. Runs one simulated block on 1, 2, 3
# and 4 ranks (aerial also on 8), and on 1 rank with 1 and 3 threads (as one tile with 1, 2, 3 and 5), and compares the
# digests.
# usage: digests.sh MEGABLOCK aerial|street|rendered|registration FRAMES
# `rendered` makes images, so that features, matches and the initial orientation are compared too. `registration`
# registers a trajectory of that many frames.
set -euo pipefail
megablock=$1 scene=$2 frames=$3
work=$(mktemp -d); trap 'rm -rf "$work"' EXIT
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
if [ "$scene" = rendered ]; then
  "$megablock" simulate --rendered --frames "$frames" --width 400 --image-height 320 --focal 320 -o "$work/block" >/dev/null
  printf 'tiles:\n  tile_max_frames: %d\ncandidates:\n  cell_pairs: 10\nfeatures:\n  max_features: 1500\n' \
    $((frames / 4)) >> "$work/block/block.yaml"
elif [ "$scene" = registration ]; then
  "$megablock" simulate --scene stereopolis --frames "$frames" --street-spacing 60 --points-per-frame 150 \
    --drift-per-frame 0.05 --control-zones 2 -o "$work/block" >/dev/null
else
  "$megablock" simulate --scene "$scene" --frames "$frames" --outliers 0.01 -o "$work/block" >/dev/null
  printf 'tiles:\n  tile_max_frames: %d\n' $((frames / 8)) >> "$work/block/block.yaml"
fi

reference=
compare() {  # NAME COMMAND...: runs the command on a job of its own
  local name=$1; shift
  local digest
  if [ "$scene" = registration ]; then
    digest=$("$@" register "$work/block/block.yaml" -j "$work/$name" --quiet --places-per-unit 4 |
             awk '$1 == "digest" { print $2 }')
    echo "$name: $digest, $(ls "$work/$name/register/pairs" | wc -l) units of places"
  else
    "$@" run "$work/block/block.yaml" -j "$work/$name" --quiet >/dev/null
    digest=$("$megablock" status "$work/$name" --digest)
    echo "$name: $digest, $(ls "$work/$name/adjust" | wc -l) tiles"
  fi
  [ -n "$digest" ] || { echo "no digest"; exit 1; }
  reference=${reference:-$digest}
  [ "$digest" = "$reference" ] || { echo "digest differs"; exit 1; }
  rm -rf "${work:?}/$name"
}
compare ranks-1 "$megablock"
for ranks in 2 3 4 $([ "$scene" = aerial ] && echo 8); do
  compare ranks-$ranks mpirun --bind-to none --oversubscribe --mca mpi_yield_when_idle 1 -n $ranks "$megablock"
done
compare_threads() { "$megablock" "$@" --threads $threads; }
for threads in 1 3; do compare threads-$threads compare_threads; done
if [ "$scene" = aerial ] || [ "$scene" = street ]; then  # one tile, of several cells, on which threads work together
  printf 'tiles:\n  tile_max_frames: %d\n  min_tiles_from: 1000\n' "$frames" > "$work/tile"
  sed -i '/^tiles:$/,$d' "$work/block/block.yaml" && cat "$work/tile" >> "$work/block/block.yaml"
  reference=
  for threads in 1 2 3 5; do compare one-tile-$threads compare_threads; done
fi
