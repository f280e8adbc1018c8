#!/usr/bin/env python3
"""Tests that every command of street mapping writes the same bytes on 1, 2 and 3 ranks, and after a SIGKILL.

usage: street_rig.py MEGABLOCK

`run` uses all options for a rig with poses: cones, masks, guided matching, filter, lines, estimated sigmas. A run is
killed twice; a command that only writes at its end is killed once. The moments are drawn evenly over the length of
the undisturbed run, and drawn again if a run ends before. kill_resume.py tests `register`.
"""
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import time

from sessions import kill_after, start

MEGABLOCK = sys.argv[1]
RANKS = (1, 2, 3)
OPTIONS = """masks: masks
lines: lines.csv
features: {max_features: 400}
matching: {guided: true, filter: true, k_best: 3}
merge: {estimate_sigmas: true}
tiles: {tile_max_frames: 5}
candidates: {cell_pairs: 50, neighbours: 6}
"""
LINES = """name,direction,image,column1_px,row1_px,column2_px,row2_px
edge,vertical,f000002_c21.jpg,60,20,62,90
sill,horizontal,f000003_c21.jpg,20,60,90,60
sill,horizontal,f000004_c21.jpg,30,61,95,61
"""


def simulate(folder, *options):
    subprocess.run([MEGABLOCK, "simulate", *options, "-o", folder], check=True, stdout=subprocess.DEVNULL)
    return folder / "block.yaml"


def contents(output):
    """Bytes of what a command wrote, by name; of a run its digest."""
    if (output / "result/block.h5").exists():
        return subprocess.check_output([MEGABLOCK, "status", output, "--digest"])
    files = [output] if output.is_file() else [f for f in output.iterdir() if f.suffix in (".yaml", ".html", ".png")]
    assert files, output
    return {f.name: f.read_bytes().replace(str(output).encode(), b"OUT") for f in files}


def remove(output):
    if output.is_dir():
        shutil.rmtree(output)
    else:
        output.unlink(missing_ok=True)


def finish(command, ranks, log):
    if start(command, ranks, log).wait(timeout=300) != 0:
        sys.exit(f"{command} failed on {ranks} ranks: {pathlib.Path(log.name).read_text()[-2000:]}")


def main():
    with tempfile.TemporaryDirectory() as folder:
        work = pathlib.Path(folder)
        pictures = simulate(work / "pictures", "--scene", "stereopolis", "--rendered", "--vehicle", "--frames", "10",
                            "--drives", "2", "--street-spacing", "40", "--width", "240", "--image-height", "135",
                            "--focal", "175", "--control-zones", "0")
        street = simulate(work / "street", "--scene", "stereopolis", "--frames", "60", "--street-spacing", "40",
                          "--points-per-frame", "100", "--outliers", "0.1", "--control-zones", "1")
        field = simulate(work / "field", "--scene", "target-field", "--frames", "8", "--points-per-frame", "100",
                         "--control-points", "40")
        panorama = simulate(work / "panorama", "--scene", "panorama", "--published-camera", "3", "--start-focal", "0.8")
        drawn = ["masks", pictures, "--min-images", "10", "--min-distance", "1", "-o"]
        subprocess.run([MEGABLOCK, *drawn, work / "pictures/masks"], check=True, stdout=subprocess.DEVNULL)
        (work / "pictures/lines.csv").write_text(LINES)
        everything = work / "pictures/all.yaml"
        everything.write_text(pictures.read_text() + OPTIONS)
        moments = random.Random(4711)
        with (work / "log").open("w") as log:
            for name, command in {
                "masks": drawn,
                "filter.yaml": ["train-filter", street, "--repetitions", "0", "-o"],
                "resected.csv": ["resect", street, "-o"],
                "calibration": ["calibrate", field, "-q", "-o"],
                "panoramic": ["calibrate", panorama, "--panoramic", "--model", "ign-radial", "-q", "-o"],
                "models": ["calibrate", street, "--compare-models", "--models", "pinhole,brown", "--max-frames", "12",
                           "--max-measurements", "3000", "-q", "-o"],
                "run": ["run", everything, "-q", "-j"],
            }.items():
                found = {}
                for ranks in RANKS:
                    output = work / f"ranks-{ranks}" / name
                    output.parent.mkdir(exist_ok=True)
                    begun = time.monotonic()
                    finish([MEGABLOCK, *command, output], ranks, log)
                    length_s = time.monotonic() - begun
                    found[f"{ranks} ranks"] = contents(output)
                killed = work / "killed" / name
                killed.parent.mkdir(exist_ok=True)
                kills = 2 if name == "run" else 1
                while kills > 0:
                    if kill_after([MEGABLOCK, *command, killed], 2, log, length_s * moments.random()):
                        kills -= 1
                    else:  # it came to its end first: other tests run beside this one
                        remove(killed)
                finish([MEGABLOCK, *command, killed], 2, log)
                found["killed"] = contents(killed)
                different = [how for how in found if found[how] != found["1 ranks"]]
                print(f"{name}: {'the same' if not different else 'DIFFERENT: ' + ', '.join(different)}, {length_s:.1f} s")
                if different:
                    sys.exit(f"{name} differs")


main()
