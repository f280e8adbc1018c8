#!/usr/bin/python3
"""Tests whether posterior sigmas are true, by the normalised errors of simulated blocks over many seeds.

Every seed gives a block that is simulated, adjusted and compared with its truth (megablock evaluate --scale-sigma). The
figures are sqrt(mean of e'C^-1 e / 3) over the frames or check points of a block, where e is the error and C its
posterior covariance times the a-posteriori variance factor. Their root mean square over the seeds is 1 if the sigmas
are true. Single seeds scatter, because the errors of the frames of a block are correlated.

With --tile-max-frames, interior frames and separator frames, which several tiles touch, are evaluated separately too.

The blocks have rendered images by default (about 30 s of processor time per seed). With --tie-points they have tie
points with exact Gaussian noise (1 s per seed). With --verify, the root mean squares must be 1 within four of their
standard errors, which follow from the scatter, and with 50 seeds or more also between 0.9 and 1.1.

    tests/benchmark/normalised_errors.py build/release/megablock --seeds 20
    tests/benchmark/normalised_errors.py build/release/megablock --seeds 40 --tie-points --verify
"""
import argparse
import concurrent.futures
import json
import math
import os
import subprocess
import sys
import tempfile

FIGURES = {"position": "normalised_error_position", "rotation": "normalised_error_rotation",
           "check": "normalised_error_check"}
TILED = {f"{what} {where}": f"normalised_error_{what}_{where}"
         for what in ("position", "rotation") for where in ("interior", "boundary")}


def run_seed(arguments, seed):
    """Figures of one seed: a dictionary."""
    with tempfile.TemporaryDirectory(prefix=f"normalised-errors-{seed}-") as folder:
        def megablock(*command):
            done = subprocess.run([arguments.megablock, *map(str, command)], capture_output=True, text=True,
                                  env={**os.environ, "OMP_NUM_THREADS": "1"})
            if done.returncode != 0:
                raise RuntimeError(f"seed {seed}: megablock {command[0]} ended with {done.returncode}: {done.stderr}")
            return done.stdout

        block, job = os.path.join(folder, "block"), os.path.join(folder, "job")
        size = [] if arguments.tie_points else ["--rendered", "--width", arguments.width, "--image-height",
                                                arguments.width * 3 // 4, "--focal", arguments.width * 4 // 5]
        megablock("simulate", "--scene", arguments.scene, "--frames", arguments.frames, "--seed", seed,
                  "--control-points", 5, "--check-points", 5, *size, *arguments.simulate, "-o", block)
        if arguments.tile_max_frames:
            with open(os.path.join(block, "block.yaml"), "a") as project:
                project.write(f"\ntiles:\n  tile_max_frames: {arguments.tile_max_frames}\n")
        megablock("run", os.path.join(block, "block.yaml"), "-j", job, "--threads", 1, "--quiet")
        figures = json.loads(megablock("evaluate", job, os.path.join(block, "truth.csv"), "--scale-sigma", "--json"))
        status = json.loads(megablock("status", job, "--json"))
        return {**figures, "seed": seed, "chi2_per_dof": status["chi2_per_dof"],
                "image_sigma_px": status["image_sigma_px"]}


def summary(values):
    """Mean, root mean square and the standard error of the latter."""
    n = len(values)
    squares = [v * v for v in values]
    mean_square = sum(squares) / n
    variance = sum((s - mean_square) ** 2 for s in squares) / max(1, n - 1)
    rms = math.sqrt(mean_square)
    return {"mean": sum(values) / n, "rms": rms, "standard_error": math.sqrt(variance / n) / (2 * rms)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("megablock", help="the program")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--scene", choices=["aerial", "street"], default="aerial")
    parser.add_argument("--tile-max-frames", type=int, help="cut the block into tiles; their frames by place, too")
    parser.add_argument("--width", type=int, default=640, help="of the rendered pictures, px")
    parser.add_argument("--tie-points", action="store_true", help="simulated tie points instead of pictures")
    parser.add_argument("--workers", type=int, default=2, help="seeds at a time")
    parser.add_argument("--verify", action="store_true", help="fail unless the errors agree with the sigmas")
    parser.add_argument("--simulate", nargs=argparse.REMAINDER, default=[], help="more options of 'simulate'; last")
    arguments = parser.parse_args()

    print(f"{'seed':>5} {'frames':>6} {'position':>9} {'rotation':>9} {'check':>7} {'sigma0^2':>9} {'image px':>9} "
          f"{'position m':>11} {'check hor. m':>13} {'check vert. m':>14}")
    rows = []
    with concurrent.futures.ThreadPoolExecutor(arguments.workers) as pool:
        seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
        for row in pool.map(lambda seed: run_seed(arguments, seed), seeds):
            rows.append(row)
            print(f"{row['seed']:5d} {row['frames']:6d} " +
                  " ".join(f"{row[key]:{width}.3f}" for key, width in zip(FIGURES.values(), (9, 9, 7))) +
                  f" {row['chi2_per_dof']:9.4f} {row['image_sigma_px']:9.4f} {row['position_rms_m']:11.4f}"
                  f" {row['check_rms_horizontal_m']:13.4f} {row['check_rms_vertical_m']:14.4f}", flush=True)

    result = {"seeds": len(rows), "frames": sum(row["frames"] for row in rows)}
    for name, key in {**FIGURES, **(TILED if arguments.tile_max_frames else {})}.items():
        result[name] = {k: round(v, 4) for k, v in summary([row[key] for row in rows]).items()}
    for key in ("chi2_per_dof", "image_sigma_px"):
        result[key] = round(sum(row[key] for row in rows) / len(rows), 4)
    print(json.dumps(result))
    if arguments.verify:
        wrong = [name for name, figures in result.items() if isinstance(figures, dict) and
                 (abs(figures["rms"] - 1) > 4 * figures["standard_error"] or
                  len(rows) >= 50 and not 0.9 <= figures["rms"] <= 1.1)]
        if wrong:
            sys.exit("the errors do not agree with the stated sigmas: " + ", ".join(wrong))


if __name__ == "__main__":
    main()
