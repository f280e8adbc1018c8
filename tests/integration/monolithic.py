#!/usr/bin/python3
"""Compares the merged result of whole jobs with one monolithic adjustment of the same observations.
usage: monolithic.py MEGABLOCK

Before the merge, tiles screen their observations and adopt the frames that other tiles have moved. If a frame stayed
where its own tile put it, this test would show a difference of some sigmas. The solutions of a free block differ by
similarities; therefore the step that the monolithic problem would still make is calculated under inner constraints,
and no second adjustment is compared."""
import json
import os
import tempfile
from pathlib import Path

from program import megablock

SCENES = {"aerial": ["--scene", "aerial", "--frames", 60, "--control-points", 4, "--check-points", 3],
          "street": ["--scene", "street", "--frames", 48, "--gps-sigma", 0.1],
          "free": ["--scene", "aerial", "--frames", 60, "--gps-sigma", 0]}
FREE_DIRECTIONS = {"free": 7}
RANKS = {"free": 2}


def on_ranks(count):
    if count == 1:
        return {}
    return {"before": ["mpirun", "--bind-to", "none", "--oversubscribe", "--mca", "mpi_yield_when_idle", "1", "-n",
                       str(count)],
            "env": {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}}


def compare(folder, name):
    megablock("simulate", *SCENES[name], "--points-per-frame", 120, "--outliers", 0.02, "-o", folder)
    project = Path(folder) / "block.yaml"
    project.write_text(project.read_text() + "tiles:\n  tile_max_frames: 10\nmerge:\n  decrement: 1e-7\n")
    said = megablock("merge", project, "-j", Path(folder) / "job", "--quiet", "--monolithic",
                     **on_ranks(RANKS.get(name, 1)))
    figures = json.loads(said.splitlines()[-1])
    assert figures["tiles"] >= 4, figures
    assert figures["free_datum"] == FREE_DIRECTIONS.get(name, 0), figures
    assert figures["max_pose_difference_sigmas"] <= 1e-6, figures
    assert abs(figures["relative_cost_difference"]) <= 1e-9, figures
    if not figures["free_datum"]:
        assert figures["single_tile_converged"] and figures["single_tile_pose_difference_sigmas"] <= 1e-5, figures
    print(name, figures)


for name in SCENES:
    with tempfile.TemporaryDirectory() as folder:
        compare(folder, name)
