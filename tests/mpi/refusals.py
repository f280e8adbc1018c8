#!/usr/bin/env python3
"""Tests that an error that all ranks find is printed once, by every command, with the exit code of bad input.

usage: refusals.py MEGABLOCK
"""
import concurrent.futures
import os
import pathlib
import subprocess
import sys
import tempfile

BAD_INPUT = 2
megablock = sys.argv[1]
ranks = ["mpirun", "--bind-to", "none", "--oversubscribe", "--mca", "mpi_yield_when_idle", "1", "-n", "2", megablock]
environment = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")

with tempfile.TemporaryDirectory() as folder:
    work = pathlib.Path(folder)
    subprocess.run([megablock, "simulate", "--frames", "12", "-o", str(work / "block")], check=True,
                   stdout=subprocess.DEVNULL)
    project, refracted, job = work / "block/block.yaml", work / "block/refracted.yaml", work / "job"
    refracted.write_text(project.read_text() + "environment:\n  refraction: true\n")
    register, calibrate = ["register", project, "-j", job], ["calibrate", project, "-o", job]
    refusals = (
        ([*register, "--min-frames", "9"], "frames"),
        (["register", refracted, "-j", job], "environment.refraction: 'register'"),
        (["register", work / "no.yaml", "-j", job], "no such project file"),
        ([*register, "--nonsense"], "--nonsense"),
        ([*calibrate, "--held-out", "2"], "held"),
        (["calibrate", refracted, "-o", work / "calibration"], "environment.refraction: 'calibrate'"),
        (["calibrate", work, "--panoramic", "-o", job], "no job directory"),
        (["run", work / "no.yaml", "-j", job], "no such project file"),
        (["resect", project, "-o", work / "x.csv", "--min-points", "1"], "points"),
        (["status", work / "nowhere"], "is not a job directory"),
        (["registr"], "unknown command"))

    def refuse(number):
        """What one of them says, on a job of its own, and what is wrong with it."""
        arguments, words = refusals[number]
        arguments = [str(work / f"job_{number}" if argument is job else argument) for argument in arguments]
        run = subprocess.run([*ranks, *arguments], env=environment, capture_output=True, text=True, timeout=240)
        said = [line for line in run.stderr.splitlines() if line.startswith("megablock: ")]
        right = run.returncode == BAD_INPUT and len(said) == 1 and words in said[0]
        return (f"{arguments[0]}: exit {run.returncode}: {said}", "" if right else
                f"{arguments}: expected exit code {BAD_INPUT} and one line with '{words}':\n{run.stderr}")

    # Some at a time: ranks that start and end mostly wait.
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(refuse, range(len(refusals))))
    print("\n".join(said for said, _ in answers))
    if wrong := "\n".join(wrong for _, wrong in answers if wrong):
        sys.exit(wrong)
