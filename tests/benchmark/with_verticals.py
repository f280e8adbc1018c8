#!/usr/bin/env python3
"""Photographs oriented without and with what `megablock verticals` finds in them, in turns: images, points, seconds of
each turn. Every second turn begins with verticals, as the first run of a set reads its files from a colder cache. Fails
where fewer images are oriented with verticals, or a street of many takes no less time, finding them included; exits with
77 without the photographs.

usage: with_verticals.py MEGABLOCK DATA [TURNS [SET ...]]    e.g. with_verticals.py build/release/megablock /data 3 lund
"""
import csv
import json
import pathlib
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

megablock, data = sys.argv[1], pathlib.Path(sys.argv[2])
turns = int(sys.argv[3]) if len(sys.argv) > 3 else 1
sets = sys.argv[4:] or ["lund", "berlin", "brighton_beach", "seneca"]
STREETS = {"lund"}
if not (data / sets[0]).is_dir():
    print(f"skipped: no photographs in {data}")
    sys.exit(77)


def call(*arguments):
    start = time.monotonic()
    subprocess.run([megablock, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - start


def figures(project, job):
    seconds = call("run", project, "-j", job, "--quiet")
    status = json.loads(subprocess.check_output([megablock, "status", str(job), "--json"]))
    stages = {stage["name"]: stage["seconds"] for stage in status["stages"]}
    return status, seconds, stages.get("matching", 0)


def listed(seconds):
    return ", ".join(f"{s:.1f}" for s in seconds)


failed = []
print("| set | verticals | oriented | points | observations | rms residual, px | matching, s | whole run, s |")
print("|---|---|---|---|---|---|---|---|")
with tempfile.TemporaryDirectory() as folder:
    for name in sets:
        work = pathlib.Path(folder) / name
        work.mkdir()
        without, beside = work / "block.yaml", work / "with.yaml"
        call("init", data / name, "-o", without)
        beside.write_text(without.read_text() + "verticals: verticals.csv\n")
        finding, status, runs, matching = [], {}, {without: [], beside: []}, {without: [], beside: []}
        for turn in range(turns):
            for project in (without, beside) if turn % 2 == 0 else (beside, without):
                if project is beside:
                    finding.append(call("verticals", without, "-o", work / "verticals.csv"))
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
