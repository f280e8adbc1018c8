#!/usr/bin/python3
"""Tests the choice of camera parameters (calibrate: auto) in whole runs: one choice whatever the tiles, taken again by a
run that goes on, and told in the result.
usage: camera_choice.py MEGABLOCK"""
import pathlib
import tempfile

import h5py
from program import megablock, status


def choice(job):
    """Number of the camera, mask, focal length, its sigma and reason, without the trailer that seals the file."""
    line = (job / "cameras/000000.txt").read_bytes().split(b"\n")[0].decode()
    camera, mask, contradicted, focal_px, sigma_px, readout_us, reason = line.split(" ", 6)
    assert contradicted == "0" and readout_us == "0"
    return int(camera), int(mask), float(focal_px), float(sigma_px), reason


def main():
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        megablock("simulate", "--frames", 40, "--noise", 0.3, "--relief", 30, "-o", folder)
        text = (folder / "block.yaml").read_text() + "cameras: {default: {calibrate: auto}}\n"
        chosen = []
        for frames in (10, 200):
            project, job = folder / f"{frames}.yaml", folder / f"job{frames}"
            project.write_text(text + f"tiles: {{tile_max_frames: {frames}}}\n")
            megablock("run", project, "-j", job, "-q")
            chosen.append(choice(job))
        print(chosen[0], status(folder / "job10")["tiles"], "tiles")
        assert status(folder / "job10")["tiles"] > 1 and status(folder / "job200")["tiles"] == 1
        assert chosen[0] == chosen[1], chosen
        camera, mask, focal_px, sigma_px, reason = chosen[0]
        assert camera == 0 and mask & 1 and mask & 8, "f and k1 of a lens with distortion"
        with h5py.File(folder / "truth.h5") as truth:
            assert 0 < sigma_px and abs(focal_px - truth["cameras/intrinsics"][0, 0]) < 4 * sigma_px, chosen[0]
        assert (folder / "job10/result/report.html").read_text().count(reason) == 2, "in the page and in its figures"

        # A run that goes on takes the same choice.
        project, job = folder / "10.yaml", folder / "job10"
        digest = status(job)["digest"]
        for unit in (job / "adjust").iterdir():
            unit.unlink()
        megablock("run", project, "-j", job, "-q")
        assert status(job)["digest"] == digest and choice(job) == chosen[0]

        # A project that says what to estimate has no such stage.
        project.write_text(text.replace("auto", "[focal]"))
        megablock("run", project, "-j", job, "-q")
        assert all(stage["name"] != "cameras" for stage in status(job)["stages"]), status(job)
        assert status(job)["digest"] != digest


main()
