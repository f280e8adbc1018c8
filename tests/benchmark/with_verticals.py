#!/usr/bin/env python3
"""Photographs oriented without and with what `megablock verticals` finds in them: images, points, seconds.

usage: with_verticals.py MEGABLOCK DATA [SET ...]    e.g. with_verticals.py build/release/megablock /data lund berlin
"""
import csv
import json
import pathlib
import subprocess
import sys
import tempfile
import time

megablock, data = sys.argv[1], pathlib.Path(sys.argv[2])
sets = sys.argv[3:] or ["lund", "berlin", "brighton_beach", "seneca"]


def call(*arguments):
    start = time.monotonic()
    subprocess.run([megablock, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - start


def figures(project, job):
    seconds = call("run", project, "-j", job, "--quiet")
    status = json.loads(subprocess.check_output([megablock, "status", str(job), "--json"]))
    stages = {stage["name"]: stage["seconds"] for stage in status["stages"]}
    kinds = status["observation_kinds"]
    return status, seconds, stages, kinds


print("| set | verticals | images oriented | points | observations | residual, px | matching, s | orientation, s | whole run, s |")
print("|---|---|---|---|---|---|---|---|---|")
with tempfile.TemporaryDirectory() as folder:
    for name in sets:
        work = pathlib.Path(folder) / name
        work.mkdir()
        project = work / "block.yaml"
        call("init", data / name, "-o", project)
        seconds = call("verticals", project, "-o", work / "verticals.csv")
        with open(work / "verticals.csv") as table:
            found = sum(bool(row["down_x"]) for row in csv.DictReader(table))
        with_verticals = work / "with.yaml"
        with_verticals.write_text(project.read_text() + "verticals: verticals.csv\n")
        for file, said in (project, "none"), (with_verticals, f"{found} in {seconds:.1f} s"):
            status, run_seconds, stages, kinds = figures(file, work / file.stem)
            print(f"| {name} | {said} | {status['oriented']}/{status['images']} | {status['points']} | "
                  f"{status['observations']} | {status['rms_reprojection_px']:.3f} | {stages.get('matching', 0):.1f} | "
                  f"{stages.get('orientation', 0):.1f} | {run_seconds:.1f} |", flush=True)
            if file is with_verticals:
                print(json.dumps(kinds.get("vertical")), file=sys.stderr)
