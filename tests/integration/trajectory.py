#!/usr/bin/python3
"""Tests trajectories of a user: blocks whose poses come from text files and from an SBET.

usage: trajectory.py MEGABLOCK [unittest arguments]
"""
import csv
import json
import math
import pathlib
import shutil
import struct
import tempfile
import unittest

import h5py
import numpy
from program import BAD_INPUT, megablock, one_line, status

ORIGIN = (48.85, 2.35, 100)  # of rendered blocks


def setUpModule():
    global work
    work = pathlib.Path(tempfile.mkdtemp(prefix="megablock-trajectory-"))


def tearDownModule():
    shutil.rmtree(work)


def forget_poses(block_file):
    """Takes all observations and start values of poses out of a block."""
    with h5py.File(block_file, "a") as block:
        for kind in ("position_prior", "attitude_prior", "given"):
            block[f"frames/{kind}/present"][:] = 0
        block["frames/pass"][:] = -1
        for name, rows in list(block["relative_poses"].items()):
            attributes, none = dict(rows.attrs), rows[:0]
            del block[f"relative_poses/{name}"]
            block[f"relative_poses/{name}"] = none
            block[f"relative_poses/{name}"].attrs.update(attributes)


class Simulated(unittest.TestCase):
    def compare(self, name, *scene, trajectory="trajectory.csv", poses=""):
        folder = work / name
        megablock("simulate", *scene, "-o", folder)
        megablock("run", folder / "block.yaml", "-j", folder / "job", "-q")
        shutil.copy(folder / "given.h5", folder / "bare.h5")
        forget_poses(folder / "bare.h5")
        bare = "block: bare.h5\ntie_points: tie_points.h5\n"
        (folder / "files.yaml").write_text(f"{bare}trajectory: {trajectory}\nrelative_poses: relative_poses.csv\n{poses}")
        megablock("run", folder / "files.yaml", "-j", folder / "files", "-q")
        self.assertEqual(status(folder / "files")["digest"], status(folder / "job")["digest"])
        return folder, bare

    def test_a_drive_from_files_gives_the_digest_of_the_block(self):
        folder, bare = self.compare("drive", "--scene", "stereopolis", "--frames", 200, "--control-zones", 3)
        # Each file is needed for it, and without any there is no pose at all.
        digest = status(folder / "job")["digest"]
        (folder / "part.yaml").write_text(f"{bare}trajectory: trajectory.csv\n")
        megablock("run", folder / "part.yaml", "-j", folder / "part", "-q")
        self.assertNotEqual(status(folder / "part")["digest"], digest)

    def test_an_antenna_beside_the_rig(self):
        self.compare("street", "--scene", "street", "--frames", 120, "--gps-sigma", 0.05, "--attitude-sigma", 0.1,
                     "--relative-position-sigma", 0.01, "--relative-rotation-sigma", 0.02, "--start-offset", 1,
                     trajectory="{file: trajectory.csv, lever_arm_m: [0.1, -0.6, -0.2], use: [positions, attitudes]}",
                     poses="poses: poses.csv\n")

    def test_relative_poses_made_of_the_trajectory(self):
        folder = work / "made"
        megablock("simulate", "--scene", "stereopolis", "--frames", 100, "--control-zones", 2, "-o", folder)
        shutil.copy(folder / "given.h5", folder / "bare.h5")
        forget_poses(folder / "bare.h5")
        (folder / "block.yaml").write_text(
            "block: bare.h5\ntie_points: tie_points.h5\n"
            "trajectory: {file: trajectory.csv, relative: {sigma_position_m: 0.005, sigma_rotation_deg: 0.01}}\n")
        megablock("run", folder / "block.yaml", "-j", folder / "job", "-q")
        with h5py.File(folder / "job/result/block.h5") as block, h5py.File(folder / "given.h5") as given:
            self.assertEqual(len(block["relative_poses/from"]), len(given["relative_poses/from"]))
        (folder / "twice.yaml").write_text((folder / "block.yaml").read_text() + "relative_poses: relative_poses.csv\n")
        line = one_line(megablock("run", folder / "twice.yaml", "-j", folder / "twice", "-q", expect=BAD_INPUT))
        self.assertIn("twice.yaml:4: 'relative_poses' and 'relative' of 'trajectory' state the same thing", line)


