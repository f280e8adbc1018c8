#!/usr/bin/python3
"""Runs simulated blocks whose antenna and attitudes are off: this must be named, and lever arm and boresight must be
estimated with true sigmas.

usage: receivers.py MEGABLOCK [unittest arguments]
"""
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

import h5py
import numpy

from program import MEGABLOCK, megablock

work = pathlib.Path(tempfile.mkdtemp(prefix="megablock-receivers-"))
OFF = numpy.array([2, -1, 2]) / 3  # kOffReceiver of io/simulate/blocks/priors.h
ARM_M, TURN_DEG = 0.3, 1.5
FREE = {"gps": "lever_arm_sigma_m: 1", "attitude": "boresight_sigma_deg: 3"}


def tearDownModule():
    shutil.rmtree(work)


def simulate(name, *options, free=()):
    folder = work / name
    megablock("simulate", *options, "-o", folder)
    with (folder / "block.yaml").open("a") as f:
        f.write("tiles: {tile_max_frames: 30, min_tiles_from: 10}\n")
        f.writelines(f"{key}: {{{FREE[key]}}}\n" for key in free)
    return folder


def receiver_of(job):
    """Centre, rotation vector (degrees), covariance of the increments (m, rad) of the last mount."""
    with h5py.File(job / "result/block.h5") as result:
        assert result["mounts/camera"][-1] == -1
        w, *v = result["mounts/rotation_wxyz"][-1]
        turn = 2 * numpy.degrees(numpy.array(v) / max(w, 1e-9))  # small angles
        return result["mounts/centre"][-1], turn, result["mounts/covariance"][-1]


class Receivers(unittest.TestCase):
    def run_job(self, folder, job="job"):
        megablock("run", folder / "block.yaml", "-j", folder / job, "-q")
        return json.loads(megablock("evaluate", folder / job, folder / "truth.h5", "--json"))

    def remarks(self, job):
        return json.loads(megablock("status", job, "--json"))["remarks"]

    def test_named_where_they_are_held(self):
        # A principal point that is estimated would take up the lever arm of a camera that looks down.
        options = ("--frames", 100, "--attitude-sigma", 0.05, "--gps-sigma", 0.03, "--no-calibration")
        right = simulate("right", "--scene", "aerial", *options)
        self.run_job(right)
        self.assertFalse([r for r in self.remarks(right / "job") if "sigma_m" in r or "boresight" in r])
        wrong = simulate("wrong", "--scene", "aerial", *options, "--lever-arm-error", 0.1, "--boresight-error", 0.5)
        self.run_job(wrong)
        remarks = self.remarks(wrong / "job")
        self.assertEqual(sum("lever_arm_sigma_m" in r for r in remarks), 1, remarks)
        self.assertEqual(sum("boresight_sigma_deg" in r for r in remarks), 1, remarks)

    def test_estimated(self):
        """Each of them alone would spoil the block."""
        for scene in ("aerial", "street"):
            options = ("--scene", scene, "--frames", 100, "--attitude-sigma", 0.05, "--gps-sigma", 0.03,
                       "--lever-arm-error", ARM_M, "--boresight-error", TURN_DEG)
            block = simulate(scene, *options, free=FREE)
            errors = self.run_job(block)
            for key in ("normalised_error_position", "normalised_error_rotation"):
                self.assertLess(errors[key], 1.25, (scene, key))
            centre, turn, covariance = receiver_of(block / "job")
            sigma = numpy.sqrt(covariance.diagonal())
            print(scene, "lever arm", centre, "of", ARM_M * OFF, "sigma", sigma[3:], "boresight", turn, "of",
                  TURN_DEG * OFF, "sigma", numpy.degrees(sigma[:3]))
            self.assertTrue((abs(centre - ARM_M * OFF) < 4 * sigma[3:]).all())
            self.assertTrue((abs(turn - TURN_DEG * OFF) < 4 * numpy.degrees(sigma[:3])).all())
            remarks = self.remarks(block / "job")
            self.assertFalse([r for r in remarks if "sigma_m" in r or "boresight" in r or "more than" in r], remarks)
            self.assertIn("Receivers", (block / "job/result/report.html").read_text())
            self.same_bits(block)

    def same_bits(self, block):
        subprocess.run(["mpirun", "--bind-to", "none", "--oversubscribe", "--mca", "mpi_yield_when_idle", "1", "-n",
                        "2", MEGABLOCK, "run", block / "block.yaml", "-j", block / "two", "-q"], check=True,
                       stdout=subprocess.DEVNULL,
                       env={**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"})
        for a, b in zip(receiver_of(block / "job"), receiver_of(block / "two")):
            self.assertEqual(a.tobytes(), b.tobytes())
        self.assertEqual(*(megablock("status", block / job, "--digest") for job in ("job", "two")))

    def test_sigmas(self):
        """e'C^-1 e of lever arm and boresight over independent blocks: 6 degrees of freedom each."""
        squares = []
        for seed in range(1, 21):
            block = simulate(f"seed{seed}", "--scene", "aerial", "--frames", 40, "--attitude-sigma", 0.05, "--gps-sigma",
                             0.03, "--lever-arm-error", ARM_M, "--boresight-error", TURN_DEG, "--seed", seed, free=FREE)
            self.run_job(block)
            centre, turn, covariance = receiver_of(block / "job")
            e = numpy.concatenate([numpy.radians(turn - TURN_DEG * OFF), centre - ARM_M * OFF])
            squares.append(e @ numpy.linalg.solve(covariance, e))
        print("e'C^-1 e / 6:", numpy.mean(squares) / 6)
        # 120 degrees of freedom: sigma of the quotient 0.13.
        self.assertLess(abs(numpy.mean(squares) / 6 - 1), 0.4)

    def test_boresight_of_the_project(self):
        """The boresight that one job found serves another as a given one."""
        options = ("--scene", "aerial", "--frames", 60, "--attitude-sigma", 0.05, "--boresight-error", TURN_DEG)
        block = simulate("given", *options)
        with (block / "block.yaml").open("a") as f:
            f.write(f"attitude: {{boresight_deg: {list(map(float, TURN_DEG * OFF))}}}\n")
        errors = self.run_job(block)
        self.assertLess(errors["normalised_error_rotation"], 1.25)
        self.assertFalse([r for r in self.remarks(block / "job") if "boresight" in r])


if __name__ == "__main__":
    unittest.main(verbosity=2)
