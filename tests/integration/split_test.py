#!/usr/bin/env python3
"""Tests `evaluate --halves`: on simulated blocks the differences of the halves have their sigmas, free and with positions,
in one tile and in several; the job stays as it was. usage: split_test.py MEGABLOCK [SEEDS]"""
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile

from program import BAD_INPUT, MEGABLOCK, megablock, one_line

SEEDS = int(sys.argv[1]) if len(sys.argv) > 1 else 6  # program.py has taken the program
FIGURES = [(kind, sigma) for kind in ("positions", "rotations", "cameras") for sigma in ("formal", "empirical")]


def ratio(halves, kind, sigma):
    key = f"over_{sigma}_sigma"
    return halves[kind][0][key] if kind == "cameras" else halves[kind][key]


def main():
    with tempfile.TemporaryDirectory() as name:
        folder, sums = pathlib.Path(name), {}
        for seed in range(1, SEEDS + 1):
            for gps in 0, 0.05:
                block = folder / f"{seed}-{gps}"
                megablock("simulate", "--frames", 24, "--points-per-frame", 150, "--seed", seed, "--gps-sigma", gps,
                          "--check-points", 3, "--control-points", 4 if gps else 0, "-o", block)
                if seed % 2:
                    with open(block / "block.yaml", "a") as project:
                        project.write("tiles: {tile_max_frames: 8}\n")
                job = block / "job"
                megablock("run", block / "block.yaml", "-j", job, "-q")
                digest = megablock("status", job, "--digest")
                text = megablock("evaluate", job, "--halves", "--divisions", 4, "--json", "-q")
                halves = json.loads(text)
                # An image at the edge may see only tracks that begin in images of one half.
                assert halves["aligned"] == (gps == 0) and halves["frames_missing"] <= 2, halves
                assert not halves["note"], halves
                assert megablock("status", job, "--digest") == digest and not (job / "halves").exists()
                for figure in FIGURES:
                    sums.setdefault((gps, *figure), []).append(ratio(halves, *figure) ** 2)
                if gps:
                    sums.setdefault((gps, "points", "formal"), []).append(halves["points"]["over_formal_sigma"] ** 2)
        wrong = []
        for key, squares in sums.items():
            mean = math.sqrt(sum(squares) / len(squares))
            print(f"gps {key[0]}: difference of {key[1]} over {key[2]} sigma {mean:.3f} ({len(squares)} blocks)")
            # The poses of a block bend together, so that a ratio scatters by a fifth from block to block.
            if abs(mean - 1) > 0.6 / math.sqrt(len(squares)):
                wrong.append(key)
        assert not wrong, wrong
        assert "--halves" in megablock("evaluate", job, expect=BAD_INPUT)
        text = megablock("evaluate", job, "--halves", "--divisions", 1)
        for line in "1/4          tie points, half 1, division 1 of 1", "4/4          images, half 2":
            assert line in text.splitlines(), text
        for frames in 2, 3:
            block = folder / f"{frames}"
            megablock("simulate", "--frames", frames, "--points-per-frame", 150, "-o", block)
            # The adjustment of so small a block may not converge, which does not matter here.
            subprocess.run([MEGABLOCK, "run", block / "block.yaml", "-j", block / "job", "-q"], capture_output=True)
            said = one_line(megablock("evaluate", block / "job", "--halves", expect=BAD_INPUT))
            assert re.search(f"halves need 4 oriented images.* has {frames}; compare it with known poses", said), said
            assert not (block / "job/halves").exists()


main()
