#!/usr/bin/python3
"""Runs rendered courtyards and towers, whose four sides look alike, with a focal length that is 30 % too short and too
long, and prints a table: how far the block is off its truth, its focal length, and whether parts of unknown size are
named. A block that is off by more than 0.1 m without a name is torn silently; there must be none. A run takes half a
minute to two minutes on two cores. Needs python3-h5py.

usage: look_alike_table.py MEGABLOCK FIRST_SEED LAST_SEED [courtyard|tower ...]
"""
import json
import pathlib
import subprocess
import sys
import tempfile

import h5py

MEGABLOCK, FIRST, LAST = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
SCENES = sys.argv[4:] or ["courtyard", "tower"]
TRUE_FOCAL_PX, TORN_M = 640, 0.1


def run_once(folder, factor):
    project, job = folder / f"{factor}.yaml", folder / f"job_{factor}"
    project.write_text((folder / "block.yaml").read_text() +
                       f"cameras: {{default: {{focal_px: {factor * TRUE_FOCAL_PX:.0f}}}}}\n")
    code = subprocess.run([MEGABLOCK, "run", project, "-j", job, "-q"], capture_output=True).returncode
    errors = json.loads(subprocess.check_output([MEGABLOCK, "evaluate", job, folder / "truth.csv", "--json"]))
    state = json.loads(subprocess.check_output([MEGABLOCK, "status", job, "--json"]))
    with h5py.File(job / "result/block.h5") as result:
        focal_px = result["cameras/intrinsics"][0, 0]
    named = sum("tells the size of this part" in remark for remark in state["remarks"])
    return code, errors, focal_px, named


print("| scene, seed | start | exit code | images | position rms, m | rotation rms, degrees | focal length, px | parts named |")
print("|---|---|---|---|---|---|---|---|")
silent = 0
for scene in SCENES:
    for seed in range(FIRST, LAST + 1):
        with tempfile.TemporaryDirectory(prefix="megablock-look-alike-") as scratch:
            folder = pathlib.Path(scratch)
            subprocess.run([MEGABLOCK, "simulate", "--rendered", "--scene", scene, "--seed", str(seed), "-o", folder],
                           check=True, capture_output=True)
            for factor in (0.7, 1.3):
                code, errors, focal_px, named = run_once(folder, factor)
                silent += errors["position_rms_m"] > TORN_M and named == 0
                print(f"| {scene} {seed} | {factor * TRUE_FOCAL_PX:.0f} | {code} | {errors['frames']} | "
                      f"{errors['position_rms_m']:.4f} | {errors['rotation_rms_deg']:.3f} | {focal_px:.1f} | {named} |",
                      flush=True)
print(f"\n{silent} torn without a name")
sys.exit(silent > 0)
