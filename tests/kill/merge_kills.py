#!/usr/bin/env python3
"""Tests that the merge gives the same digest on 1, 2, 3, 4 and 8 ranks, and after ten SIGKILLs at random moments.

usage: merge_kills.py MEGABLOCK [--kills 10] [--seed 4711]

Everything before the merge is computed once. Every second kill ends only one rank: the others must end by
themselves, and no sealed file may be lost. A run that ends before its moment starts again from the tiles.
"""
import argparse
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from sessions import kill_all, processes_of, start

parser = argparse.ArgumentParser()
parser.add_argument("megablock")
parser.add_argument("--kills", type=int, default=10)
parser.add_argument("--seed", type=int, default=4711)
options = parser.parse_args()
LONGEST_S = 120  # of a run
LEFT_S = 30  # until the others end when a rank is gone


def digest(job):
    return subprocess.check_output([options.megablock, "status", job, "--digest"], text=True).strip()


def ranks_of(session):
    found = []
    for process in processes_of(session):
        try:
            program = os.readlink(f"/proc/{process}/exe")
        except OSError:
            continue  # gone
        if program == os.path.realpath(options.megablock):
            found.append(process)
    return found


with tempfile.TemporaryDirectory() as folder:
    work = pathlib.Path(folder)
    subprocess.run([options.megablock, "simulate", "--frames", "160", "--points-per-frame", "200", "--outliers", "0.01",
                    "-o", work / "block"], check=True, stdout=subprocess.DEVNULL)
    project = work / "block/block.yaml"
    with project.open("a") as file:
        file.write("tiles: {tile_max_frames: 15}\nmerge: {decrement: 1e-7}\n")
    subprocess.run([options.megablock, "adjust", project, "-j", work / "adjusted", "--quiet"], check=True,
                   stdout=subprocess.DEVNULL)
    log = (work / "log").open("w")

    def fresh(name):
        shutil.rmtree(work / name, ignore_errors=True)
        shutil.copytree(work / "adjusted", work / name)
        return work / name

    def begin(job, ranks, *more):
        return start([options.megablock, "run", project, "-j", job, "--threads", "1", *more], ranks, log)

    def finish(job, ranks):
        if begin(job, ranks, "--quiet").wait(timeout=LONGEST_S) != 0:
            sys.exit(f"a run on {ranks} ranks failed: {(work / 'log').read_text()[-2000:]}")
        return digest(job)

    found = {}
    for ranks in (1, 2, 3, 4, 8):
        before = time.monotonic()
        found[ranks] = finish(fresh("ranks"), ranks)
        if ranks == 2:
            length_s = time.monotonic() - before
    print(f"digests by ranks: {found}; {length_s:.1f} s on two")
    if len(set(found.values())) != 1:
        sys.exit("digest differs")

    def checkpoints(job):
        try:
            return set((job / "merge").glob("*/iteration.bin"))
        except FileNotFoundError:  # the run has ended, and the folder is gone while it is looked at
            return set()

    moments = random.Random(options.seed)
    job, kills, resumed, finished, left_s = fresh("killed"), 0, 0, 0, []
    while kills < options.kills:
        there = checkpoints(job)
        run = begin(job, 2, "--record", "0")  # of every subtree that is done, so that runs resume within a sweep
        try:
            if moments.random() < 0.75:  # behind the next checkpoint, however fast or busy the machine
                while run.poll() is None and checkpoints(job) <= there:
                    time.sleep(0.001)
                run.wait(timeout=0.1 * length_s * moments.random())
            else:
                run.wait(timeout=length_s * moments.uniform(0.1, 1))
        except subprocess.TimeoutExpired:
            kills += 1
            resumed += bool(there)
            own = ranks_of(run.pid)
            if kills % 2 == 0 and own:
                os.kill(moments.choice(sorted(own)), signal.SIGKILL)
                begun = time.monotonic()
                try:
                    code = run.wait(timeout=LEFT_S)
                except subprocess.TimeoutExpired:
                    kill_all(run.pid)
                    sys.exit(f"the others still waited {LEFT_S} s after one rank was killed")
                left_s.append(time.monotonic() - begun)
                if code == 0 and not (job / "result/block.h5").exists():
                    sys.exit("a run without one of its ranks ended with 0")
            kill_all(run.pid)
            run.wait()
            continue
        finished += 1
        if digest(job) != found[1]:
            sys.exit("digest differs after kills")
        job = fresh("killed")
    last = finish(job, 2)
    tiles = [int(n) for n in re.findall(r"resumes within a sweep: (\d+) tiles", (work / "log").read_text())]
    print(f"{kills} kills, {resumed} runs went on from a checkpoint, {len(tiles)} within a sweep with {tiles} of its tiles "
          f"done, {finished + 1} came to their end, digest {last}; "
          f"without a rank the others ended in at most {max(left_s, default=0):.1f} s")
    if last != found[1]:
        sys.exit("digest differs after kills")
    if resumed < max(1, kills // 3):
        sys.exit(f"only {resumed} of {kills} runs went on from a checkpoint")
    if len(tiles) < max(1, kills // 5):
        sys.exit(f"only {len(tiles)} of {kills} runs resumed within a sweep")
