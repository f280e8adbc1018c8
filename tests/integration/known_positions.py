#!/usr/bin/python3
"""Tests whole jobs with known positions: these are held in tiles and merge, rotations that only attitude priors
determine are reported, and the determinant method is compared with the adjustment.
usage: known_positions.py MEGABLOCK"""
import csv
import json
import os
import pathlib
import shutil
import subprocess
import tempfile

import h5py
import numpy

from program import BAD_INPUT, FAILED_UNITS, MEGABLOCK, megablock, one_line, status

HELD = "gps: {sigma_horizontal_m: 0, sigma_vertical_m: 0}\n"
COMMON, LINE = "a common rotation of all frames", "the positions lie on one straight line"


def simulated(folder, *options, settings=HELD):
    """A block with positions within a micrometre and attitudes as given; its project."""
    megablock("simulate", "--no-calibration", "--gps-sigma", 1e-6, *options, "-o", folder)
    project = pathlib.Path(folder) / "block.yaml"
    project.write_text(project.read_text() + settings)
    return project


def run(project, job, ranks=1):
    mpirun = shutil.which("mpirun")
    before = [mpirun, "--bind-to", "none", "--oversubscribe", "--mca", "mpi_yield_when_idle", "1", "-n",
              str(ranks)] if ranks > 1 and mpirun else []
    return megablock("run", project, "-j", job, before=before,
                     env={**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"})


def evaluated(folder, job):
    return json.loads(megablock("evaluate", job, pathlib.Path(folder) / "truth.csv", "--json"))


def notes(job):
    with h5py.File(job / "result/block.h5") as result:
        return list(result["notes"].asstr()[:]) if "notes" in result else []


def rotations(path):
    with open(path) as table:
        rows = csv.DictReader(line for line in table if not line.startswith("#"))
        return {row["name"]: numpy.array([float(row["q" + axis]) for axis in "wxyz"]) for row in rows}


def rms_deg(one, other):
    """Of the angles between rotations of the same names."""
    assert one.keys() == other.keys()
    cosines = [min(1, abs(one[name] @ other[name]) / numpy.linalg.norm(one[name]) / numpy.linalg.norm(other[name]))
               for name in one]
    return numpy.degrees(numpy.sqrt(numpy.mean([(2 * numpy.arccos(c)) ** 2 for c in cosines])))


def held_positions(folder):
    project, job = simulated(folder, "--frames", 120, "--attitude-sigma", 0.1), folder / "job"
    said = run(project, job, ranks=2)
    assert status(job)["tiles"] >= 4
    with h5py.File(folder / "given.h5") as given, h5py.File(job / "result/block.h5") as result:
        moved = abs(result["frames/centre"][:] - given["frames/position_prior/position"][:]).max()
    assert moved <= 1e-9, moved
    found = evaluated(folder, job)
    assert found["rotation_rms_deg"] <= 0.1 / 3, found
    assert 0.8 <= found["normalised_error_rotation"] <= 1.25, found
    assert not any(case in said for case in (COMMON, LINE)), said
    print(f"held: moved {moved:.1e} m, rotations {found['rotation_rms_deg']:.4f} deg, "
          f"{found['normalised_error_rotation']:.3f} of their sigmas")


def verdict(folder, cases, options, settings=""):
    """Each case is named on the terminal, in the result and in the report; the sigmas cover the errors."""
    project, job = simulated(folder, *options, settings=HELD + settings), folder / "job"
    said = run(project, job)
    page = (job / "result/report.html").read_text()
    for case in COMMON, LINE:
        expected = case in cases
        lines = [line for line in notes(job) if case in line]
        assert len(lines) == expected and (case in said) == expected and (case in page) == expected, (case, lines, said)
        print("\n".join(lines))
    found = evaluated(folder, job)
    assert found["normalised_error_rotation"] <= 1.5, found


def determinants(folder):
    project = simulated(folder, "--frames", 30, "--seed", 2, "--points-per-frame", 80, "--attitude-sigma", 0.1)
    job, output = folder / "job", folder / "attitudes.csv"
    megablock("partition", project, "-j", job, "--quiet")
    assert "megablock match" in one_line(megablock("coplanarity", job, "-o", output, expect=BAD_INPUT))
    megablock("match", project, "-j", job, "--quiet")
    truth = rotations(folder / "truth.csv")

    def adjusted(*options):
        found = json.loads(subprocess.check_output([MEGABLOCK, "coplanarity", job, "-o", output, "--json", *options]))
        return found, rms_deg(rotations(output), truth)

    _, before = adjusted("--hold", "angles")  # as observed
    assert 0.15 <= before <= 0.2, before  # 0.1 about three axes
    forced, forced_error = adjusted()
    assert forced["frames"] == 30 and forced["open_directions"] == 0 and forced["remarks"] == [], forced
    assert forced["mean_determinant_after_m"] <= forced["mean_determinant_before_m"] / 10, forced
    assert forced["rank"] < forced["parameters"], forced
    unforced, _ = adjusted("--forcing", "0")
    assert unforced["open_directions"] == unforced["parameters"] - unforced["rank"] > 0, unforced
    assert "rank-deficient" in unforced["remarks"][0], unforced
    angles, angles_error = adjusted("--forcing", "0", "--hold", "images", "--solver", "direct", "--steps", "3")
    assert angles["rank"] == angles["parameters"] == 90 and angles["rms_image_correction_px"] == 0, angles
    said = megablock("coplanarity", job, "-o", output, "--forcing", 0)
    assert "note: rank-deficient" in said and f"determine {forced['rank']} of" in said, said
    assert "hold some" in one_line(
        megablock("coplanarity", job, "-o", output, "--forcing", 0, "--solver", "direct", expect=FAILED_UNITS))
    assert "--forcing" in megablock("coplanarity", job, "-o", output, "--forcing", -1, expect=BAD_INPUT)

    run(project, job)
    bundle = evaluated(folder, job)["rotation_rms_deg"]
    print(f"attitudes off the truth by {before:.4f} deg, forced {forced_error:.4f}, angles alone {angles_error:.4f}, "
          f"bundle {bundle:.4f}")
    assert bundle < forced_error < before / 3 and bundle < angles_error < before / 3


def main():
    line = ["--frames", 11, "--side-overlap", 0, "--attitude-sigma", 0.002]
    far = ["--frames", 24, "--height", 3000, "--focal", 40000, "--noise", 0.1, "--attitude-sigma", 0.001]
    for test, *arguments in ((held_positions,), (determinants,), (verdict, [LINE, COMMON], line),
                             (verdict, [COMMON], far, "adjustment: {min_intersection_deg: 0.1}\n")):
        with tempfile.TemporaryDirectory() as folder:
            test(pathlib.Path(folder), *arguments)


main()
