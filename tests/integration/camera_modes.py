#!/usr/bin/env python3
"""Tests `calibrate --panoramic` and `--compare-models` on simulated blocks, also with bad input.

usage: camera_modes.py MEGABLOCK [unittest arguments]
"""
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from program import BAD_INPUT, MEGABLOCK, megablock, one_line

work = pathlib.Path(tempfile.mkdtemp(prefix="megablock-camera-modes-"))
HD = {"f": 1400, "cx": 961, "cy": 542}  # camera 3 of the published simulations
LISTED = "pinhole,brown/1,brown/2,brown"


def tearDownModule():
    shutil.rmtree(work)


def panorama(name, *options):
    megablock("simulate", "--scene", "panorama", "--published-camera", 3, *options, "-o", work / name)
    return work / name / "block.yaml"


def calibrate(what, *options):
    return megablock("calibrate", what, *options, "-o", work / "calibration")


def calibrated(text, name):
    """Value and sigma of a parameter."""
    match = re.search(rf"^  {name} +\S+ +(\S+) +(\S+)$", text, re.MULTILINE)
    return float(match[1]), float(match[2])


class Panoramic(unittest.TestCase):
    def test_finds_the_camera_that_a_project_takes_over(self):
        project = panorama("exact", "--start-focal", 0.8)
        text = calibrate(project, "--panoramic", "--model", "ign-radial")
        for name, truth in HD.items():
            value, sigma = calibrated(text, name)
            self.assertLess(abs(value - truth), 4 * sigma, text)
            self.assertLess(sigma, 2, text)
        self.assertNotIn("warning", text)
        shutil.copy(work / "calibration/calibration.yaml", work / "exact")
        with open(project, "a") as file:
            file.write("calibration: calibration.yaml\n")
        again = calibrate(project, "--panoramic", "--image-sigma", 0.5)
        self.assertIn("ign-radial", again)
        self.assertLess(abs(calibrated(again, "f")[0] - calibrated(text, "f")[0]), 0.01)

    def test_warns_of_a_centre_beside_the_axis(self):
        project = panorama("beside", "--off-centre", 0.05, "--depth-spread", 0.5)
        self.assertIn("evidently not turned about its projection centre",
                      calibrate(project, "--panoramic", "--model", "ign-radial"))


class CompareModels(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.project = work / "street/block.yaml"
        megablock("simulate", "--scene", "street", "--frames", 20, "--rig-cameras", 2, "--points-per-frame", 200,
                  "-o", work / "street")
        cls.job = work / "job"
        megablock("run", cls.project, "-j", cls.job, "-q")

    def test_recommends_the_simulated_model_or_a_part_of_it(self):
        for what in (self.project, self.job):
            text = calibrate(what, "--compare-models", "--models", LISTED)
            self.assertEqual(text.count("recommended: brown"), 2, text)
            self.assertIn("<svg", (work / "calibration/models.html").read_text())

    def test_bad_input(self):
        def refused(*arguments):
            return one_line(megablock("calibrate", *arguments, "-o", work / "bad", expect=BAD_INPUT))
        self.assertIn("is not a camera model", refused(self.job, "--compare-models", "--models", "brwn"))
        self.assertIn("radial terms", refused(self.job, "--compare-models", "--models", "brown/7"))
        self.assertIn("no job directory", refused(work, "--compare-models"))
        self.assertFalse((work / "bad").exists())

    def test_measurements_of_a_job_are_not_taken_past_its_environment(self):
        project = work / "street/refracted.yaml"
        project.write_text(self.project.read_text() + "environment: {refraction: true}\n")
        megablock("match", project, "-j", work / "refracted", "-q")
        self.assertIn("environment.refraction: 'calibrate' takes measurements as they are",
                      one_line(megablock("calibrate", work / "refracted", "--panoramic", "-o", work / "bad",
                                         expect=BAD_INPUT)))
        self.assertFalse((work / "bad").exists())

    def test_a_street_is_no_panorama(self):
        done = subprocess.run([MEGABLOCK, "calibrate", self.job, "--panoramic", "-o", work / "bad"],
                              capture_output=True, text=True)
        self.assertTrue(done.returncode != 0 or "warning" in done.stdout, done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main()
