#!/usr/bin/python3
"""The merged result of whole jobs against one monolithic adjustment of the same observations.
usage: monolithic.py MEGABLOCK

Tiles screen their observations and take over what others have moved before they are merged: a frame left where its own
tile put it would show here in sigmas."""
import json
import tempfile
from pathlib import Path

from program import megablock

SCENES = {"aerial": ["--frames", 60, "--control-points", 4, "--check-points", 3],
          "street": ["--frames", 48, "--gps-sigma", 0.1]}


def compare(folder, scene, arguments):
    megablock("simulate", "--scene", scene, *arguments, "--points-per-frame", 120, "--outliers", 0.02, "-o", folder)
    project = Path(folder) / "block.yaml"
    project.write_text(project.read_text() + "tiles:\n  tile_max_frames: 10\nmerge:\n  decrement: 1e-7\n")
    said = megablock("merge", project, "-j", Path(folder) / "job", "--quiet", "--monolithic")
    figures = json.loads(said.splitlines()[-1])
    assert figures["tiles"] >= 4, figures
    assert figures["max_pose_difference_sigmas"] <= 1e-6, figures
    assert abs(figures["relative_cost_difference"]) <= 1e-9, figures
    assert figures["single_tile_converged"] and figures["single_tile_pose_difference_sigmas"] <= 1e-5, figures
    print(scene, figures)


for scene, arguments in SCENES.items():
    with tempfile.TemporaryDirectory() as folder:
        compare(folder, scene, arguments)
