#!/usr/bin/env python3
"""What all ranks refuse alike is said once, whatever the command, with the exit code of bad input.

usage: refusals.py MEGABLOCK
"""
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
    wrong = []
    for arguments, words in (
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
            (["registr"], "unknown command")):
        run = subprocess.run([*ranks, *map(str, arguments)], env=environment, capture_output=True, text=True,
                             timeout=240)
        said = [line for line in run.stderr.splitlines() if line.startswith("megablock: ")]
        print(f"{arguments[0]}: exit {run.returncode}: {said}")
        if run.returncode != BAD_INPUT or len(said) != 1 or words not in said[0]:
            wrong.append(f"{arguments}: expected exit code {BAD_INPUT} and one line with '{words}':\n{run.stderr}")
    if wrong:
        sys.exit("\n".join(wrong))
