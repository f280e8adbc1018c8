#!/usr/bin/env python3
"""Tests that `megablock verticals`, killed at random moments, keeps its results and writes the table of an undisturbed
run.

usage: verticals.py MEGABLOCK [--kills 4] [--seed 4711]
"""
import argparse
import pathlib
import random
import re
import subprocess
import tempfile

parser = argparse.ArgumentParser()
parser.add_argument("megablock")
parser.add_argument("--kills", type=int, default=4)
parser.add_argument("--seed", type=int, default=4711)
options = parser.parse_args()


def verticals(folder, table, longest_s=None):
    """What it said; nothing where it was killed."""
    try:
        return subprocess.run([options.megablock, "verticals", folder / "block.yaml", "-o", table], check=True,
                              capture_output=True, text=True, timeout=longest_s).stdout
    except subprocess.TimeoutExpired:  # which subprocess.run ends by SIGKILL
        return None


def looked_at_before(said):
    match = re.search(r"^(\d+) of \d+ images were looked at before$", said, re.MULTILINE)
    return int(match[1]) if match else 0


with tempfile.TemporaryDirectory() as scratch:
    folder, moments = pathlib.Path(scratch), random.Random(options.seed)
    subprocess.run([options.megablock, "simulate", "--scene", "street", "--rendered", "--frames", "8", "--width", "1440",
                    "--image-height", "960", "-o", folder / "block"], check=True, stdout=subprocess.DEVNULL)
    assert looked_at_before(verticals(folder / "block", folder / "alone.csv")) == 0
    kills = 0
    for _ in range(options.kills):
        kills += verticals(folder / "block", folder / "killed.csv", moments.uniform(1.2, 2.5)) is None
    assert kills > 0, "it was never killed"
    said = verticals(folder / "block", folder / "killed.csv")
    print(f"{kills} kills, then: {said}")
    assert looked_at_before(said) > 0, said
    for name in ("alone.csv", "alone.csv.found"):
        assert (folder / name).read_bytes() == (folder / name.replace("alone", "killed")).read_bytes(), name
    # The same again, with nothing to look at; other options look at all anew.
    assert looked_at_before(verticals(folder / "block", folder / "killed.csv")) == 32
    said = subprocess.check_output([options.megablock, "verticals", folder / "block/block.yaml", "-o",
                                    folder / "killed.csv", "--min-length", "40"], text=True)
    assert looked_at_before(said) == 0, said
