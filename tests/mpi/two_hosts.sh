#!/usr/bin/env bash
# Tests that a job gives the same bits on two simulated hosts. These are network namespaces with their own host names,
# joined by a bridge, so that ranks communicate only by TCP. No claim of a unit may wait longer than 0.1 s, and each of
# the N ranks must do at least 1 / (2 N) of the units.
# usage: two_hosts.sh MEGABLOCK [PROJECT]    needs root and iproute2; skips (77) where namespaces are not allowed
set -euo pipefail
megablock=$1 project=${2:-}
work=$(mktemp -d)
tag=mb$$ bridge=br$$
clean_up() {
  for i in 1 2; do
    ip netns pids $tag-$i 2>/dev/null | xargs -r kill -KILL 2>/dev/null || true
    ip netns del $tag-$i 2>/dev/null || true
    rm -rf /etc/netns/$tag-$i
  done
  ip link del $bridge 2>/dev/null || true
  rm -rf "$work"
}
trap clean_up EXIT
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1

ip link add $bridge type bridge 2>/dev/null && ip netns add $tag-1 2>/dev/null ||
  { echo "skipped: network namespaces need root"; exit 77; }
ip netns add $tag-2
ip link set $bridge up
ip addr add 10.77.0.1/24 dev $bridge
printf '127.0.0.1 localhost\n10.77.0.1 %s\n10.77.0.11 %s-1\n10.77.0.12 %s-2\n' "$(hostname)" $tag $tag > "$work/hosts"
for i in 1 2; do
  ip link add v$i-$$ type veth peer name eth0 netns $tag-$i
  ip link set v$i-$$ master $bridge up
  ip -n $tag-$i addr add 10.77.0.1$i/24 dev eth0
  ip -n $tag-$i link set eth0 up
  ip -n $tag-$i link set lo up
  mkdir -p /etc/netns/$tag-$i
  cp "$work/hosts" /etc/netns/$tag-$i/hosts
done
# How mpirun starts its daemon on a "host".
cat > "$work/agent" <<'AGENT'
#!/bin/bash
host=$1; shift
exec ip netns exec "$host" unshare --uts bash -c 'hostname "$0"; exec bash -c "$1"' "$host" "$*"
AGENT
chmod +x "$work/agent"

if [ -z "$project" ]; then
  "$megablock" simulate --scene aerial --frames 240 --outliers 0.01 -o "$work/block" >/dev/null
  printf 'tiles:\n  tile_max_frames: 20\n' >> "$work/block/block.yaml"
  project=$work/block/block.yaml
fi
"$megablock" run "$project" -j "$work/reference" --quiet >/dev/null
reference=$("$megablock" status "$work/reference" --digest)
ip netns exec $tag-1 unshare --uts bash -c "hostname $tag-1; mpirun --mca plm_rsh_agent $work/agent --mca btl tcp,self \
  --mca btl_tcp_if_include eth0 --mca oob_tcp_if_include eth0 --bind-to none --mca mpi_yield_when_idle 1 \
  --host $tag-1:1,$tag-2:1 -n 2 $megablock run $project -j $work/job --threads 1 --quiet" >/dev/null
digest=$("$megablock" status "$work/job" --digest)
echo "one host $reference, two hosts $digest"
[ "$digest" = "$reference" ] || { echo "digest differs on two hosts"; exit 1; }
python3 - "$work/job" <<'PYTHON'
import json, pathlib, sys
events = [json.loads(line) for path in sorted(pathlib.Path(sys.argv[1], "events").glob("*.jsonl"))
          for line in path.read_text().splitlines()]
claimed = [event for event in events if event["stage"] != "merge"]
share = [sum(event["rank"] == rank for event in claimed) for rank in (0, 1)]
longest = max(event["claim_seconds"] for event in claimed)
print(f"units claimed by the ranks {share}, longest claim {longest * 1000:.1f} ms")
if longest > 0.1: sys.exit("a claim waited longer than 0.1 s")
if min(share) * 4 < len(claimed): sys.exit("a rank did less than a quarter of the units")
PYTHON
