#!/usr/bin/python3
"""Tests that one gross error among the control points is named and moves nothing. usage: wrong_control.py MEGABLOCK

A simulated block without positions hangs on six control points. Each point in turn gets a coordinate that is 10 m off,
or a mark that is 100 px off. The poses must stay within one sigma of those that the block has without the wrong
coordinates (the point is a check point there), or without the wrong mark. A second block is as small and its control as
coarse that it bends to a wrong point: residuals alone do not show it. The same holds for a block with few positions, and
for errors of metres to kilometres in a block of six images.
"""
import csv
import pathlib
import shutil
import tempfile
import unittest

import h5py

from program import megablock, status

CHECK_POINT = 2  # role in given.h5
COORDINATES = ("x_m", "y_m", "z_m")


def run(project, job):
    """The status of the block, and its images by name."""
    megablock("run", project, "-j", job, "-q")
    megablock("export", job, "--format", "csv", "-o", job.with_suffix(".csv"))
    with open(job.with_suffix(".csv") / "images_local.csv") as table:
        return status(job), {row["image"]: row for row in csv.DictReader(table)}


class WrongControl(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.work = pathlib.Path(tempfile.mkdtemp(prefix="megablock-wrong-control-"))
        cls.block = cls.work / "block"
        megablock("simulate", "--frames", 25, "--gps-sigma", 0, "--control-points", 6, "--control-sigma", 0.02,
                  "-o", cls.block)
        cls.right, cls.poses = run(cls.block / "block.yaml", cls.work / "right")
        with h5py.File(cls.block / "given.h5") as given:
            cls.names = list(given["control/name"].asstr()[:])
            cls.counts = given["control/measurements"][:]

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.work)

    def run_changed(self, name, change, block=None):
        """Runs a copy of the block after change(given.h5)."""
        folder = self.work / name
        shutil.copytree(block or self.block, folder)
        with h5py.File(folder / "given.h5", "r+") as given:
            change(given)
        return run(folder / "block.yaml", folder / "job")

    def spoil(self, name, change, right, block=None):
        """Runs the block with an error, compares its poses with those of `right`, and returns the remarks."""
        wrong, poses = self.run_changed(name, change, block)
        self.assertEqual(poses.keys(), right.keys())
        for image, row in poses.items():
            before = right[image]
            for axis in COORDINATES:
                moved = abs(float(row[axis]) - float(before[axis])) / float(row["sigma_" + axis])
                self.assertLess(moved, 1, f"{name}: {image} moves by {moved:.2f} sigmas along {axis}")
        return "\n".join(wrong["remarks"])

    def test_right_control_gets_no_remark(self):
        self.assertEqual(self.right["remarks"], [])

    def test_a_coordinate_is_named_and_moves_nothing(self):
        for point, name in enumerate(self.names):
            def change(given, point=point):
                given["control/position"][point, point % 3] += 10

            def check(given, point=point):
                given["control/role"][point] = CHECK_POINT
            _, right = self.run_changed(f"check-{point}", check)
            said = self.spoil(f"coordinate-{point}", change, right)
            self.assertRegex(said, rf"1 of 6 control points differs.*: {name} by (9\.[5-9]|10\.[0-5])\d* m")

    def simulated(self, name, *options):
        block = self.work / name
        if "--frames" not in options:
            options = ("--frames", 12, *options)
        megablock("simulate", *options, "-o", block)
        return block

    def test_a_coordinate_to_which_the_block_bends_is_named_and_moves_nothing(self):
        block = self.simulated("weak", "--gps-sigma", 0, "--control-points", 6, "--control-sigma", 0.5)
        for point in range(6):
            def change(given, point=point):
                given["control/position"][point, 2 * (point % 2)] += 10  # twenty sigmas

            def check(given, point=point):
                given["control/role"][point] = CHECK_POINT
            _, right = self.run_changed(f"weak-check-{point}", check, block)
            said = self.spoil(f"weak-{point}", change, right, block)
            self.assertRegex(said, rf"1 of 6 control points differs.*takes no part: control{point} by ")

    def test_an_error_of_any_size_is_named_and_moves_nothing(self):
        """Six images with a wrong focal length: an outlier at the edge determines more of them than all others do."""
        for datum, sigma in ("without", 0), ("with", 5):
            block = self.simulated(f"few-{datum}", "--frames", 6, "--gps-sigma", sigma, "--control-points", 5,
                                   "--start-focal", 0.92)
            for point in 0, 2, 4:
                def check(given, point=point):
                    given["control/role"][point] = CHECK_POINT
                _, right = self.run_changed(f"few-{datum}-check-{point}", check, block)
                for error in 30, 11000:
                    def change(given, point=point, error=error):
                        given["control/position"][point, (point + error) % 3] += error
                    said = self.spoil(f"few-{datum}-{point}-{error}", change, right, block)
                    self.assertRegex(said, rf"1 of 5 control points differs.*takes no part: control{point} by ")

    def test_it_is_found_without_rounds_of_screening(self):
        block = self.simulated("unscreened", "--gps-sigma", 0, "--control-points", 6, "--control-sigma", 0.5)
        project = block / "block.yaml"
        project.write_text(project.read_text() + "merge: {screening_rounds: 0}\n")

        def change(given):
            given["control/position"][3, 2] += 10
        wrong, _ = self.run_changed("unscreened-3", change, block)
        self.assertRegex("\n".join(wrong["remarks"]), "takes no part: control3 by ")

    def test_a_position_to_which_the_block_bends_is_named_and_moves_nothing(self):
        block = self.simulated("positions", "--gps-sigma", 0.5)
        for frame in (0, 5, 11):
            def change(given, frame=frame):
                given["frames/position_prior/position"][frame, frame % 3] += 10

            def without(given, frame=frame):
                given["frames/position_prior/present"][frame] = 0
            _, right = self.run_changed(f"positions-without-{frame}", without, block)
            said = self.spoil(f"positions-{frame}", change, right, block)
            self.assertRegex(said, r"1 of 12 positions differs from the block")

    def test_a_mark_is_named_and_moves_nothing(self):
        first = 0
        for point, name in enumerate(self.names):
            row = first + point % self.counts[point]
            first += self.counts[point]
            def change(given, row=row):
                given["control/measurement/pixel"][row, row % 2] += 100
            said = self.spoil(f"mark-{point}", change, self.poses)
            self.assertRegex(said, rf"1 mark of control and check points is rejected: {name} in \S+ by (9\d|10\d)")


unittest.main()
