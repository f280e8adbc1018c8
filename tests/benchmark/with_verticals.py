#!/usr/bin/env python3
"""Orients real images in turns without and with the verticals that `megablock verticals` finds, and prints images,
points and seconds of each turn. Every second turn begins with verticals, because the first run of a set reads its files
from a colder cache. Fails if fewer images are oriented with verticals, or if a street of many images takes no less
time, including the search for verticals. Exits with 77 without the images.

usage: with_verticals.py MEGABLOCK DATA [TURNS [SET ...]]    e.g. with_verticals.py build/release/megablock /data 3 lund
"""
import csv
import shutil
import statistics
import sys

from photograph_sets import TURNS, call, listed, projects, status_of

STREETS = {"lund"}


def figures(project, job):
    seconds, _ = call("run", project, "-j", job, "--quiet")
    status = status_of(job)
    stages = {stage["name"]: stage["seconds"] for stage in status["stages"]}
    return status, seconds, stages.get("matching", 0)


failed = []
print("| set | verticals | oriented | points | observations | rms residual, px | matching, s | whole run, s |")
print("|---|---|---|---|---|---|---|---|")
for name, work, without in projects("lund", "berlin", "brighton_beach", "seneca"):
    beside = work / "with.yaml"
    beside.write_text(without.read_text() + "verticals: verticals.csv\n")
    finding, status, runs, matching = [], {}, {without: [], beside: []}, {without: [], beside: []}
    for turn in range(TURNS):
        for project in (without, beside) if turn % 2 == 0 else (beside, without):
            if project is beside:
                (work / "verticals.csv.found").unlink(missing_ok=True)  # otherwise the images would not be read again
                finding.append(call("verticals", without, "-o", work / "verticals.csv")[0])
            job = work / f"{project.stem}{turn}"
            status[project], seconds, of_matching = figures(project, job)
            runs[project].append(seconds)
            matching[project].append(of_matching)
            shutil.rmtree(job)
    with open(work / "verticals.csv") as table:
        found = sum(bool(row["down_x"]) for row in csv.DictReader(table))
    for project, said in (without, "without"), (beside, f"{found} ({listed(finding)} s)"):
        now = status[project]
        print(f"| {name} | {said} | {now['oriented']}/{now['images']} | {now['points']} | {now['observations']} | "
              f"{now['rms_reprojection_px']:.3f} | {listed(matching[project])} | {listed(runs[project])} |", flush=True)
    if status[beside]["oriented"] < status[without]["oriented"]:
        failed.append(f"{name}: fewer images are oriented with verticals")
    whole = statistics.median(runs[beside]) + statistics.median(finding)
    if name in STREETS and whole >= statistics.median(runs[without]):
        failed.append(f"{name}: no less time with verticals")
sys.exit("; ".join(failed) or 0)
