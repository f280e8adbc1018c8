#!/usr/bin/env python3
"""Tests the effect of signals on a run: it must end soon, say so, and keep its finished units.
usage: signals.py MEGABLOCK

The time until a run ends is measured, so nothing else should run on the computer.
"""
import contextlib
import os
import pty
import re
import shutil
import signal
import subprocess
import time
import unittest

from program import DONE, FAILED_UNITS, INTERRUPTED, MEGABLOCK, megablock, status
from small_block import CopyOfTheBlock, setUpModule, tearDownModule, work


class Signals(CopyOfTheBlock):
    def test_sigterm_in_every_stage(self):
        reference = status(work / "clean_job")["digest"]
        begun = {"features": "job.json", "candidates": "features/000000.h5", "matching": "graph.h5",
                 "tracks": "matches/000000.h5", "orientation": "tracks/index.txt", "adjustment": "orient/000000.h5",
                 "merge": "adjust/000000.h5"}
        for stage, sign in begun.items():
            job = self.folder / f"job_{stage}"
            run = subprocess.Popen([MEGABLOCK, "run", self.project, "-j", job, "-q"], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
            while not (job / sign).exists() and run.poll() is None:
                time.sleep(0.002)
            run.send_signal(signal.SIGTERM)
            asked = time.monotonic()
            code = run.wait()
            self.assertIn(code, (INTERRUPTED, DONE), stage)  # the last stages may end before the signal comes
            self.assertLess(time.monotonic() - asked, 1)
            megablock("run", self.project, "-j", job, "-q")
            self.assertEqual(status(job)["digest"], reference, stage)

    def test_features_are_saved_and_shown_within_a_unit(self):
        megablock("simulate", "--rendered", "--frames", 8, "--width", 1600, "--image-height", 1200, "--focal", 1250,
                  "-o", work / "large")
        project, job, whole = work / "large/block.yaml", self.folder / "large_job", self.folder / "whole_job"
        command = [MEGABLOCK, "partition", project, "--threads", "1"]
        terminal, its_end = pty.openpty()
        run = subprocess.Popen([*command, "-j", job], stdout=subprocess.DEVNULL, stderr=its_end)
        os.close(its_end)
        said = ""
        while not (job / "features/000000.h5").exists() or not re.search("[1-7]/8 images, ", said):
            self.assertIsNone(run.poll())
            said += os.read(terminal, 1 << 16).decode()  # until the line is drawn again
        run.send_signal(signal.SIGINT)
        self.assertEqual(run.wait(), INTERRUPTED)
        with contextlib.suppress(OSError):  # at its end
            while more := os.read(terminal, 1 << 16):
                said += more.decode()
        os.close(terminal)
        self.assertRegex(said, r"features +\[#+\.+\] [1-7]/8 images, ")
        self.assertRegex(said, "[0-9a-z] *\r\nmegablock: stopped; ")  # on a line of its own
        self.assertEqual(status(job)["stages"][0]["units"], 0)  # it was interrupted
        megablock("check", job, expect=FAILED_UNITS)

        ranks = ["mpirun", "--bind-to", "none", "--oversubscribe", "-n", "2"] if shutil.which("mpirun") else []
        start = time.monotonic()
        told = subprocess.run([*ranks, *command, "-j", whole], capture_output=True, text=True, check=True,
                              env=dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1"))
        if time.monotonic() - start > 8:  # a line every five seconds, whichever rank has the unit
            self.assertRegex(told.stderr, "features +[1-7]/8 images, ")
        megablock(*command[1:], "-j", job, "-q")
        self.assertEqual((job / "features/000000.h5").read_bytes(), (whole / "features/000000.h5").read_bytes())

    def test_sigusr1_stops_gracefully(self):
        run = subprocess.Popen([MEGABLOCK, "run", self.project, "-j", self.job, "-q"], stderr=subprocess.PIPE, text=True)
        while not (self.job / "job.json").exists():
            time.sleep(0.002)
        run.send_signal(signal.SIGUSR1)
        message = run.communicate()[1]
        self.assertEqual(run.returncode, INTERRUPTED, message)
        self.assertIn("resume", message)
        self.run_job()
        self.assertEqual(status(self.job)["digest"], status(work / "clean_job")["digest"])


if __name__ == "__main__":
    unittest.main()
