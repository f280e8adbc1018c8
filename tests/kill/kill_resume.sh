#!/usr/bin/env bash
# A run killed by SIGKILL at random moments and started again gives the same bits, and no unit is computed twice unless
# it was in hand at a kill. usage: kill_resume.sh MEGABLOCK KILLS [PROJECT]
# Moments are drawn evenly over the measured length of an undisturbed run, from a fixed seed.
set -euo pipefail
megablock=$1 kills=$2 project=${3:-}
work=$(mktemp -d); trap 'rm -rf "$work"' EXIT
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
mpi="mpirun --bind-to none --oversubscribe --mca mpi_yield_when_idle 1 -n 2"
if [ -z "$project" ]; then
  "$megablock" simulate --scene aerial --frames 240 --outliers 0.01 -o "$work/block" >/dev/null
  printf 'tiles:\n  tile_max_frames: 30\n' >> "$work/block/block.yaml"
  project=$work/block/block.yaml
fi
start=$(date +%s.%N)
$mpi "$megablock" run "$project" -j "$work/reference" --quiet
length=$(echo "$(date +%s.%N) - $start" | bc)
reference=$("$megablock" status "$work/reference" --digest)
units=$(cat "$work"/reference/events/*.jsonl | wc -l)

RANDOM=4711
for i in $(seq "$kills"); do
  moment=$(echo "scale=3; $length * $((RANDOM % 1000)) / 1000" | bc)
  setsid $mpi "$megablock" run "$project" -j "$work/job" --quiet >/dev/null 2>&1 &
  group=$!
  # The moment is the point of this test: a kill at a random time.
  read -r -t "$moment" < <(tail -f /dev/null) || true
  kill -KILL -- -$group 2>/dev/null || true
  pkill -KILL -f "run $project -j $work/job" 2>/dev/null || true
  wait $group 2>/dev/null || true
done
$mpi "$megablock" run "$project" -j "$work/job" --quiet
digest=$("$megablock" status "$work/job" --digest)
done_units=$(cat "$work"/job/events/*.jsonl | wc -l)
echo "reference $reference ($units units computed), after $kills kills $digest ($done_units units computed)"
[ "$digest" = "$reference" ] || { echo "digest differs after kills"; exit 1; }
# Each kill can lose the units in hand (one a rank) once more, and one line of the events each.
[ "$done_units" -le $((units + 4 * kills)) ] || { echo "finished units were computed again"; exit 1; }
