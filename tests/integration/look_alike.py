#!/usr/bin/python3
"""Runs a courtyard and towers whose four sides look alike: the blocks must be neither torn nor folded, the pairs that
only look alike must be named, and so must the parts whose size nothing tells.

usage: look_alike.py MEGABLOCK [unittest arguments]
"""
import json
import pathlib
import re
import shutil
import tempfile
import unittest

import h5py
import numpy

from program import events, megablock, status

work = pathlib.Path(tempfile.mkdtemp(prefix="megablock-look-alike-"))


def tearDownModule():
    shutil.rmtree(work)


class LookAlike(unittest.TestCase):
    def simulate(self, *options, project=""):
        self.folder = work / self.id().split(".")[-1]
        megablock("simulate", "--rendered", *options, "-o", self.folder)
        with (self.folder / "block.yaml").open("a") as f:
            f.write("features: {max_features: 2500}\n" + project)

    def run_job(self):
        return megablock("run", self.folder / "block.yaml", "-j", self.folder / "job")

    def errors(self):
        return json.loads(megablock("evaluate", self.folder / "job", self.folder / "truth.csv", "--json"))

    def run_block(self, *options):
        self.simulate(*options)
        self.run_job()
        return self.errors(), "\n".join(status(self.folder / "job")["notes"])

    def test_a_courtyard_is_not_torn(self):
        errors, notes = self.run_block("--scene", "courtyard", "--seed", 1)
        self.assertEqual((errors["frames"], errors["frames_missing"]), (24, 0))
        # The court is 24 m wide. A pixel is 2 cm on its facades.
        self.assertLess(errors["position_max_m"], 0.05)
        self.assertLess(errors["normalised_error_position"], 2)
        self.assertIn("may look alike and show different things", notes)
        self.assertNotIn("tells the size", " ".join(status(self.folder / "job")["remarks"]))
        megablock("check", self.folder / "job")

    def test_a_block_without_look_alikes_keeps_all_pairs(self):
        _, notes = self.run_block("--frames", 12, "--width", 480, "--image-height", 360, "--focal", 375,
                                  "--gps-sigma", 0)
        self.assertNotIn("look alike", notes)
        self.assertNotIn("tells the size", " ".join(status(self.folder / "job")["remarks"]))

    # Each pair of images sees one side of the tower, a plane, and agrees with any focal length. Pairs that are verified
    # with a wrong one tear the block.
    def test_a_focal_length_that_only_the_block_contradicts_begins_again(self):
        self.simulate("--scene", "tower", "--seed", 3, project="cameras: {default: {focal_px: 448}}\n")
        self.assertIn("the run begins again with it", self.run_job())
        state = status(self.folder / "job")
        self.assertRegex(" ".join(state["notes"]), "the focal length of 448 px .* cannot be right: the block that was oriented")
        with h5py.File(self.folder / "job/result/block.h5") as result:
            self.assertLess(abs(result["cameras/intrinsics"][0, 0] / 640 - 1), 0.01)
        errors = self.errors()
        self.assertEqual((errors["frames"], errors["frames_missing"]), (24, 0))
        self.assertLess(errors["position_max_m"], 0.05)  # the ring is 50 m wide
        done = len(events(self.folder / "job"))
        self.assertNotIn("begins again", self.run_job())
        self.assertEqual(len(events(self.folder / "job")), done, "nothing is left to do")
        shutil.rmtree(self.folder / "job/matches")
        self.assertNotIn("begins again", self.run_job())
        self.assertEqual(status(self.folder / "job")["digest"], state["digest"])
        megablock("check", self.folder / "job")

    # No image of this tower sees two sides well enough: the sides hang together at single images of the corners.
    def test_parts_of_unknown_size_are_named(self):
        self.simulate("--scene", "tower", "--seed", 1)
        self.run_job()
        named = [line for line in status(self.folder / "job")["remarks"] if "nothing else tells the size" in line]
        self.assertGreaterEqual(len(named), 1)
        for line in named:
            self.assertRegex(line, r"^[5-9] frames \('f0000[0-9]+.jpg', .* and [0-9] more\) share only 'f0000")
        found = json.loads(megablock("diagnose", self.folder / "job", "--json"))["loose_parts"]
        self.assertEqual(len(found), len(named))
        self.assert_sides_have_own_scales(found)

    # Against the truth: what is named has a scale of its own, and each part has one scale.
    def assert_sides_have_own_scales(self, parts):
        with h5py.File(self.folder / "job/result/block.h5") as result:
            names = [name.decode() for name in result["frames/name"]]
            found = dict(zip(names, result["frames/centre"][:]))
        true = {}
        for line in (self.folder / "truth.csv").read_text().splitlines():
            row = line.split(",")
            if re.match("f[0-9]+.jpg", row[0]):
                true[row[0]] = numpy.array([float(x) for x in row[5:8]])
        loose = {name for part in parts for name in part["frames"]}
        scales = []
        for part in [part["frames"] for part in parts] + [[name for name in names if name not in loose]]:
            bases = [numpy.linalg.norm(found[b] - found[a]) / numpy.linalg.norm(true[b] - true[a])
                     for a, b in zip(part, part[1:]) if int(b[1:7]) == int(a[1:7]) + 1]
            self.assertLess(max(bases) / min(bases), 1.02)
            scales.append(numpy.median(bases))
        self.assertGreater(max(scales) / min(scales), 1.1)


if __name__ == "__main__":
    unittest.main(verbosity=2)
