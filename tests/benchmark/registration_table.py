#!/usr/bin/python3
"""Makes the table of CN-30 on a simulated Stereopolis block: errors of the trajectory by method, while one control zone
after the other is left out.

Absolute error: rms distance of the frames within 40 m of the points of the zone from their true positions. Relative
error: rms error of the vector between the frames of all true places. `resection alone` concerns the frames near a zone
that are resected from its points with the rig that `register` estimated, and those of them with a stated sigma of at
most 1 cm. Seconds are processor time, means over the zones.

    megablock simulate --scene stereopolis --frames 45000 --drives 4 --control-zones 7 -o town
    tests/benchmark/registration_table.py build/release/megablock town /tmp/job [--zones 0 1 4] [--only all ...]

Places are registered once; the rows differ only by the joint adjustment.
"""
import argparse
import csv
import math
import pathlib
import resource
import subprocess
import time

METHODS = [  # name, options of `register`
    ("resections + chain", ["--no-registrations", "--resections", "--no-control", "--no-positions"]),
    ("+ 2x2", ["--resections", "--no-control", "--no-positions"]),
    ("chain + 2x2", ["--no-control", "--no-positions"]),
    ("chain + 2x2 + control, zone not measured", ["--no-positions", "--check-points", "ignore"]),
    ("chain + 2x2 + control, zone as tie points", ["--no-positions", "--check-points", "tie"]),
    ("the same without 2x2", ["--no-positions", "--no-registrations", "--check-points", "tie"]),
    ("all and the positions, reweighted", ["--check-points", "tie"]),
]


def read_poses(path):
    with open(path) as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return {r["name"]: (tuple(float(r[k]) for k in ("qw", "qx", "qy", "qz")),
                            tuple(float(r[k]) for k in ("x", "y", "z"))) for r in rows}


def rotate(q, v):
    w, x, y, z = q
    t = (2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0]))
    return (v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2],
            v[2] + w * t[2] + x * t[1] - y * t[0])


def minus(a, b):
    return tuple(x - y for x, y in zip(a, b))


def norm(v):
    return math.sqrt(sum(x * x for x in v))


def rms(values):
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else float("nan")


def relative_error(poses, truth, places):
    def base(p, a, c):
        return rotate(p[a][0], minus(p[c][1], p[a][1]))
    return rms([norm(minus(base(poses, a, c), base(truth, a, c))) for a, c in places])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("megablock")
    parser.add_argument("block", type=pathlib.Path, help="folder of simulate")
    parser.add_argument("job", type=pathlib.Path)
    parser.add_argument("--zones", type=int, nargs="+", default=range(7), help="zones to leave out")
    parser.add_argument("--only", nargs="+", help="methods whose names begin so")
    arguments = parser.parse_args()
    truth = read_poses(arguments.block / "truth.csv")

    def megablock(*command):
        """What it printed, its processor time."""
        done = subprocess.run([arguments.megablock, *command], capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(done.stderr)
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        total, megablock.used = used.ru_utime + used.ru_stime, getattr(megablock, "used", 0)
        seconds, megablock.used = total - megablock.used, total
        return done.stdout, seconds

    def register(options):
        return megablock("register", arguments.block / "block.yaml", "-j", arguments.job, "-q", *options)

    begun = time.time()
    text, seconds = register([])
    print(text, f"first run {time.time() - begun:.0f} s, {seconds:.0f} s of processor time\n", sep="")
    with open(arguments.job / "register/registrations.csv") as file:
        rows = list(csv.DictReader(file))
    places = [(r["a"], r["c"]) for r in rows]
    start = read_poses(arguments.job / "register/start.csv")
    import h5py  # control points of the input
    with h5py.File(arguments.block / "given.h5") as given:
        control = {n.decode(): tuple(p) for n, p in
                   zip(given["control/name"][:], given["control/position"][:])}
    zones = {}  # frames near them
    for z in arguments.zones:
        points = [p for n, p in control.items() if n.startswith(f"zone{z}_")]
        if points:
            zones[z] = [n for n, (_, c) in truth.items() if min(norm(minus(c, p)) for p in points) < 40]

    def wanted(name):
        return not arguments.only or any(name.startswith(begin) for begin in arguments.only)

    def off(poses, frames):
        return rms([norm(minus(poses[n][1], truth[n][1])) for n in frames])

    def print_row(name, errors, relative, seconds):
        each = " ".join(f"{e:.3f}" for e in errors)  # nan: no such frame
        errors = [e for e in errors if e == e]
        between = f"{rms(relative):.4f}" if relative else "-"
        print(f"{name:44s} {rms(errors):.3f} ({each})   {between}   {seconds / len(zones):.0f}", flush=True)

    print(f"{'method':44s} absolute, m: mean over zones (each)    relative, m    s")
    if wanted("initial"):
        print_row("initial", [off(start, near) for near in zones.values()], [relative_error(start, truth, places)], 0)
    for name, options in METHODS:
        if not wanted(name):
            continue
        errors, relative, seconds = [], [], 0
        for z, near in zones.items():
            seconds += register([*options, "--check-prefix", f"zone{z}_"])[1]
            poses = read_poses(arguments.job / "register/poses.csv")
            errors.append(off(poses, near))
            relative.append(relative_error(poses, truth, places))
        print_row(name, errors, relative, seconds)
    for name, bound in (("resection alone", []), ("resection alone, stated within 1 cm", ["--max-sigma", "0.01"])):
        if not wanted(name):
            continue
        table = arguments.job / "resected.csv"
        seconds = megablock("resect", arguments.job / "register/block.yaml", "-o", table, *bound)[1]
        poses = read_poses(table)
        print_row(name, [off(poses, [n for n in near if n in poses]) for near in zones.values()], [], seconds * len(zones))


if __name__ == "__main__":
    main()
