#!/usr/bin/python3
"""Spoils each mark and each coordinate of a control list in turn, leaves each point out in turn, and prints one table
of each: whether the spoilt one is named, how far the block is from the one that never had this observation and from the
one as given, in sigmas, and how far a point that is left out is off in its sigmas. Marks are moved by 100 px,
coordinates by 10 m. Needs python3-h5py and numpy.

usage: control_table.py MEGABLOCK IMAGES CONTROL [marks|coordinates|points ...]
       e.g. control_table.py build/release/megablock /data/copr/images /data/copr/gcp_list.txt
The list has lines `x y z column row image point` below its system, as WebODM writes it.
"""
import functools
import json
import pathlib
import re
import subprocess
import sys
import tempfile

import h5py
import numpy

MEGABLOCK, IMAGES, CONTROL = sys.argv[1:4]
WANTED = sys.argv[4:] or ["marks", "coordinates", "points"]
work = pathlib.Path(tempfile.mkdtemp(prefix="megablock-control-table-"))
job, project = work / "job", work / "block.yaml"
head, *lines = pathlib.Path(CONTROL).read_text().splitlines()
ROWS = [line.split() for line in lines if line.split()]
MIDDLE = sum(float(row[3]) for row in ROWS) / len(ROWS)
POINTS = sorted({row[6] for row in ROWS})


def adjust(rows, check=()):
    """The result of the block with these rows. The job keeps features and matches from run to run."""
    listed = work / "control.txt"
    listed.write_text("\n".join([head] + [" ".join(row) for row in rows]) + "\n")
    project.write_text(PROJECT + f"control: {{file: control.txt, check: [{', '.join(check)}]}}\n")
    done = subprocess.run([MEGABLOCK, "run", project, "-j", job, "-q"], capture_output=True, text=True)
    state = json.loads(subprocess.check_output([MEGABLOCK, "status", job, "--json"]))
    with h5py.File(job / "result/block.h5") as file:
        frames, control = file["frames"], file["control"]
        centre, covariance = frames["centre"][:], frames["covariance"][:, 3:, 3:]
        names = [name.decode() for name in control["name"][:]]
        difference = control["adjusted"][:] - control["position"][:]
        points = {n: (d, numpy.diag(c), s) for n, d, c, s in
                  zip(names, difference, control["covariance"][:], control["sigma"][:])}
    remarks = " ".join(state["remarks"])
    scale = re.search(r"control, horizontal .*? used the stated sigmas times ([0-9.]+)", remarks)
    return {"exit": done.returncode, "iterations": state["global_iterations"], "remarks": remarks, "centre": centre,
            "sigma": numpy.sqrt(numpy.einsum("fii->fi", covariance)), "points": points,
            "scale": float(scale.group(1)) if scale else 1.0}


def moved(result, base):
    """The largest movement of a coordinate of a frame's centre against another block, in the sigmas of that."""
    known = base["sigma"] > 0  # a coordinate that nothing determines is held
    return numpy.nanmax(numpy.abs(result["centre"] - base["centre"])[known] / base["sigma"][known])


@functools.cache
def left_out(point):
    """The block with a point as check point."""
    return adjust(ROWS, [point])


def spoilt(rows, column, by):
    return [[*row[:column], str(float(row[column]) + by), *row[column + 1:]] if row in rows else row for row in ROWS]


def print_case(name, result, named, without):
    """`without`: the block that never had the spoilt observation, which it should equal."""
    print(f"| {name} | {result['exit']} | {result['iterations']} | {'yes' if named else 'no'} | "
          f"{moved(result, without):.2f} | {moved(result, GIVEN):.2f} |", flush=True)
    cases.append((result["exit"] == 0, named, moved(result, without) <= 1, moved(result, GIVEN) <= 1))


subprocess.run([MEGABLOCK, "init", IMAGES, "-o", project], check=True, capture_output=True)
PROJECT = "".join(line for line in project.read_text().splitlines(True) if not line.startswith("control:"))
GIVEN = adjust(ROWS)
print(f"as given: exit code {GIVEN['exit']}, {GIVEN['iterations']} iterations, sigmas of control times {GIVEN['scale']}; "
      f"{GIVEN['remarks']}\n")
cases = []
if "marks" in WANTED or "coordinates" in WANTED:
    print("| spoilt | exit code | iterations | named | from the block without it, sigmas | from the block as given |\n"
          "|---|---|---|---|---|---|")
if "marks" in WANTED:
    for row in ROWS:
        result = adjust(spoilt([row], 3, 100 if float(row[3]) < MIDDLE else -100))  # it stays in its image
        # "p1 in a.jpg by 100 px", or "p1 (100 px in a.jpg, 60 px in b.jpg, rejected)" where no mark of the point is left.
        named = re.search(rf"\b{row[6]} (in {row[5]} by|\([^)]*px in {row[5]}, )", result["remarks"])
        without = adjust([other for other in ROWS if other != row])
        print_case(f"mark of {row[6]} in {row[5]}, 100 px", result, named, without)
if "coordinates" in WANTED:
    for point in POINTS:
        for column, axis in ((0, "x"), (1, "y")):
            result = adjust(spoilt([row for row in ROWS if row[6] == point], column, 10))
            named = re.search(rf"\b{point} (by [0-9.]+ m|\([^)]*, rejected)", result["remarks"])
            print_case(f"{axis} of {point}, 10 m", result, named, left_out(point))
if cases:
    print(f"\nof {len(cases)}: {sum(c[0] for c in cases)} end with 0, {sum(bool(c[1]) for c in cases)} are named, "
          f"{sum(bool(c[2]) for c in cases)} are within one sigma of the block without the spoilt observation, "
          f"{sum(bool(c[3]) for c in cases)} of the block as given")
if "points" in WANTED:
    print("\n| left out | error, m | sigma, m | error over sigma |\n|---|---|---|---|")
    ratios = []
    for point in POINTS:
        result = left_out(point)
        if point not in result["points"] or not numpy.isfinite(result["points"][point][0][:2]).all():
            print(f"| {point} | not intersected | | |", flush=True)
            continue
        difference, variance, stated = result["points"][point]
        # The point's own coordinates are as uncertain as those of the others.
        sigma = numpy.sqrt(variance[:2] + (stated[:2] * result["scale"]) ** 2)
        ratios += list(difference[:2] / sigma)
        print(f"| {point} | {difference[0]:.2f}, {difference[1]:.2f} | {sigma[0]:.2f}, {sigma[1]:.2f} | "
              f"{difference[0] / sigma[0]:.2f}, {difference[1] / sigma[1]:.2f} |", flush=True)
    print(f"\nrms of error over sigma: {numpy.sqrt(numpy.mean(numpy.square(ratios))):.2f}")
