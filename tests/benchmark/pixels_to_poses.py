#!/usr/bin/python3
"""Computes poses from pixels and compares them with the truth. Images of the Stereopolis vehicle are rendered (40
frames of ten cameras), masks are found in them, the rig is calibrated on a simulated target field, and a whole run uses
control points.

usage: pixels_to_poses.py MEGABLOCK FOLDER [--width 960] [--known-rig]

The positions of the trajectory are not used, because their stated sigmas are too small; control points give the datum.
Cameras and mounts have the values and sigmas of the target field as priors and are estimated with the poses; with
--known-rig they are held at the truth. Parts that FOLDER has already are not computed again. The exit code is 1 if
positions are worse than 1 cm rms, or rotations worse than 0.01 degrees rms."""
import argparse
import json
import pathlib
import re
import subprocess
import sys
import time

FIELD_FRAMES = 160


def calibrate(megablock, folder, block, size):
    """calibration.yaml of the same vehicle, with the names that the headers of the images give to the cameras."""
    megablock("simulate", "--scene", "target-field", "--path", "all", "--frames", FIELD_FRAMES, *size, "-o", folder / "field")
    megablock("calibrate", folder / "field" / "block.yaml", "-o", folder / "calibration")
    text = (folder / "calibration" / "calibration.yaml").read_text()
    for name, short in re.findall(r'"(Megablock Simulated (c\d+) [^"]*)"', block):
        text = text.replace(f'"{short}"', f'"{name}"')
    (folder / "calibration.yaml").write_text(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("megablock")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--width", type=int, default=960, help="of the pictures; the focal length is 35/48 of it")
    parser.add_argument("--known-rig", action="store_true", help="hold cameras and mounts at the truth")
    options = parser.parse_args()

    def megablock(*arguments):
        return subprocess.run([options.megablock, *map(str, arguments)], check=True, stdout=subprocess.PIPE, text=True).stdout

    folder = options.folder
    size = ["--width", options.width, "--image-height", options.width * 9 // 16, "--focal", options.width * 35 / 48]
    if not (folder / "block.yaml").exists():
        megablock("simulate", "--scene", "stereopolis", "--rendered", "--vehicle", "--street-spacing", 60, "--frames", 40, *size,
                  "--control-points", 24, "--check-points", 12, "--control-sigma", 0.005,
                  *(["--no-calibration"] if options.known_rig else []), "-o", folder)
    if not (folder / "masks").exists():
        megablock("masks", folder / "block.yaml", "-o", folder / "masks")
    block = (folder / "block.yaml").read_text()
    begin, end = block.index("gps:"), block.index("rigs:")
    text = block[:begin] + "gps: {use: false}\nmasks: masks\n" + block[end:]
    if not options.known_rig:
        calibrate(megablock, folder, block, size)
        text += "calibration: {file: calibration.yaml, hold: false}\n"
    project = folder / "control_only.yaml"
    project.write_text(text)

    start = time.monotonic()
    megablock("run", project, "-j", folder / "job", "--quiet")
    seconds = time.monotonic() - start
    figures = json.loads(megablock("status", folder / "job", "--json"))
    result = json.loads(megablock("evaluate", folder / "job", folder / "truth.csv", "--json"))
    print(json.dumps(result, indent=1))
    print(f"run {seconds:.0f} s; {figures['oriented']} of {figures['images']} images; positions "
          f"{1000 * result['position_rms_m']:.1f} mm, rotations {result['rotation_rms_deg']:.4f} degrees")
    if figures["oriented"] < figures["images"] or result["frames_missing"] or result["aligned"]:
        return "not all frames are oriented in the frame of the control points"
    if result["position_rms_m"] > 0.01 or result["rotation_rms_deg"] > 0.01:
        return "positions are worse than 1 cm or rotations than 0.01 degrees"
    return 0


sys.exit(main())
