#!/usr/bin/python3
"""Tests a whole job of images without positions that is oriented in parts, which are joined by similarities: the result
must be as good as that of an orientation as a whole. usage: parts.py MEGABLOCK"""
import json
import pathlib
import tempfile

from program import megablock, status

FRAMES = 60


def run(project, job, truth):
    """The digest of the result, and its errors after a similarity."""
    megablock("run", project, "-j", job, "-q")
    done, found = status(job), json.loads(megablock("evaluate", job, truth, "--json"))
    assert done["oriented"] == FRAMES and found["frames_missing"] == 0, (done, found)
    assert found["aligned"], found
    print(f"{project.name}: position {found['position_rms_m']:.4f} m, rotation {found['rotation_rms_deg']:.4f} deg, "
          f"sigma0^2 {done['chi2_per_dof']:.4f}, digest {done['digest']}")
    return done["digest"], found


def main():
    with tempfile.TemporaryDirectory() as folder:
        block, job = pathlib.Path(folder) / "block", pathlib.Path(folder) / "job"
        megablock("simulate", "--rendered", "--frames", FRAMES, "--width", 400, "--image-height", 300, "--focal", 310,
                  "--forward-overlap", 0.75, "--side-overlap", 0.4, "--gps-sigma", 0, "--no-calibration", "-o", block)
        whole, parts = block / "block.yaml", block / "parts.yaml"
        whole.write_text(whole.read_text() + "features: {max_features: 600}\n")
        parts.write_text(whole.read_text() + "orientation: {part_frames: 50}\n")
        digest, at_once = run(whole, job, block / "truth.csv")
        digest_of_parts, joined = run(parts, job, block / "truth.csv")  # pairs are there
        assert digest_of_parts != digest, "oriented as a whole: the same bits"
        for figure in "position_rms_m", "rotation_rms_deg":
            assert joined[figure] <= 1.01 * at_once[figure], (figure, joined, at_once)


main()
