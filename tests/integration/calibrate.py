#!/usr/bin/env python3
"""Tests the calibration of a rig by the program, from the simulated target field to a drive that uses the result.

usage: calibrate.py MEGABLOCK [unittest arguments]
"""
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

from program import BAD_INPUT, DONE, FAILED_UNITS, MEGABLOCK, megablock, one_line, status

work = pathlib.Path(tempfile.mkdtemp(prefix="megablock-calibrate-"))
NOISE_PX = 0.5
VEHICLE = ("--vehicle-seed", 5)


def simulate(name, path, frames, *options):
    megablock("simulate", "--scene", "target-field", "--path", path, "--frames", frames, *VEHICLE, *options, "-o", work / name)
    return work / name / "block.yaml"


def calibrate(project, output, *options, expect=DONE):
    """The figures of a calibration."""
    done = subprocess.run([MEGABLOCK, "calibrate", project, "-o", output, "-q", "--json", *map(str, options)],
                          capture_output=True, text=True)
    assert done.returncode == expect, done.stderr
    return json.loads(done.stdout), done.stderr


def setUpModule():
    simulate("field", "s", 10, "--points-per-frame", 120, "--control-points", 60, "--check-points", 30)
    simulate("site", "loop", 6, "--points-per-frame", 150, "--control-points", 4, "--check-points", 40, "--seed", 2)


def tearDownModule():
    shutil.rmtree(work)


class Calibrate(unittest.TestCase):
    def setUp(self):
        self.output = work / self.id().split(".")[-1]

    def assert_calibrated(self, figures):
        expected = NOISE_PX * (figures["redundancy"] / figures["residuals"]) ** 0.5
        self.assertAlmostEqual(figures["after"]["rms_px"], expected, delta=0.05 * expected)
        self.assertGreater(figures["before"]["rms_px"], 5 * expected)
        site = figures["verification"]
        self.assertLess(site["check_points"]["rms_m"], 0.02)
        self.assertLess(site["check_points"]["normalised"], 1.5)
        self.assertLess(site["rms_px"], 1.15 * NOISE_PX)
        self.assertGreater(figures["verification_before"]["rms_px"], 3 * site["rms_px"])
        self.assertEqual(figures["refused"], "")
        self.assertEqual(len(figures["mounts"]), 10)
        if figures["points"] > 100:  # not of the targets alone
            self.assertTrue(all(min(mount["quadrants"]) >= 4 for mount in figures["mounts"]))

    def test_off_line_on_line_and_both(self):
        for mode in ("off-line", "on-line", "all"):
            figures, _ = calibrate(work / "field/block.yaml", self.output / mode, "--mode", mode, "--mounts", "free",
                                   "--verify", work / "site/block.yaml")
            self.assert_calibrated(figures)
            self.assertTrue((self.output / mode / "calibration.yaml").exists())
            self.assertIn("Coverage of the sensors", (self.output / mode / "calibration.html").read_text())

    def test_a_drive_takes_it_over(self):
        drive = work / "drive"
        megablock("simulate", "--scene", "stereopolis", "--frames", 24, "--drives", 1, "--days", 1, "--no-bridge",
                  "--street-spacing", 40, "--points-per-frame", 100, "--outliers", 0, "--control-zones", 1, *VEHICLE,
                  "-o", drive)
        calibrate(work / "field/block.yaml", self.output)
        project = drive / "block.yaml"
        project.write_text(project.read_text() + f"calibration: {self.output}/calibration.yaml\n")
        megablock("run", project, "-j", drive / "job", "-q")
        figures = status(drive / "job")
        # Cameras and mounts are held as calibrated: what is left is the noise.
        self.assertAlmostEqual(figures["image_sigma_px"], NOISE_PX, delta=0.03 * NOISE_PX)

    def test_ranks_agree(self):
        mpirun = shutil.which("mpirun")
        if not mpirun:
            self.skipTest("no mpirun")
        environment = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
        for ranks in (1, 2):
            subprocess.run([mpirun, "--bind-to", "none", "--oversubscribe", "--mca", "mpi_yield_when_idle", "1", "-n",
                            str(ranks), MEGABLOCK, "calibrate", work / "field/block.yaml", "-o",
                            self.output / str(ranks), "-q"], check=True, capture_output=True, env=environment)
        one, two = ((self.output / ranks / "calibration.yaml").read_bytes() for ranks in ("1", "2"))
        self.assertEqual(one, two)

    def test_worse_than_the_start_is_refused(self):
        calibrate(work / "field/block.yaml", self.output / "good", "--verify", work / "site/block.yaml")
        known = f"calibration: {{file: {self.output}/good/calibration.yaml}}\n"
        sparse = simulate("sparse", "sparse", 4)
        sparse.write_text(sparse.read_text() + known)
        figures, said = calibrate(sparse, self.output / "sparse", "--mounts", "free", "--verify",
                                  work / "site/block.yaml", expect=FAILED_UNITS)
        self.assertIn("it is no better than the start: residuals on the verification site are", one_line(said))
        self.assertIn("--hold-intrinsics", said)
        self.assertGreater(figures["verification"]["rms_px"], figures["verification_before"]["rms_px"])
        self.assertTrue(any("quadrant" in warning for warning in figures["warnings"]))
        self.assertTrue(any("its mount stays at the start" in warning for warning in figures["warnings"]))
        self.assertTrue((self.output / "sparse/calibration-refused.yaml").exists())
        self.assertFalse((self.output / "sparse/calibration.yaml").exists())

    def test_bad_input_is_one_line(self):
        field = (work / "field/block.yaml").read_text()

        def refused(name, text, *options):
            project = work / "field" / f"{name}.yaml"
            project.write_text(text)
            return one_line(megablock("calibrate", project, "-o", self.output / name, "-q", *options, expect=BAD_INPUT))

        (work / "field/bad.yaml").write_text("mounts:\n  c99: {rotation: [0, 0, 0], translation: [0, 0, 0]}\n")
        said = refused("unknown", field + "calibration: bad.yaml\n")
        self.assertIn("bad.yaml:2: the block has no rig camera 'c99'; it has 'c21'", said)
        targets = simulate("bare", "s", 4, "--points-per-frame", 40, "--control-points", 0, "--check-points", 0)
        said = one_line(megablock("calibrate", targets, "-o", self.output / "none", "--mode", "off-line", "-q",
                                  expect=BAD_INPUT))
        self.assertIn("0 measured control points: off-line calibration needs at least 3", said)
        rows = [f"t{i},{i},{2 * i},5,f00000{k}_c21.jpg,{900 + 10 * i},{500 + i}" for i in range(4) for k in range(2)]
        (work / "bare/line.csv").write_text("name,x,y,z,image,column_px,row_px\n" + "\n".join(rows) + "\n")
        targets.write_text(targets.read_text() + "control: line.csv\n")
        said = one_line(megablock("calibrate", targets, "-o", self.output / "line", "--mode", "off-line", "-q",
                                  expect=BAD_INPUT))
        self.assertIn("the 4 control points lie on one straight line", said)
        said = one_line(megablock("calibrate", work / "field/block.yaml", "-o", work / "field", "-q", expect=BAD_INPUT))
        self.assertIn("holds other files and no job", said)


if __name__ == "__main__":
    unittest.main()
