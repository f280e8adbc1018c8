#!/usr/bin/env python3
"""Orients real images from above in turns with and without `matching.by_turn` (matching by the rotation of each pair),
and prints images, points, and seconds of whole runs by the wall clock and of the processor. Fails if `by_turn` orients
fewer images or saves no processor time. Exits with 77 without the images.

usage: by_turn.py MEGABLOCK DATA [TURNS [SET ...]]    e.g. by_turn.py build/release/megablock /data 3 brighton_beach
"""
import shutil
import statistics
import sys

from photograph_sets import TURNS, call, listed, projects, status_of

failed = []
print("| set | by turn | oriented | points | observations | mean residual, px | whole run, s | processor time, s |")
print("|---|---|---|---|---|---|---|---|")
for name, work, by_turn in projects("brighton_beach", "seneca"):
    in_full, job = work / "full.yaml", work / "job"
    in_full.write_text(by_turn.read_text() + "matching: {by_turn: false}\n")
    status, times = {}, {by_turn: [], in_full: []}
    for turn in range(TURNS):
        for project in (in_full, by_turn) if turn % 2 == 0 else (by_turn, in_full):
            times[project].append(call("run", project, "-j", job, "--threads", 2, "--quiet"))
            status[project] = status_of(job)
            shutil.rmtree(job)
    for project, said in (in_full, "no"), (by_turn, "yes"):
        now, (clock, processor) = status[project], zip(*times[project])
        print(f"| {name} | {said} | {now['oriented']}/{now['images']} | {now['points']} | {now['observations']} | "
              f"{now['mean_reprojection_px']:.3f} | {listed(clock)} | {listed(processor)} |", flush=True)
    if status[by_turn]["oriented"] < status[in_full]["oriented"]:
        failed.append(f"{name}: fewer images are oriented by turn")
    spent, spent_in_full = (statistics.median(s for _, s in times[project]) for project in (by_turn, in_full))
    if spent >= spent_in_full:
        failed.append(f"{name}: no less processor time by turn")
sys.exit("; ".join(failed) or 0)
