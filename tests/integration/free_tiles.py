#!/usr/bin/python3
"""Tests a free street whose given poses are bent, in many small tiles without a common datum: it must be merged in few
iterations, and as exactly as one tile. usage: free_tiles.py MEGABLOCK"""
import json
import pathlib
import tempfile

from program import megablock, status

# With each tile put onto the given poses by itself it took 46, and 102 with attitudes, to a wrong place.
MOST_STEPS = 12


def run(project, job, truth):
    """Number of iterations, and errors after a similarity."""
    megablock("run", project, "-j", job, "-q")
    done, found = status(job), json.loads(megablock("evaluate", job, truth, "--json"))
    assert done["oriented"] == done["images"] and found["aligned"], (done, found)
    print(f"{project.parent.name}, {project.name}: {done['tiles']} tiles, {done['global_iterations']} steps, position "
          f"{found['position_rms_m']:.4f} m, rotation {found['rotation_rms_deg']:.4f} deg")
    return done, found


def main():
    with tempfile.TemporaryDirectory() as folder:
        for name, attitudes in ("free", 0), ("attitudes", 0.1):
            block = pathlib.Path(folder) / name
            megablock("simulate", "--scene", "street", "--frames", 90, "--street-spacing", 400, "--rig-cameras", 1,
                      "--gps-sigma", 0, "--attitude-sigma", attitudes, "-o", block)
            single, tiles = block / "block.yaml", block / "tiles.yaml"
            tiles.write_text(single.read_text() + "tiles: {tile_max_frames: 8}\n")
            _, at_once = run(single, block / "single-job", block / "truth.csv")
            done, merged = run(tiles, block / "tiles-job", block / "truth.csv")
            assert done["tiles"] > 10 and done["global_iterations"] <= MOST_STEPS, done
            for figure in "position_rms_m", "rotation_rms_deg":
                assert merged[figure] <= 1.05 * at_once[figure], (figure, merged, at_once)


main()
