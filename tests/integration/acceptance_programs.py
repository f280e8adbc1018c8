#!/usr/bin/python3
"""Runs the programs for the acceptance of large blocks on small blocks: their last line must have every required figure
as a number, and the merge must be exact.
usage: acceptance_programs.py adjust_scale ADJUST_SCALE
       acceptance_programs.py against_ceres AGAINST_CERES"""
import json
import math
import os
import subprocess
import sys

SCALE_KEYS = ["observations", "observations_per_second_per_core", "seconds", "global_iterations", "chi2_per_dof",
              "peak_rss_mib_per_rank", "boundary_frames", "tiles", "points_across_tiles", "newton_decrement",
              "normalised_error_position", "normalised_error_rotation", "position_rms_m"]
EXACTNESS_KEYS = ["relative_cost_difference", "max_pose_difference_sigmas"]
RATIO_KEYS = ["seconds_per_iteration_ratio", "peak_memory_ratio"]
SIDE_KEYS = ["cost", "iterations", "observations", "seconds_per_iteration", "peak_rss_mib"]


def last_line(program, *arguments):
    """As JSON. Ranks that wait leave the cores to other tests."""
    output = subprocess.check_output([program, *map(str, arguments)], text=True,
                                     env={**os.environ, "OMPI_MCA_mpi_yield_when_idle": "1"})
    print(output, end="")
    return json.loads(output.splitlines()[-1])


def assert_numbers(figures, keys):
    for key in keys:
        assert isinstance(figures.get(key), (int, float)) and math.isfinite(figures[key]), f"{key}: {figures.get(key)}"


def adjust_scale(program):
    figures = last_line(program, "--scene", "street", "--frames", 100, "--ranks", 2)
    assert_numbers(figures, SCALE_KEYS)
    assert figures["observations"] > 90_000, figures
    assert figures["newton_decrement"] <= 1e-2, figures


def against_ceres(program):
    figures = last_line(program, "--scene", "street", "--frames", 60, "--tile-frames", 15)
    assert_numbers(figures, EXACTNESS_KEYS + RATIO_KEYS)
    assert abs(figures["relative_cost_difference"]) <= 1e-9, figures
    assert figures["max_pose_difference_sigmas"] <= 1e-6, figures
    for side in ("ours", "ceres"):
        assert_numbers(figures[side], SIDE_KEYS)
    assert figures["ours"]["observations"] == figures["ceres"]["observations"] > 50_000, figures


{"adjust_scale": adjust_scale, "against_ceres": against_ceres}[sys.argv[1]](sys.argv[2])
