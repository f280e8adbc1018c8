#!/usr/bin/python3
"""Runs a courtyard whose four sides look alike: the block must be neither torn nor folded, and the pairs that only look
alike must be named.

usage: look_alike.py MEGABLOCK [unittest arguments]
"""
import json
import pathlib
import shutil
import tempfile
import unittest

from program import megablock, status

work = pathlib.Path(tempfile.mkdtemp(prefix="megablock-look-alike-"))


def tearDownModule():
    shutil.rmtree(work)


class LookAlike(unittest.TestCase):
    def run_block(self, *options):
        folder = work / self.id().split(".")[-1]
        megablock("simulate", "--rendered", *options, "-o", folder)
        with (folder / "block.yaml").open("a") as f:
            f.write("features: {max_features: 2500}\n")
        megablock("run", folder / "block.yaml", "-j", folder / "job", "-q")
        errors = json.loads(megablock("evaluate", folder / "job", folder / "truth.csv", "--json"))
        return errors, "\n".join(status(folder / "job")["notes"])

    def test_a_courtyard_is_not_torn(self):
        errors, notes = self.run_block("--scene", "courtyard", "--seed", 1)
        self.assertEqual((errors["frames"], errors["frames_missing"]), (24, 0))
        # The court is 24 m wide. A pixel is 2 cm on its facades.
        self.assertLess(errors["position_max_m"], 0.05)
        self.assertLess(errors["normalised_error_position"], 2)
        self.assertIn("may look alike and show different things", notes)
        megablock("check", work / "test_a_courtyard_is_not_torn/job")

    def test_a_block_without_look_alikes_keeps_all_pairs(self):
        _, notes = self.run_block("--frames", 12, "--width", 480, "--image-height", 360, "--focal", 375,
                                  "--gps-sigma", 0)
        self.assertNotIn("look alike", notes)


if __name__ == "__main__":
    unittest.main(verbosity=2)
