#!/usr/bin/python3
"""From pixels to poses: rendered pictures of the Stereopolis vehicle, masks found in them, the whole run with its control,
poses against the truth. usage: pixels_to_poses.py MEGABLOCK [--full FOLDER]

--full: 40 frames of ten cameras (docs/benchmarks.md), kept in FOLDER."""
import json
import pathlib
import sys
import tempfile

from program import megablock, status

SMALL = ["--frames", 24, "--rig-cameras", 4, "--width", 480, "--image-height", 270, "--focal", 350, "--control-points", 24]
FULL = ["--frames", 40, "--width", 640, "--image-height", 360, "--focal", 467, "--control-zones", 2, "--control-points", 24,
        "--check-points", 12]
LIMITS = {"small": (0.02, 0.02), "full": (0.01, 0.01)}  # metres, degrees


def main():
    full = "--full" in sys.argv
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(sys.argv[-1] if full else scratch)
        megablock("simulate", "--scene", "stereopolis", "--rendered", "--vehicle", "--street-spacing", 60,
                  *(FULL if full else SMALL), "-o", folder)
        megablock("masks", folder / "block.yaml", "-o", folder / "masks")
        found, true = {p.name for p in (folder / "masks").glob("*.png")}, {p.name for p in (folder / "truth_masks").iterdir()}
        assert found and found <= true, (found, true)

        # The trajectory's stated sigmas lie: positions are left out, control gives the datum.
        project = folder / "block.yaml"
        text = project.read_text()
        begin, end = text.index("gps:"), text.index("rigs:")
        project.write_text(text[:begin] + "gps: {use: false}\nmasks: masks\n" + text[end:])
        job = folder / "job"
        megablock("run", project, "-j", job, "--quiet")
        figures = status(job)
        assert figures["oriented"] == figures["images"], figures
        assert figures["control_points_unused"] == 0, figures["remarks"]
        result = json.loads(megablock("evaluate", job, folder / "truth.csv", "--json"))
        position, rotation = LIMITS["full" if full else "small"]
        print({key: result[key] for key in ("position_rms_m", "position_max_m", "relative_position_rms_m",
                                            "rotation_rms_deg", "normalised_error_position", "normalised_error_rotation")})
        assert result["frames_missing"] == 0 and not result["aligned"], result
        assert result["position_rms_m"] <= position, result
        assert result["rotation_rms_deg"] <= rotation, result


main()