def geodetic(local):
    """Latitude, longitude (radians) and height of a place in the block's frame, east, north, up of ORIGIN."""
    a, e2 = 6378137.0, 6.69437999014e-3
    latitude, longitude, height = math.radians(ORIGIN[0]), math.radians(ORIGIN[1]), ORIGIN[2]
    sin, cos = math.sin, math.cos
    east = numpy.array([-sin(longitude), cos(longitude), 0])
    up = numpy.array([cos(latitude) * cos(longitude), cos(latitude) * sin(longitude), sin(latitude)])
    radius = a / math.sqrt(1 - e2 * sin(latitude)**2)
    place = (radius + height) * up - numpy.array([0, 0, radius * e2 * sin(latitude)])
    place = place + numpy.stack([east, numpy.cross(up, east), up], 1) @ local
    longitude, flat = math.atan2(place[1], place[0]), math.hypot(place[0], place[1])
    latitude = math.atan2(place[2], flat * (1 - e2))
    for _ in range(6):
        radius = a / math.sqrt(1 - e2 * sin(latitude)**2)
        height = flat / cos(latitude) - radius
        latitude = math.atan2(place[2], flat * (1 - e2 * radius / (radius + height)))
    return latitude, longitude, height


def body_angles(rotation):
    """Roll, pitch and heading of an aircraft with a nadir camera: forward is the top of the image."""
    ned = rotation[:, [1, 0, 2]] * [1, 1, -1]  # the camera's axes in north, east, down
    body = numpy.stack([-ned[1], ned[0], ned[2]], 1)
    return math.atan2(body[2, 1], body[2, 2]), -math.asin(body[2, 0]), math.atan2(body[1, 0], body[0, 0])


def matrix(w, x, y, z):
    return numpy.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


class Sbet(unittest.TestCase):
    def test_an_sbet_places_and_turns_a_flight(self):
        folder = work / "flight"
        megablock("simulate", "--rendered", "--frames", 12, "--width", 480, "--image-height", 360, "--focal", 375,
                  "--gps-sigma", 0, "-o", folder)
        with (folder / "truth.csv").open() as file:
            truth = list(csv.DictReader(line for line in file if not line.startswith("#")))
        sbet, times = b"", ["name,time_s"]
        for i, row in enumerate(truth):
            time = 126000 + 10.0 * i
            place = geodetic(numpy.array([float(row[k]) for k in "xyz"]))
            angles = body_angles(matrix(*(float(row[k]) for k in ("qw", "qx", "qy", "qz"))))
            for step in (-0.5, 0, 0.5):  # the aircraft stands still about each exposure
                sbet += struct.pack("<17d", time + step, *place, 0, 0, 0, *angles, *[0] * 7)
            times.append(f"{row['name']},{time + 0.25 - 18}")
        (folder / "sbet.out").write_bytes(sbet)
        (folder / "times.csv").write_text("\n".join(times))
        project = ("images: images\norigin: [48.85, 2.35, 100]\nfeatures: {max_features: 1200}\n"
                   "trajectory: {file: sbet.out, times: times.csv, time_offset_s: 18, rig: down, sigma_horizontal_m: 0.02,\n"
                   "             sigma_vertical_m: 0.02, sigma_tilt_deg: 0.02, sigma_heading_deg: 0.02, use: USE}\n")
        for use in ("[positions, attitudes]", "[start, positions, attitudes]"):
            with self.subTest(use=use):
                (folder / "block.yaml").write_text(project.replace("USE", use))
                job = folder / f"job{len(use)}"
                megablock("run", folder / "block.yaml", "-j", job, "-q")
                state = status(job)
                self.assertEqual(state["oriented"], 12)
                self.assertFalse([line for line in state["remarks"] if "attitude" in line or "position" in line])
                errors = json.loads(megablock("evaluate", job, folder / "truth.csv", "--json"))
                self.assertLess(errors["position_max_m"], 0.05)
                self.assertLess(errors["rotation_rms_deg"], 0.02)


if __name__ == "__main__":
    unittest.main()
