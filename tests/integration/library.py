#!/usr/bin/env python3
"""Tests the installed library: the examples are configured, built and run against an install prefix, outside of the
tree.

The poses that the example prints are compared with the truth of the simulator, in units of their own standard
deviations. Every installed header is compiled, in two orders, so that none needs a header that is not installed or not
included.
usage: library.py MEGABLOCK BUILD_FOLDER SOURCE_FOLDER
"""
import csv
import io
import math
import pathlib
import subprocess
import sys
import tempfile

megablock, build, source = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def check(condition, what):
    if not condition:
        sys.exit(f"library.py: {what}")


def check_headers(prefix, folder):
    """Compiles one file that includes all installed headers, and one that includes them in the opposite order."""
    headers = sorted(str(path.relative_to(prefix / "include")) for path in (prefix / "include").rglob("*.h"))
    folder.mkdir()
    for name, order in (("forward", headers), ("backward", headers[::-1])):
        (folder / f"{name}.cpp").write_text("".join(f"#include <{header}>\n" for header in order))
    (folder / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.25)\nproject(headers LANGUAGES C CXX)\n"
        "find_package(megablock 0.1 REQUIRED)\nadd_library(headers OBJECT forward.cpp backward.cpp)\n"
        "target_compile_options(headers PRIVATE -fsyntax-only)\n"
        "target_link_libraries(headers PRIVATE megablock::megablock)\n")
    run("cmake", "-S", folder, "-B", folder / "build", f"-DCMAKE_PREFIX_PATH={prefix}")
    run("cmake", "--build", folder / "build", "--parallel", "2")
    print(f"{len(headers)} installed headers compile")


def check_poses(rows, truth):
    """Three coordinates of every frame: their errors over their standard deviations."""
    squares = []
    for row in rows:
        expected = truth[row["frame"]]
        for axis in "xyz":
            error = float(row[f"{axis}_m"]) - expected[axis]
            squares.append((error / float(row[f"sigma_{axis}_m"])) ** 2)
    rms = math.sqrt(sum(squares) / len(squares))
    # One adjustment of 20 frames: the root mean square of 60 correlated errors over their sigmas.
    check(0.5 < rms < 1.7, f"errors of the printed poses are {rms:.2f} times their standard deviations")
    print(f"{len(rows)} poses, errors {rms:.2f} times their standard deviations")


with tempfile.TemporaryDirectory() as name:
    work = pathlib.Path(name)
    prefix, examples = work / "prefix", work / "examples"
    run("cmake", "--install", build, "--prefix", prefix)
    run(prefix / "bin/megablock", "simulate", "--scene", "aerial", "--frames", "20", "--seed", "5", "-o", work / "block")
    run(prefix / "bin/megablock", "run", work / "block/block.yaml", "-j", work / "job", "--quiet")
    # From an empty folder, with nothing of this tree but the sources of the examples.
    run("cmake", "-S", source / "examples", "-B", examples, "-DCMAKE_BUILD_TYPE=Debug", f"-DCMAKE_PREFIX_PATH={prefix}",
        cwd=tempfile.mkdtemp(dir=work))
    run("cmake", "--build", examples, "--parallel", "2")
    check_headers(prefix, work / "headers")
    print(run(examples / "ransac_resection").strip())
    print(run(examples / "merge_block").strip())
    rows = list(csv.DictReader(io.StringIO(run(examples / "read_result", work / "job"))))
    check(len(rows) == 20, f"{len(rows)} frames, not 20")
    with open(work / "block/truth.csv") as file:
        table = csv.DictReader(line for line in file if not line.startswith("#"))
        truth = {row["name"]: {axis: float(row[axis]) for axis in "xyz"} for row in table}
    check_poses(rows, truth)
    points = list(csv.DictReader(io.StringIO(run(examples / "read_result", work / "job", "--points"))))
    check(len(points) > 100, f"{len(points)} points only")
    for point in points:
        check(all(float(point[f"c_{axes}_m2"]) > 0 for axes in ("xx", "yy", "zz")), "a point's variance is not positive")
    print(f"{len(points)} points with covariances")
