#!/usr/bin/python3
"""Runs simulated drives with a rolling shutter: the correction must take out the bias that it causes, and the readout
time must be found from the images.

usage: rolling_shutter.py MEGABLOCK [unittest arguments]
"""
import json
import pathlib
import shutil
import tempfile
import unittest

from program import megablock

work = pathlib.Path(tempfile.mkdtemp(prefix="megablock-rolling-shutter-"))
READOUT = ("--readout-ms", 30, "--speed", 10)


def tearDownModule():
    shutil.rmtree(work)


class RollingShutter(unittest.TestCase):
    def errors(self, scene, *options, readout=None):
        folder = work / f"{self.id().split('.')[-1]}_{scene}_{'_'.join(map(str, options))}_{readout}"
        megablock("simulate", "--scene", scene, *READOUT, *options, "-o", folder)
        with (folder / "block.yaml").open("a") as f:
            f.write("tiles: {tile_max_frames: 40}\n")
            if readout:
                f.write(f"cameras: {{default: {{readout_ms: {readout}}}}}\n")
        megablock("run", folder / "block.yaml", "-j", folder / "job", "-q")
        megablock("check", folder / "job")
        return json.loads(megablock("evaluate", folder / "job", folder / "truth.h5", "--json"))

    def test_flight(self):
        """A drone at 10 m/s, 30 ms."""
        options = ("--frames", 120, "--check-points", 10)
        before, after = self.errors("aerial", *options, "--start-readout", 0), self.errors("aerial", *options)
        for key in ("normalised_error_position", "normalised_error_rotation"):
            self.assertGreater(before[key], 3, key)
            self.assertLess(after[key], 1.15, key)
        self.assertLess(after["position_rms_m"], 0.5 * before["position_rms_m"])

    def test_street(self):
        options = ("--frames", 60)
        before, after = self.errors("street", *options, "--start-readout", 0), self.errors("street", *options)
        for key, wrong in (("normalised_error_position", 5), ("normalised_error_rotation", 2)):
            self.assertGreater(before[key], wrong, key)
            self.assertLess(after[key], 1.2, key)

    def test_readout_time_from_the_images(self):
        found = self.errors("aerial", "--frames", 120, "--start-readout", 0, readout="estimate")
        for key in ("normalised_error_position", "normalised_error_rotation"):
            self.assertLess(found[key], 1.2, key)


if __name__ == "__main__":
    unittest.main(verbosity=2)
