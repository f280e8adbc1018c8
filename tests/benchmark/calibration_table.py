#!/usr/bin/python3
"""Makes the table of rig calibrations of the simulated vehicle, whose mounts are off by 5 mm and 0.5 degrees: off-line,
on-line and both (CN-06, CN-07), and by the shape of the path (CN-08). Each result is verified on another site with 8
panoramas on a loop, 3 control and 92 check points, and the rig held as calibrated.

    tests/benchmark/calibration_table.py build/release/megablock [--seeds 5] [--mounts free]
"""
import argparse
import json
import math
import pathlib
import subprocess
import tempfile

SHAPES = ("all", "s", "loop", "line", "single", "sparse")


def rms(values):
    return math.sqrt(sum(v * v for v in values) / len(values))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("megablock")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--mounts", default="free", choices=("free", "stated"))
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)

        def megablock(*command):
            return subprocess.run([arguments.megablock, *map(str, command)], capture_output=True, text=True)

        def simulate(seed, target, path, *options):
            done = megablock("simulate", "--scene", "target-field", "--path", path, "--seed", seed, *options, "-o", target)
            if done.returncode:
                raise SystemExit(done.stderr)
            return target / "block.yaml"

        def calibrate(seed, label, project, mode):
            site = folder / f"site{seed}" / "block.yaml"
            if not site.exists():
                simulate(1000 + seed, site.parent, "loop", "--vehicle-seed", seed, "--frames", 8, "--control-points", 3,
                         "--check-points", 92)
            done = megablock("calibrate", project, "-o", folder / f"{label}-{mode}-{seed}", "--mode", mode, "--mounts",
                             arguments.mounts, "--verify", site, "--json", "-q")
            try:
                return json.loads(done.stdout)
            except json.JSONDecodeError:
                raise SystemExit(done.stderr)

        print("mode                     measurements  rms px (expected)    before   site: rms px (before)   "
              "check points mean, rms, mm (before)   rms / sigma  worst sigma mm, deg")
        for label, mode, path, frames, options in (
                ("off-line", "off-line", "loop", 4, ()), ("off-line, known cameras", "off-line", "loop", 4, ("--known-cameras",)),
                ("on-line", "on-line", "s", 30, ()), ("all", "all", "s", 30, ())):
            found = []
            for seed in range(1, arguments.seeds + 1):
                project = simulate(seed, folder / f"{label}{seed}", path, "--frames", frames, *options)
                found.append(calibrate(seed, label, project, mode))
            free = [m for f in found for m in f["mounts"] if not m["held"]]

            def mean(of):
                return sum(map(of, found)) / len(found)
            print(f"{label:25s}{mean(lambda f: f['after']['measurements']):10.0f}"
                  f"{mean(lambda f: f['after']['rms_px']):12.4f} ({mean(lambda f: 0.5 * (f['redundancy'] / f['residuals']) ** 0.5):.4f})"
                  f"{mean(lambda f: f['before']['rms_px']):12.2f}"
                  f"{mean(lambda f: f['verification']['rms_px']):16.3f} ({mean(lambda f: f['verification_before']['rms_px']):.2f})"
                  f"{mean(lambda f: 1e3 * f['verification']['check_points']['mean_m']):20.1f}"
                  f"{rms([1e3 * f['verification']['check_points']['rms_m'] for f in found]):8.1f}"
                  f" ({rms([1e3 * f['verification_before']['check_points']['rms_m'] for f in found]):.1f})"
                  f"{rms([f['verification']['check_points']['normalised'] for f in found]):14.2f}"
                  f"{max(1e3 * m['position_sigma_m'] for m in free):14.1f}{max(m['rotation_sigma_deg'] for m in free):9.3f}",
                  flush=True)

        print("\npath      site: rms px   mean length px   check points rms, mm   worst sigma mm, deg   refused   warnings   "
              "(start: rms px)")
        for mode in ("on-line", "all"):
            print(mode)
            for shape in SHAPES:
                found = []
                for seed in range(1, arguments.seeds + 1):
                    target = folder / f"{shape}{seed}"
                    project = target / "block.yaml"
                    if not project.exists():
                        simulate(seed, target, shape)
                    found.append(calibrate(seed, shape, project, mode))
                site = [f["verification"] for f in found]
                free = [m for f in found for m in f["mounts"] if not m["held"]]
                print(f"{shape:10s}{rms([s['rms_px'] for s in site]):12.3f}{sum(s['mean_px'] for s in site) / len(site):17.3f}"
                      f"{rms([1e3 * s['check_points']['rms_m'] for s in site]):23.1f}"
                      f"{max(1e3 * m['position_sigma_m'] for m in free):14.1f}{max(m['rotation_sigma_deg'] for m in free):9.3f}"
                      f"{sum(bool(f['refused']) for f in found):10d}/{len(found)}"
                      f"{sum(len(f['warnings']) for f in found) / len(found):11.1f}"
                      f"{rms([f['verification_before']['rms_px'] for f in found]):14.2f}", flush=True)


if __name__ == "__main__":
    main()
