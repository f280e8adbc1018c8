#!/usr/bin/python3
"""Tests the effect of the options on sigmas in whole runs. usage: sigmas.py MEGABLOCK"""
import json
import os
import re
import subprocess
import sys
import tempfile

import h5py

NOISE_PX = 0.2


def megablock(*command):
    done = subprocess.run([sys.argv[1], *map(str, command)], capture_output=True, text=True)
    assert done.returncode == 0, (command, done.stderr)
    return done.stdout


def run(folder, name, settings):
    """Runs the block with these lines in its project; status, evaluation as it is, evaluation with --scale-sigma."""
    project, job = os.path.join(folder, name + ".yaml"), os.path.join(folder, name)
    with open(os.path.join(folder, "block.yaml")) as block, open(project, "w") as out:
        out.write(block.read() + settings)
    megablock("run", project, "-j", job, "--quiet")
    truth = os.path.join(folder, "truth.csv")
    return (json.loads(megablock("status", job, "--json")), json.loads(megablock("evaluate", job, truth, "--json")),
            json.loads(megablock("evaluate", job, truth, "--json", "--scale-sigma")))


def check_what_is_said(folder):
    """Rounds before the last end by a limit of their own and say so; options of positions are in the result."""
    project, job = os.path.join(folder, "said.yaml"), os.path.join(folder, "said")
    with open(os.path.join(folder, "block.yaml")) as block, open(project, "w") as out:
        out.write(block.read() + "gps: {sigma_horizontal_m: 0.07}\n")
    done = subprocess.run([sys.argv[1], "run", project, "-j", job], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    ends = [line for line in done.stderr.splitlines() if "global adjustment converged" in line]
    assert len(ends) > 1 and "limit" not in ends[-1], done.stderr
    # 0.1 sqrt(6 * 16) in the first round, and a tenth of it in those after it.
    limits = [re.search(r"\(limit (\S+) before the last screening\)$", line).group(1) for line in ends[:-1]]
    assert limits[0] == "9.8e-01" and set(limits[1:]) <= {"9.8e-02"}, ends
    for text in (done.stdout + done.stderr, megablock("status", job)):
        assert re.search(r"  4 check points: rms of adjusted - given 0\.\d+ m horizontal", text), text
    with h5py.File(os.path.join(job, "result/block.h5")) as result:
        names, values, defaults = (result[f"options/{k}"].asstr()[:] for k in ("name", "value", "default"))
        options = dict(zip(names, zip(values, defaults)))
    assert options["gps.sigma_horizontal_m"] == ("0.07", "as given"), options
    assert options["gps.use"] == ("true", "true") and "attitude.sigma_deg" in options, options


def near(value, expected, tolerance):
    assert abs(value - expected) <= tolerance, (value, expected, tolerance)


def main():
    with tempfile.TemporaryDirectory() as folder:
        megablock("simulate", "--frames", 16, "--noise", NOISE_PX, "--control-points", 3, "--check-points", 4, "-o", folder)

        check_what_is_said(folder)
        status, plain, scaled = run(folder, "estimated", "")
        near(status["image_sigma_px"], NOISE_PX, 0.05 * NOISE_PX)
        near(status["chi2_per_dof"], 1, 0.05)
        assert not status["remarks"], status["remarks"]
        near(scaled["normalised_error_position"],
             plain["normalised_error_position"] / status["chi2_per_dof"] ** 0.5, 1e-9)

        # The guess of 0.5 px holds: the variance factor tells that it is wrong.
        status, plain, scaled = run(folder, "stated", "adjustment:\n  estimate_image_sigma: false\n")
        assert status["image_sigma_px"] == 0.5, status["image_sigma_px"]
        near(status["chi2_per_dof"], (NOISE_PX / 0.5) ** 2, 0.02)
        assert any(line.startswith("Residuals are 0.") for line in status["remarks"]), status["remarks"]

        # The job scales its covariances: 'evaluate' does not scale them again.
        status, once, twice = run(folder, "scaled", "adjustment:\n  estimate_image_sigma: false\n"
                                                    "merge:\n  scale_sigma: true\n")
        for key in ("normalised_error_position", "normalised_error_rotation", "normalised_error_check"):
            near(once[key], scaled[key], 1e-6 * scaled[key])
            assert twice[key] == once[key], key
        assert once["normalised_error_rotation"] > 2 * plain["normalised_error_rotation"]

    # Of a block without a datum: at half of the true sigma a tenth of all measurements is near the limit of screening.
    with tempfile.TemporaryDirectory() as folder:
        megablock("simulate", "--frames", 16, "--noise", NOISE_PX, "--gps-sigma", 0, "-o", folder)
        half = f"adjustment: {{image_sigma_px: {NOISE_PX / 2}, estimate_image_sigma: false}}\n"
        tiles = "tiles: {tile_max_frames: 8}\n"
        for name, settings, many in ("clean", tiles, False), ("many", tiles + half, True), ("one-tile", half, False):
            status, _, _ = run(folder, name, settings)
            assert (status["tiles"] == 1) == (name == "one-tile"), status["tiles"]
            assert any("of the limit of screening" in line for line in status["remarks"]) == many, status["remarks"]

    # Redundancy numbers add up to the degrees of freedom, whatever the datum.
    with tempfile.TemporaryDirectory() as folder:
        for gps in 0.05, 0:
            megablock("simulate", "--frames", 16, "--gps-sigma", gps, "-o", os.path.join(folder, str(gps)))
            status, _, _ = run(os.path.join(folder, str(gps)), "job", "")
            assert ("free" in status["gauge"]) == (gps == 0), status["gauge"]
            near(sum(kind["redundancy"] for kind in status["observation_kinds"].values()),
                 status["degrees_of_freedom"], 1e-3)

    # A trajectory whose satellites are masked states 2 cm where it drifts by decimetres: its residuals tell.
    with tempfile.TemporaryDirectory() as folder:
        megablock("simulate", "--scene", "stereopolis", "--frames", 60, "--drift-per-frame", 0.2, "-o", folder)
        stated, _, _ = run(folder, "stated", "adjustment:\n  position_loss: huber\nmerge:\n  scale_contradicted_sigmas: false\n")
        estimated, _, _ = run(folder, "estimated", "merge:\n  estimate_sigmas: true\n")
        for status in stated, estimated:
            assert status["observation_kinds"]["position_horizontal"]["sigma_factor"] > 2, status["observation_kinds"]
        assert abs(stated["chi2_per_dof"] - 1) > 0.05, stated["chi2_per_dof"]
        near(estimated["chi2_per_dof"], 1, 0.02)


main()
