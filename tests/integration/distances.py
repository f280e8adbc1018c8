#!/usr/bin/python3
"""Tests known distances from the project file to the result: they must give a free block in several tiles its scale,
and still do so when the job is run again.
usage: distances.py MEGABLOCK"""
import csv
import math
import pathlib
import tempfile

from program import megablock, status

SIGMA = 0.01  # m


def centres(file):
    with open(file) as lines:
        rows = csv.DictReader(line for line in lines if not line.startswith("#"))
        return {row["name"]: [float(row[k]) for k in ("x", "y", "z")] for row in rows}


def main():
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        megablock("simulate", "--scene", "street", "--frames", 40, "--rig-cameras", 1, "--gps-sigma", 0, "-o", folder)
        project, job = folder / "block.yaml", folder / "job"
        project.write_text(project.read_text() + "tiles: {tile_max_frames: 10}\ndistances: distances.csv\n")
        truth = centres(folder / "truth.csv")
        bars = [(f"f{i:06d}.jpg", f"f{i + 4:06d}.jpg") for i in range(0, 36, 4)]
        # The bars say that the block is larger by a twentieth than its start: nothing else tells its scale.
        (folder / "distances.csv").write_text("from,to,distance_m,sigma_m\n" + "".join(
            f"{a},{b},{1.05 * math.dist(truth[a], truth[b]):.6f},{SIGMA}\n" for a, b in bars))
        megablock("run", project, "-j", job, "-q")
        done = status(job)
        kind = done["observation_kinds"]["distance"]
        print(done["tiles"], "tiles,", kind, done["global_iterations"], "steps")
        assert done["tiles"] > 2 and kind["count"] == len(bars), done
        # The bars are exact, so that their residuals are those of the shape alone: below their sigma.
        assert kind["sigma_factor"] < 1, kind
        digest = done["digest"]
        megablock("run", project, "-j", job, "-q")
        assert status(job)["digest"] == digest
        (folder / "distances.csv").write_text("from,to,distance_m,sigma_m\nf000000.jpg,nowhere.jpg,3,0.1\n")
        message = megablock("run", project, "-j", job, "-q", expect=2)
        assert "distances.csv:2" in message and "nowhere.jpg" in message, message


main()
