#!/usr/bin/env python3
"""Tests that an error of a single rank is printed once, by this rank, and that it ends the others: no rank may wait for
ever.

usage: lone_error.py MEGABLOCK
Rank 1 cannot write its events, because folders have the names of its files for all seconds to come.
"""
import datetime
import os
import pathlib
import subprocess
import sys
import tempfile

megablock = sys.argv[1]
with tempfile.TemporaryDirectory() as folder:
    work = pathlib.Path(folder)
    subprocess.run([megablock, "simulate", "--frames", "12", "-o", str(work / "block")], check=True,
                   stdout=subprocess.DEVNULL)
    now = datetime.datetime.now(datetime.timezone.utc)
    for second in range(300):
        stamp = (now + datetime.timedelta(seconds=second)).strftime("%Y%m%dT%H%M%SZ")
        (work / "job" / "events" / f"{stamp}-1.jsonl").mkdir(parents=True)
    command = ["mpirun", "--bind-to", "none", "--oversubscribe", "--mca", "mpi_yield_when_idle", "1", "-n", "3",
               megablock, "run", str(work / "block" / "block.yaml"), "-j", str(work / "job"), "--quiet"]
    environment = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=240)
    said = [line for line in run.stderr.splitlines() if line.startswith("megablock: ")
            and "stopped" not in line]  # what the others say when they are ended
    print(f"exit {run.returncode}: {said}")
    if run.returncode == 0 or len(said) != 1 or "-1.jsonl" not in said[0]:
        sys.exit(f"expected one line that names the file of rank 1:\n{run.stderr}")
