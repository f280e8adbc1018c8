#!/usr/bin/env python3
"""Tests that a run that is killed by SIGKILL at random moments and started again gives the same bits, and computes no
unit twice.

usage: kill_resume.py MEGABLOCK [--kills 10] [--ranks 2] [--rendered | --register | --project FILE] [--seed 4711]

The moments are drawn evenly over the measured length of an undisturbed run. A unit gets its event after its file is
sealed, so a unit with two events was computed again although it existed. A kill may lose the event of a unit that
was just sealed, one per rank.
"""
import argparse
import json
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import time

from sessions import kill_after, kill_all, processes_of, start

LONGEST_RUN_S = 300  # a run that takes longer hangs: its stacks are printed

parser = argparse.ArgumentParser()
parser.add_argument("megablock")
parser.add_argument("--kills", type=int, default=10)
parser.add_argument("--ranks", type=int, default=2)
parser.add_argument("--rendered", action="store_true", help="pictures: features and matches are killed too")
parser.add_argument("--register", action="store_true", help="a trajectory is registered in place of a run")
parser.add_argument("--project", type=pathlib.Path)
parser.add_argument("--seed", type=int, default=4711)
options = parser.parse_args()
COMMAND = ["register", "--places-per-unit", "4"] if options.register else ["run"]


def print_stacks(session):
    if not shutil.which("gdb"):
        return
    for process in processes_of(session):
        subprocess.run(["gdb", "-p", str(process), "-batch", "-ex", "thread apply all bt 12"], stderr=subprocess.STDOUT)


def command(project, job):
    return [options.megablock, *COMMAND, project, "-j", job, "--quiet"]


def run(project, job, log):
    process = start(command(project, job), options.ranks, log)
    try:
        status = process.wait(timeout=LONGEST_RUN_S)
    except subprocess.TimeoutExpired:
        print_stacks(process.pid)
        kill_all(process.pid)
        sys.exit(f"a run of {job} did not end in {LONGEST_RUN_S} s")
    if status != 0:
        sys.exit(f"a run of {job} ended with {status}: {pathlib.Path(log.name).read_text()[-2000:]}")


def events(job):
    found = []
    for path in sorted((job / "events").glob("*.jsonl")):
        for line in path.read_text().splitlines():
            try:
                found.append(json.loads(line))
            except json.JSONDecodeError:
                pass  # the line a kill tore
    return found


def digest(project, job):
    if options.register:  # said by a run that finds everything there
        text = subprocess.check_output(list(map(str, command(project, job))), text=True)
        return next(line.split()[1] for line in text.splitlines() if line.startswith("digest"))
    return subprocess.check_output([options.megablock, "status", str(job), "--digest"], text=True).strip()


with tempfile.TemporaryDirectory() as folder:
    work = pathlib.Path(folder)
    project = options.project
    if project is None:
        scene = (["--scene", "stereopolis", "--frames", "200", "--street-spacing", "60", "--points-per-frame", "150",
                  "--drift-per-frame", "0.05", "--control-zones", "2"] if options.register else
                 ["--rendered", "--frames", "12", "--width", "400", "--image-height", "320", "--focal", "320"]
                 if options.rendered else ["--scene", "aerial", "--frames", "120", "--outliers", "0.01"])
        subprocess.run([options.megablock, "simulate", *scene, "-o", str(work / "block")], check=True,
                       stdout=subprocess.DEVNULL)
        project = work / "block" / "block.yaml"
        with project.open("a") as file:
            file.write("tiles:\n  tile_max_frames: 3\ncandidates:\n  cell_pairs: 10\n" if options.rendered
                       else "tiles:\n  tile_max_frames: 15\n")
    with (work / "log").open("w") as log:
        before = time.monotonic()
        run(project, work / "reference", log)
        length_s = time.monotonic() - before
        moments = random.Random(options.seed)
        for _ in range(options.kills):
            kill_after(command(project, work / "job"), options.ranks, log, length_s * moments.random())
        run(project, work / "job", log)
    wanted = {event["unit"] for event in events(work / "reference")}
    done = [event["unit"] for event in events(work / "job")]
    twice = sorted({unit for unit in done if done.count(unit) > 1})
    unseen = wanted - set(done)
    reference, resumed = digest(project, work / "reference"), digest(project, work / "job")
    print(f"undisturbed {length_s:.1f} s, digest {reference}, {len(wanted)} units; after {options.kills} kills digest "
          f"{resumed}, {len(done)} units computed, {len(twice)} of them twice")
    index = work / "reference/measurements.h5"
    if index.exists() and index.read_bytes() != (work / "job/measurements.h5").read_bytes():
        sys.exit("the index of the measurements by image differs after kills")
    if resumed != reference:
        sys.exit("digest differs after kills")
    if twice:
        sys.exit(f"computed again although finished: {', '.join(twice)}")
    if len(unseen) > options.ranks * options.kills:
        sys.exit(f"without an event: {', '.join(sorted(unseen))}")
