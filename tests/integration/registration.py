#!/usr/bin/env python3
"""Tests a street-rig block from its trajectory to the bundle adjustment: simulate, register, run, evaluate, report.

usage: registration.py MEGABLOCK
The mounts are off by their default 5 mm and 0.5 degrees, the trajectory by metres where satellites are masked.
"""
import csv
import json
import pathlib
import sys
import tempfile

from program import BAD_INPUT, megablock, one_line, status

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / "benchmark"))
from registration_table import minus, norm, read_poses, relative_error, rms  # noqa: E402


def figure(text, line, word):
    """The number before or after a word in a line of the summary."""
    return next(t for t in text.splitlines() if t.startswith(line)).split(word)[1].split()[0].rstrip(",")


def errors(poses, truth):
    return rms([norm(minus(poses[n][1], truth[n][1])) for n in truth])


with tempfile.TemporaryDirectory() as folder:
    work = pathlib.Path(folder)
    megablock("simulate", "--scene", "stereopolis", "--frames", 300, "--street-spacing", 60, "--drift-per-frame", 0.05,
              "--control-zones", 2, "-o", work / "block")
    truth = read_poses(work / "block/truth.csv")
    project = work / "block/block.yaml"

    said = megablock("register", project, "-j", work / "job", "-q")
    print(said)
    before, after = (read_poses(work / "job/register" / name) for name in ("start.csv", "poses.csv"))
    with open(work / "job/register/registrations.csv") as file:
        places = [(row["a"], row["c"]) for row in csv.DictReader(file) if row["holds"] == "1"]
    print(f"{len(places)} places: trajectory {errors(before, truth):.3f} m, where passes meet "
          f"{relative_error(before, truth, places):.3f} m; registered {errors(after, truth):.3f} m, "
          f"{relative_error(after, truth, places):.4f} m")
    assert len(places) >= 15, places
    assert errors(before, truth) > 0.3 and relative_error(before, truth, places) > 0.5, "the trajectory drifts"
    assert relative_error(after, truth, places) < 0.01, "published: 0.01 to 0.05 m"
    assert errors(after, truth) < 0.1, "published: 0.30 m"
    assert errors(before, truth) > 3 * errors(after, truth)

    # Without an estimated rig hardly a place can be registered: that is what the estimate is for.
    held = megablock("register", project, "-j", work / "held", "-q", "--hold-rig")
    assert int(figure(held, "places", "registered ")) < len(places) / 2, held

    # The bundle adjustment from there.
    megablock("run", work / "job/register/block.yaml", "-j", work / "run", "-q")
    figures = status(work / "run")
    judged = json.loads(megablock("evaluate", work / "run", work / "block/truth.csv", "--json"))
    print(json.dumps(figures), json.dumps(judged))
    assert figures["oriented"] == 3000, figures
    assert judged["position_rms_m"] < 0.02 and not judged["aligned"], judged
    assert judged["relative_position_rms_m"] < 0.005 and judged["rotation_rms_deg"] < 0.015, judged
    assert judged["check_rms_m"] < 0.05, judged
    assert judged["normalised_error_position"] < 1.4, "the sigmas are true or cautious"
    assert (work / "run/result/report.html").exists()

    # What is asked of something that is not there is refused in one line.
    def refused(*arguments):
        return one_line(megablock(*arguments, expect=BAD_INPUT))

    assert "no control point's name begins with 'zone9_'" in refused(
        "register", project, "-j", work / "job", "-q", "--check-prefix", "zone9_")
    assert "--d-cons: '0' is not a number above 0" in refused("register", project, "-j", work / "job", "--d-cons", 0)
    megablock("simulate", "--scene", "street", "--frames", 6, "--rig-cameras", 2, "-o", work / "bare")
    assert "no measured control points" in refused("resect", work / "bare/block.yaml", "-o", work / "resected.csv")
    assert "no image files" in refused("masks", work / "bare/block.yaml", "-o", work / "masks")

    # Tie points that are none: told at once, not as places that nobody registers.
    bare, tie_points = work / "bare/block.yaml", work / "bare/tie_points.h5"
    whole = tie_points.read_bytes()
    for damaged, why in (whole[:1000], "cannot be opened"), ((work / "bare/given.h5").read_bytes(), "holds 'block'"):
        tie_points.write_bytes(damaged)
        said = refused("register", bare, "-j", work / "none", "-q")
        assert "block.yaml:" in said and "tie_points: " in said and why in said and "delete" not in said, said
