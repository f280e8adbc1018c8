#!/usr/bin/env python3
"""Runs blocks of real images from the folder of images to the merged block, and compares them with the required
figures.

usage: photographs.py MEGABLOCK DATA    (or the environment variable MEGABLOCK_DATA); skips (77) without the photographs
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

megablock = sys.argv[1]
data = pathlib.Path(os.environ.get("MEGABLOCK_DATA", sys.argv[2]))
if not (data / "brighton_beach").is_dir():
    print(f"skipped: no photographs in {data}")
    sys.exit(77)


def oriented(work, name, *init):
    """Figures of a whole run with default options."""
    project = work / f"{name}.yaml"
    subprocess.run([megablock, "init", str(data / name), "-o", str(project), *init], check=True,
                   stdout=subprocess.DEVNULL)
    return figures_of(project, name)


def with_verticals(work, name):
    """The same with what `megablock verticals` finds; features are those of the run without."""
    project, table = work / f"{name}_verticals.yaml", work / f"{name}.csv"
    subprocess.run([megablock, "verticals", str(work / f"{name}.yaml"), "-o", str(table)], check=True,
                   stdout=subprocess.DEVNULL)
    project.write_text((work / f"{name}.yaml").read_text() + f"verticals: {table}\n")
    return figures_of(project, name)


def figures_of(project, name):
    job = project.with_name(name)
    start = time.monotonic()
    subprocess.run([megablock, "run", str(project), "-j", str(job), "--quiet"], check=True, stdout=subprocess.DEVNULL)
    figures = json.loads(subprocess.check_output([megablock, "status", str(job), "--json"]))
    print(f"{project.stem}: {figures['oriented']} of {figures['images']} images, {figures['points']} points, "
          f"{figures['observations']} observations, mean track {figures['mean_track_length']:.2f}, mean residual "
          f"{figures['mean_reprojection_px']:.3f} px, decrement {figures['newton_decrement']:.1e}, "
          f"{figures['global_iterations']} iterations, {time.monotonic() - start:.0f} s")
    return figures


failed = []


def expect(condition, text):
    if not condition:
        failed.append(text)


with tempfile.TemporaryDirectory() as folder:
    work = pathlib.Path(folder)
    brighton = oriented(work, "brighton_beach")
    expect(brighton["oriented"] == 18, "brighton_beach: all 18 images")
    expect(brighton["mean_reprojection_px"] <= 0.6, "brighton_beach: mean residual at most 0.6 px")
    expect(brighton["observations"] >= 25000 and brighton["points"] >= 6000, "brighton_beach: 25 000 of 6 000 points")
    expect(brighton["mean_track_length"] >= 3.5, "brighton_beach: mean track 3.5")
    berlin = oriented(work, "berlin", "--control", str(data / "berlin" / "ground_control_points.json"))
    expect(berlin["oriented"] == 3, "berlin: all 3 images")
    # At least as many images with verticals.
    lund = oriented(work, "lund")
    expect(lund["oriented"] == 29, "lund: all 29 images")
    for name, without in ("berlin", berlin), ("lund", lund), ("brighton_beach", brighton):
        expect(with_verticals(work, name)["oriented"] >= without["oriented"], f"{name}: as many images with verticals")
    # Verticals that are wrong in every image are reported, and do no harm.
    project, names = work / "berlin.yaml", sorted(path.name for path in (data / "berlin").glob("*.jpg"))
    rows = [f"{name},{down},0.1\n" for name, down in zip(names, ["1,0,0", "-1,0,0", "0,-0.6,0.8"])]
    (work / "wrong.csv").write_text("image,down_x,down_y,down_z,sigma_deg\n" + "".join(rows))
    project.write_text(project.read_text() + "verticals: wrong.csv\n")
    said = subprocess.run([megablock, "run", str(project), "-j", str(work / "berlin")], check=True, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT).stdout
    wrong = json.loads(subprocess.check_output([megablock, "status", str(work / "berlin"), "--json"]))
    expect("3 of 3 verticals take no part" in said, "berlin: wrong verticals are named")
    for figure in "oriented", "points", "observations", "global_iterations":
        expect(wrong[figure] == berlin[figure], f"berlin: as many {figure} with wrong verticals")
    expect("vertical" not in wrong["observation_kinds"], "berlin: no vertical takes part")
    for name, figures in ("brighton_beach", brighton), ("berlin", berlin):
        expect(figures["newton_decrement"] <= 1e-2, f"{name}: converged to a decrement of 1e-2")
sys.exit("not reached: " + "; ".join(failed) if failed else 0)
