#!/usr/bin/python3
"""Tests the sigmas of free mounts in the result of whole jobs: they must be true, and have the same bits on two ranks.
usage: mounts.py MEGABLOCK

The given mounts of a simulated vehicle have errors with the stated sigmas. For the error e of a mount and its
covariance C, e'C^-1 e therefore has 6 degrees of freedom, and its sum over independent blocks follows the chi-square
distribution. The errors of the mounts of one block are correlated, because all are relative to the first mount. So
each mount has a sum of its own, and the mean over all mounts may scatter as it does between blocks.
"""
import json
import math
import os
import pathlib
import subprocess
import tempfile

import h5py
import numpy

from program import MEGABLOCK, megablock

BLOCKS = 25
NORMAL = 3.0902  # one-sided 0.1 %
SCENES = {  # whose datum control points give, and free but for the scale, which the rig gives
    "fixed": ["--scene", "target-field", "--frames", 24, "--points-per-frame", 150],
    "free": ["--scene", "stereopolis", "--frames", 40, "--rig-cameras", 6, "--gps-sigma", 0, "--attitude-sigma", 0,
             "--masked-share", 0, "--absent-share", 0]}


def chi_square(degrees, normal):
    """Quantile (Wilson and Hilferty); `normal`: that of the normal distribution."""
    return degrees * (1 - 2 / (9 * degrees) + normal * math.sqrt(2 / (9 * degrees))) ** 3


def increment(truth, found):
    """Log of conj(truth) * found, quaternions (w, x, y, z)."""
    w = truth @ found
    v = truth[0] * found[1:] - found[0] * truth[1:] - numpy.cross(truth[1:], found[1:])
    v = v if w > 0 else -v
    return 2 * math.atan2(numpy.linalg.norm(v), abs(w)) * v / max(numpy.linalg.norm(v), 1e-300)


def normalised_squares(block, job):
    """e'C^-1 e of the free mounts; held ones have no covariance and do not move."""
    with h5py.File(job / "result/block.h5") as result, h5py.File(block / "truth.h5") as true:
        rotation, centre, covariance = (result["mounts/" + name][:] for name in ("rotation_wxyz", "centre", "covariance"))
        held = (result["mounts/rotation_sigma"][:] == 0) & (result["mounts/position_sigma"][:] == 0)
        errors = [numpy.concatenate([increment(*q), c]) for q, c in
                  zip(zip(true["mounts/rotation_wxyz"][:], rotation), centre - true["mounts/centre"][:])]
    assert held[0] and not held[1:].any()
    assert not covariance[0].any() and not numpy.any(errors[0]), (covariance[0], errors[0])
    return [e @ numpy.linalg.solve(c, e) for e, c in zip(errors[1:], covariance[1:])]


def covariances(job):
    with h5py.File(job / "result/block.h5") as result:
        return {name: result[name + "/covariance"][:].tobytes() for name in ("mounts", "cameras", "frames")}


def on_two_ranks(project, job):
    subprocess.run(["mpirun", "--bind-to", "none", "--oversubscribe", "--mca", "mpi_yield_when_idle", "1", "-n", "2",
                    MEGABLOCK, "run", project, "-j", job, "-q"], check=True, stdout=subprocess.DEVNULL,
                   env={**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"})


def check_report(job):
    """The page has a sigma for every axis of a free mount, those of the result."""
    page = (job / "result/report.html").read_text()
    assert "σ about x [°]" in page
    begin = page.index("{", page.index("<script type=\"application/json\" id=\"figures\""))
    mounts = json.loads(page[begin:page.index("</script>", begin)])["mounts"]
    with h5py.File(job / "result/block.h5") as result:
        sigmas = numpy.sqrt(result["mounts/covariance"][:].diagonal(axis1=1, axis2=2))
    shown = numpy.array([m["sigma_rotation_rad"] + m["sigma_position_m"] for m in mounts])
    assert numpy.allclose(shown, sigmas, rtol=1e-12, atol=0)


def check_scaled(project, block):
    """Covariances times the variance factor, where the project asks for it."""
    scaled = block / "scaled.yaml"
    scaled.write_text(project.read_text() + "merge: {scale_sigma: true}\n")
    megablock("run", scaled, "-j", block / "scaled", "-q", "--threads", 1)
    with h5py.File(block / "job/result/block.h5") as one, h5py.File(block / "scaled/result/block.h5") as other:
        factor = one.attrs["variance_factor"]
        assert (other["mounts/covariance"][:] == factor * one["mounts/covariance"][:]).all()


def check_scene(folder, datum, options):
    squares = []
    for seed in range(1, BLOCKS + 1):
        block = folder / f"{datum}-{seed}"
        megablock("simulate", *options, "--seed", seed, "-o", block)
        project = block / "block.yaml"
        project.write_text(project.read_text() + "tiles: {tile_max_frames: 8, min_tiles_from: 10}\n")
        megablock("run", project, "-j", block / "job", "-q", "--threads", 1)
        assert len(list((block / "job/adjust").iterdir())) >= 4
        squares.append(normalised_squares(block, block / "job"))
        if seed == 1:
            on_two_ranks(project, block / "two")
            one, two = covariances(block / "job"), covariances(block / "two")
            assert one == two, [name for name in one if one[name] != two[name]]
            check_report(block / "job")
            check_scaled(project, block)
    of_mounts = numpy.sum(squares, axis=0)
    degrees = 6 * BLOCKS
    low, high = chi_square(degrees, -NORMAL), chi_square(degrees, NORMAL)
    of_blocks = numpy.mean(squares, axis=1) / 6
    deviation = (of_blocks.mean() - 1) / (of_blocks.std(ddof=1) / math.sqrt(BLOCKS))
    print(f"{datum}: {BLOCKS} blocks, e'C^-1 e / 6 of the mounts {of_mounts / degrees}, allowed {low / degrees:.3f} to "
          f"{high / degrees:.3f}; of all {of_blocks.mean():.3f}, {deviation:+.1f} of its standard errors from 1")
    assert ((low < of_mounts) & (of_mounts < high)).all()
    assert abs(deviation) < 4


def main():
    with tempfile.TemporaryDirectory() as folder:
        for datum, options in SCENES.items():
            check_scene(pathlib.Path(folder), datum, options)


main()
