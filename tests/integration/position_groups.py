#!/usr/bin/python3
"""Runs simulated blocks of which some positions have a datum of their own: the shift of each group must be estimated
with a true sigma, and the block must be as good as with right positions.

usage: position_groups.py MEGABLOCK [unittest arguments]
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

work = pathlib.Path(tempfile.mkdtemp(prefix="megablock-position-groups-"))
SHIFTS = numpy.array([[1.5, -2, 30], [0, 0.4, -1]])


def tearDownModule():
    shutil.rmtree(work)


def simulate(name, *options, project=""):
    """A block whose frames 10 to 19, and 20 to 29, have shifted positions."""
    folder = work / name
    megablock("simulate", "--scene", "aerial", "--gps-sigma", 0.03, *options, "-o", folder)
    with h5py.File(folder / "given.h5", "r+") as given:
        positions = given["frames/position_prior/position"]
        for number, shift in enumerate(SHIFTS, 1):
            positions[10 * number:10 * number + 10] += shift
        names = given["images/name"].asstr()[:]
    with (folder / "block.yaml").open("a") as f:
        f.write("tiles: {tile_max_frames: 15, min_tiles_from: 10}\n" + project)
    return folder, names


def groups(names):
    """The key of the project file: one group of each ten images, by the tens of their numbers."""
    tens = [names[10][:-5] + "?" + names[10][-4:], names[20][:-5] + "?" + names[20][-4:]]
    return f"gps: {{groups: {json.dumps(tens)}}}\n"


def shifts_of(job):
    with h5py.File(job / "result/block.h5") as result:
        assert (result["mounts/camera"][-2:] == -1).all()
        return result["mounts/centre"][-2:], result["mounts/covariance"][-2:, 3:, 3:]


class PositionGroups(unittest.TestCase):
    def run_job(self, folder, job="job"):
        megablock("run", folder / "block.yaml", "-j", folder / job, "-q")
        return json.loads(megablock("evaluate", folder / job, folder / "truth.h5", "--json"))

    def grouped(self, name, *options):
        folder, names = simulate(name, *options)
        with (folder / "block.yaml").open("a") as f:
            f.write(groups(names))
        return folder

    def test_shifts_and_sigmas(self):
        """e'C^-1 e of the shifts over independent blocks: 6 degrees of freedom each."""
        squares, position, rotation = [], [], []
        for seed in range(1, 21):
            block = self.grouped(f"seed{seed}", "--frames", 40, "--seed", seed)
            errors = self.run_job(block)
            position.append(errors["normalised_error_position"])
            rotation.append(errors["normalised_error_rotation"])
            centres, covariances = shifts_of(block / "job")
            for centre, covariance, shift in zip(centres, covariances, SHIFTS):
                squares.append((centre - shift) @ numpy.linalg.solve(covariance, centre - shift))
        print("e'C^-1 e / 3:", numpy.mean(squares) / 3, "poses:", numpy.mean(position), numpy.mean(rotation))
        # 120 degrees of freedom: sigma of the quotient 0.13.
        self.assertLess(abs(numpy.mean(squares) / 3 - 1), 0.4)
        self.assertLess(abs(numpy.mean(position) - 1), 0.15)
        self.assertLess(abs(numpy.mean(rotation) - 1), 0.15)

    def test_said_and_the_same_on_two_ranks(self):
        block = self.grouped("ranks", "--frames", 60)
        with h5py.File(block / "given.h5", "r+") as given:  # the group has factors of its own
            given["frames/position_prior/position"][20:30] += numpy.random.default_rng(1).normal(0, 0.5, (10, 3))
        self.run_job(block)
        with h5py.File(block / "job/result/block.h5") as result:
            self.assertGreater(result["position_scales/height"][1], 3)
        subprocess.run(["mpirun", "--bind-to", "none", "--oversubscribe", "--mca", "mpi_yield_when_idle", "1", "-n",
                        "2", MEGABLOCK, "run", block / "block.yaml", "-j", block / "two", "-q"], check=True,
                       stdout=subprocess.DEVNULL,
                       env={**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"})
        self.assertEqual(*(megablock("status", block / job, "--digest") for job in ("job", "two")))
        notes = " ".join(json.loads(megablock("status", block / "job", "--json"))["notes"])
        self.assertRegex(notes, r"positions of \S+ lie 1\.\d* m east of, 2\.\d* m south of and (29\.9|30\.0)\d m above their places")
        self.assertEqual((block / "job/result/report.html").read_text().count("shift [m]"), 2)

    def test_as_one_monolithic_adjustment(self):
        block = self.grouped("monolithic", "--frames", 60)
        with (block / "block.yaml").open("a") as f:
            f.write("merge: {decrement: 1.0e-7}\n")
        said = megablock("merge", block / "block.yaml", "-j", block / "job", "--quiet", "--monolithic")
        figures = json.loads(said.splitlines()[-1])
        print(figures)
        self.assertGreaterEqual(figures["tiles"], 4)
        self.assertEqual(figures["free_datum"], 0)
        self.assertLess(figures["max_pose_difference_sigmas"], 1e-6)

    def test_a_gross_error_within_a_group(self):
        """It is set aside, and changes nothing else by more than one sigma."""
        right, wrong = self.grouped("without_error", "--frames", 40), self.grouped("with_error", "--frames", 40)
        with h5py.File(wrong / "given.h5", "r+") as given:
            given["frames/position_prior/position"][14] += (0.3, 0, -0.5)
        for block in (right, wrong):
            self.run_job(block)
        with h5py.File(right / "job/result/block.h5") as before, h5py.File(wrong / "job/result/block.h5") as after:
            self.assertEqual(list(before["set_aside/position"]), [])
            self.assertEqual(list(after["set_aside/position"]), [14])
            moved = after["frames/centre"][:] - before["frames/centre"][:]
            sigmas = numpy.sqrt(numpy.diagonal(before["frames/covariance"][:, 3:, 3:], axis1=1, axis2=2))
            print("moved by sigmas:", abs(moved / sigmas).max())
            self.assertLess(abs(moved / sigmas).max(), 1)
        remarks = " ".join(json.loads(megablock("status", wrong / "job", "--json"))["remarks"])
        self.assertRegex(remarks, r"1 of 40 positions differs from the block by more than 6 sigmas: f000014.jpg by 0\.\d+ m")

    def test_a_group_with_worse_positions(self):
        """Ten positions of 0.5 m that are stated with 0.03 m have factors of their own; the rest of the block has none."""
        position, factors = [], []
        for seed in range(1, 9):
            block = self.grouped(f"worse{seed}", "--frames", 40, "--seed", seed)
            with h5py.File(block / "given.h5", "r+") as given:
                given["frames/position_prior/position"][10:20] += numpy.random.default_rng(seed).normal(0, 0.5, (10, 3))
            position.append(self.run_job(block)["normalised_error_position"])
            with h5py.File(block / "job/result/block.h5") as result:
                scales = result["position_scales"]
                factors.append([scales["horizontal"][0], scales["height"][0]])
                self.assertEqual([scales["horizontal"][1], scales["height"][1]], [1, 1])
                self.assertTrue((result["statistics/scale"][:] == 1).all())
            notes = " ".join(json.loads(megablock("status", block / "job", "--json"))["notes"])
            self.assertIn("scatter more than their sigmas predict", notes)
        print("factors:", numpy.median(factors, axis=0), "poses:", numpy.mean(position))
        for factor in numpy.median(factors, axis=0):
            self.assertLess(abs(numpy.log2(factor / (0.5 / 0.03))), 0.6)
        self.assertLess(abs(numpy.mean(position) - 1), 0.2)

    def test_without_groups_the_block_is_worse(self):
        wrong, _ = simulate("wrong", "--frames", 40)
        right = self.grouped("right", "--frames", 40)
        self.assertGreater(self.run_job(wrong)["position_rms_m"], 3 * self.run_job(right)["position_rms_m"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
