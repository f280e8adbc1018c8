#!/usr/bin/env python3
"""Tests the verticals that are found in rendered images of a street, and their sigmas, against the true poses; also bad
images, and verticals that contradict given poses.
usage: verticals.py MEGABLOCK [FRAMES = 2]    frames of four images; with 12, the figures are those of the documents"""
import csv
import json
import math
import pathlib
import sys
import tempfile

import h5py
from pictures import make_blank
from program import FAILED_UNITS, megablock


def by_quaternion(q, v):
    w, x, y, z = q
    t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])]
    return [v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2],
            v[2] + w * t[2] + x * t[1] - y * t[0]]


def by_vector(r, v):
    angle = math.sqrt(sum(a * a for a in r))
    s = math.sin(angle / 2) / angle
    return by_quaternion([math.cos(angle / 2)] + [a * s for a in r], v)


def rows(file):
    with open(file) as lines:
        return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def errors(folder, table):
    """Degrees rms and mean of the squared error over sigma, of roll and pitch against the true poses."""
    mounts = json.loads((folder / "rig_cameras.json").read_text())
    down = {row["name"]: by_quaternion([float(row[k]) for k in ("qw", "qx", "qy", "qz")], [0, 0, -1])
            for row in rows(folder / "truth.csv")}
    squares, normalised = 0.0, 0.0
    found = [row for row in rows(table) if row["roll_deg"]]
    for row in found:
        frame, camera = row["image"][:-4].split("_c")
        x, y, z = by_vector(mounts["camera" + camera]["rotation"], down[frame])
        roll, pitch = math.degrees(math.atan2(x, y)), math.degrees(math.atan2(-z, math.hypot(x, y)))
        error = [float(row["roll_deg"]) - roll, float(row["pitch_deg"]) - pitch]
        sigma = [float(row["whole_sigma_roll_deg"]), float(row["whole_sigma_pitch_deg"])]
        squares += (error[0] ** 2 + error[1] ** 2) / len(found)
        normalised += sum((e / s) ** 2 for e, s in zip(error, sigma)) / 2 / len(found)
        assert abs(sum(float(row[f"down_{axis}"]) ** 2 for axis in "xyz") - 1) < 1e-6, row
    print(f"{len(found)} images, {math.sqrt(squares):.4f} degrees rms, mean squared error over sigma {normalised:.2f}")
    return math.sqrt(squares), normalised


def held_upside_down(folder, table):
    """An image whose EXIF orientation says that the camera was held upside down: its vertical points the other way."""
    picture = folder / "images" / "f000000_c1.jpg"
    upright = picture.read_bytes()
    entry = bytes.fromhex("12010300010000000100")  # orientation, one short: 1
    assert upright.count(entry) == 1
    before = {row["image"]: row for row in rows(table)}[picture.name]
    picture.write_bytes(upright.replace(entry, bytes.fromhex("12010300010000000300")))
    turned = table.with_name("turned.csv")
    megablock("verticals", folder / "block.yaml", "-o", turned)
    after = {row["image"]: row for row in rows(turned)}[picture.name]
    for axis in "xyz":
        assert abs(float(before[f"down_{axis}"]) + float(after[f"down_{axis}"])) < 1e-6, (before, after)
    picture.write_bytes(upright)


def blank(folder, table):
    """An image of uniform grey has no edge: one line names it, and the others do not change."""
    before = table.read_text().splitlines()
    picture = folder / "images" / "f000000_c3.jpg"
    content = picture.read_bytes()
    make_blank(picture, 1440, 960)
    said = megablock("verticals", folder / "block.yaml", "-o", table)
    assert "7 of 8 images show the vertical" in said, said
    remarks = [line for line in said.splitlines() if "without straight edges" in line]
    assert remarks == ["1 image without straight edges: f000000_c3.jpg"], said
    assert [a for a, b in zip(table.read_text().splitlines(), before) if a != b] == ["f000000_c3.jpg,,,,,,,,,,,0,0,0,,,"]
    picture.write_bytes(content)


def against_given_poses(folder):
    """A block of given poses, which is not oriented: verticals that contradict them are named and take no part, and all
    where they agree on another direction than down."""
    megablock("simulate", "--frames", 12, "--no-calibration", "-o", folder)
    project, wrong = folder / "block.yaml", ("f000003.jpg", "f000007.jpg")
    with project.open("a") as file:
        file.write("verticals: verticals.csv\n")

    def run(job, seen):
        """`seen`: what an image sees, in its axes, given its name and the rotation from the ground's."""
        table = ["image,down_x,down_y,down_z,sigma_deg"]
        for row in rows(folder / "truth.csv"):
            down = seen(row["name"], [float(row[k]) for k in ("qw", "qx", "qy", "qz")])
            table.append(",".join([row["name"], *map(str, down), "0.1"]))
        (folder / "verticals.csv").write_text("\n".join(table) + "\n")
        return megablock("run", project, "-j", folder / job)

    def rows_of_a_field_in_two(name, rotation):
        down = by_quaternion(rotation, [0, 0, -1])
        return down[1:] + down[:1] if name in wrong else down

    said = run("job", rows_of_a_field_in_two)
    assert "2 of 12 verticals take no part: 2" in said and all(name in said for name in wrong), said
    assert all(name in (folder / "job/result/report.html").read_text() for name in wrong)
    with h5py.File(folder / "job/result/block.h5") as result:  # nor in what the result says was observed
        assert len(result["verticals/image"]) == 10
    said = run("turned", lambda name, rotation: by_quaternion(rotation, [0, 0.8, -0.6]))
    assert "12 of 12 verticals take no part: 12 that agree with each other, but not with the given poses" in said, said


def main():
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else 2  # program.py took MEGABLOCK
    with tempfile.TemporaryDirectory() as scratch:
        # Cameras and mounts known, then a lens whose distortion is not.
        for calibrated in (False, True):
            folder = pathlib.Path(scratch) / str(calibrated)
            megablock("simulate", "--scene", "street", "--rendered", "--frames", frames, "--width", 1440,
                      "--image-height", 960, "--focal", 1050, *["--no-calibration"] * calibrated, "-o", folder)
            table = folder / "verticals.csv"
            said = megablock("verticals", folder / "block.yaml", "-o", table)
            assert frames > 2 or "8 of 8 images show the vertical" in said, said
            assert "give 'verticals: verticals.csv' in the project file" in said, said
            rms, normalised = errors(folder, table)
            # The sigma of an unknown lens is far larger than its effect in most images.
            assert (0.3 if calibrated else 0) < normalised < 3, normalised
            assert rms < (0.25 if calibrated else 0.8), rms

        if frames > 2:
            return  # figures alone
        # The same again; an unreadable image is named, and the others do not change.
        first = table.read_bytes()
        megablock("verticals", folder / "block.yaml", "-o", table)
        assert table.read_bytes() == first
        assert "without straight edges" not in said, said
        held_upside_down(folder, table)
        blank(folder, table)
        picture = folder / "images" / "f000001_c2.jpg"
        picture.write_bytes(picture.read_bytes()[:20000])
        said = megablock("verticals", folder / "block.yaml", "-o", table, expect=FAILED_UNITS)
        assert "f000001_c2.jpg" in said, said
        lines = first.decode().splitlines()
        again = table.read_text().splitlines()
        assert [a for a, b in zip(again, lines) if a != b] == ["f000001_c2.jpg,,,,,,,,,,,0,0,0,,,"], again
        against_given_poses(pathlib.Path(scratch) / "given")


main()
