#!/usr/bin/env python3
"""Tests that only the dependent units are computed again when an image is added to a finished job, or an option
changes.

usage: growth.py MEGABLOCK [unittest arguments]
Works on a rendered block of four tiles; needs nothing but the program and the standard library (and mpirun, if there).
"""
import collections
import csv
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from program import MEGABLOCK, events, megablock, status

work = pathlib.Path(tempfile.mkdtemp(prefix="megablock-growth-"))
WIDTH, HEIGHT = 400, 300  # px
ADDED = ["f000000.jpg", "f000005.jpg"]  # corners of the block, so that one lies far from some of the tiles


def write_project(folder, sections):
    text = (folder / "rendered.yaml").read_text()
    for section, values in sections.items():
        text += f"{section}: {{{', '.join(f'{key}: {value}' for key, value in values.items())}}}\n"
    (folder / "block.yaml").write_text(text)


def run(folder, *ranks):
    """Runs the job of a folder; returns the units computed by stage."""
    before = len(events(folder / "job")) if (folder / "job").exists() else 0
    environment = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    megablock("run", folder / "block.yaml", "-j", folder / "job", "-q", before=ranks, env=environment)
    units = {}
    for event in events(folder / "job")[before:]:
        units.setdefault(event["stage"], []).append(event["unit"])
    return units


def unit_files(folder):
    """Content and time of every unit file."""
    return {str(file.relative_to(folder / "job")): (file.read_bytes(), file.stat().st_mtime_ns)
            for file in (folder / "job").rglob("*") if re.fullmatch(r"\d{6}\.h5", file.name)}


def add_image(folder, name):
    shutil.copy(work / "all/images" / name, folder / "images")


def simulate(frames, name, *options):
    megablock("simulate", "--rendered", "--frames", frames, "--forward-overlap", 0.7, "--side-overlap", 0.45,
              "--width", WIDTH, "--image-height", HEIGHT, "--focal", 312, *options, "-o", work / name)


OPTIONS = {"features": {"max_features": 1000}, "tiles": {"min_tiles": 4, "min_tiles_from": 20}}


def setUpModule():
    simulate(36, "all")
    (work / "all/block.yaml").rename(work / "all/rendered.yaml")
    shutil.copytree(work / "all", work / "first")
    for name in ADDED:
        (work / "first/images" / name).unlink()
    write_project(work / "first", OPTIONS)
    run(work / "first")
    assert status(work / "first/job")["tiles"] == 4


def tearDownModule():
    shutil.rmtree(work)


def measurements(job, *question):
    text = subprocess.check_output([MEGABLOCK, "measurements", job, *map(str, question)], text=True)
    return list(csv.DictReader(text.splitlines()))


class Growth(unittest.TestCase):
    def setUp(self):
        self.folder = work / self.id().split(".")[-1]
        shutil.copytree(work / "first", self.folder)

    def test_an_added_image_touches_its_own_units_only(self):
        for generation, name in enumerate(ADDED, 1):
            before = unit_files(self.folder)
            add_image(self.folder, name)
            units = run(self.folder)
            after = unit_files(self.folder)
            self.assertEqual(status(self.folder / "job")["oriented"], 34 + generation)

            self.assertEqual(units["features"], ["features/000000.h5"])
            self.assertEqual(units["orientation"], [f"orient/{generation:06}.h5"])
            new_cells = [file for file in sorted(after) if file.startswith("matches/") and file not in before]
            self.assertEqual(sorted(units["matching"]), new_cells)
            changed_tracks = [file for file in sorted(after) if file.startswith("tracks/") and after[file] != before[file]]
            # Those of the tiles whose tie points the image sees; its neighbours' points stay where they were.
            seen = {row["tile"] for row in measurements(self.folder / "job", "--image", name)}
            self.assertEqual(changed_tracks, [f"tracks/{int(tile):06}.h5" for tile in sorted(seen, key=int)])
            self.assertLess(len(changed_tracks), status(self.folder / "job")["tiles"])
            self.assertEqual(sorted(units["adjustment"]), sorted(f.replace("tracks", "adjust") for f in changed_tracks))
            self.assertEqual(sorted(units["coverage"]),
                             [f.replace("tracks", "coverage").replace(".h5", ".txt") for f in changed_tracks])
            self.assertIn("result/block.h5", units["merge"])
            self.assertEqual(units["candidates"] + units["tiles"] + units["tracks"],
                             ["graph.h5", "tiles.h5", "tracks/index.txt"])

            self.check_measurements(name)

            computed = {unit for stage in units.values() for unit in stage} | set(changed_tracks)
            self.assertEqual({file for file in after if after[file] != before.get(file)}, computed & set(after))
            self.assertEqual(set(before) - set(after), set())

    def check_measurements(self, added):
        """By image (the files of tracks) and by place (the result) are the same rows, the added image's among them."""
        job = self.folder / "job"
        images = sorted(path.name for path in (self.folder / "images").glob("*.jpg"))
        by_image = {image: measurements(job, "--image", image) for image in images}
        self.check_coverage(by_image)
        self.assertTrue(all(row["image"] == image for image, rows in by_image.items() for row in rows))
        self.assertGreater(len(by_image[added]), 20)
        self.assertEqual(by_image[added], measurements(job, "--frame", added))
        by_place = measurements(job, "--near", "0,0", "--radius", 1e6)
        self.assertEqual(sum(row["kept"] == "1" for row in by_place), status(job)["observations"])
        keys = ("image", "track", "x_px", "y_px", "feature", "tile")
        tracks = {tuple(row[key] for key in keys) for rows in by_image.values() for row in rows}
        points = {tuple(row[key] for key in keys) for row in by_place}
        self.assertEqual(len(tracks), sum(map(len, by_image.values())))
        self.assertLessEqual(points, tracks)
        self.assertGreater(len(points), 0.9 * len(tracks))  # the others have no position
        self.assertEqual(measurements(job, *(word for image in images for word in ("--image", image))),
                         [row for image in sorted(images, key=self.index_of) for row in by_image[image]])

    def check_coverage(self, by_image):
        """The table of the coverage says what the measurements by image say."""
        with (self.folder / "job/result/coverage.csv").open() as file:
            table = {row["image"]: row for row in csv.DictReader(file)}
        self.assertEqual(set(table), set(by_image))
        seen_by = collections.Counter(row["track"] for rows in by_image.values() for row in rows)
        for image, rows in by_image.items():
            cells = {(int(4 * float(row["x_px"]) / WIDTH), int(4 * float(row["y_px"]) / HEIGHT)) for row in rows}
            images = sum(seen_by[row["track"]] for row in rows) / len(rows)
            self.assertEqual(int(table[image]["observations"]), len(rows))
            self.assertAlmostEqual(float(table[image]["covered_share"]), len(cells) / 16, places=4)
            self.assertAlmostEqual(float(table[image]["images_per_point"]), images, delta=0.006)

    def index_of(self, image):
        return (image in ADDED and 1 + ADDED.index(image), image)  # later images have later indices

    def test_an_added_image_without_overlap_touches_nothing_of_the_others(self):
        before = unit_files(self.folder)
        simulate(2, "elsewhere", "--seed", 9)
        shutil.copy(work / "elsewhere/images/f000000.jpg", self.folder / "images/stranger.jpg")
        units = run(self.folder)
        self.assertEqual(status(self.folder / "job")["oriented"], 34)
        self.assertNotIn("adjustment", units)
        after = unit_files(self.folder)
        self.assertEqual({file for file in before if after[file] != before[file]}, {"features/000000.h5"})

    def test_poses_added_later_end_the_orientation_stage(self):
        poses = (self.folder / "truth.csv").read_text().splitlines(keepends=True)
        (self.folder / "poses.csv").write_text("".join(row for row in poses if not row.startswith(tuple(ADDED))))
        with (self.folder / "block.yaml").open("a") as project:
            project.write("poses: poses.csv\n")
        units = run(self.folder)
        self.assertNotIn("orientation", units)
        self.assertIn("merge", units)
        stages = {stage["name"]: stage["state"] for stage in status(self.folder / "job")["stages"]}
        self.assertEqual(set(stages.values()), {"done"}, stages)
        self.assertNotIn("orientation", stages)
        self.assertEqual(status(self.folder / "job")["result"], "current")
        self.assertEqual(run(self.folder), {})
        write_project(self.folder, OPTIONS)  # and back
        self.assertIn("orientation", run(self.folder))
        self.assertEqual(status(self.folder / "job")["result"], "current")

    def test_the_result_is_the_same_on_two_ranks(self):
        if not shutil.which("mpirun"):
            self.skipTest("needs mpirun")
        other = work / "two_ranks"
        shutil.copytree(self.folder, other)
        for folder, ranks in ((self.folder, []), (other, ["mpirun", "--bind-to", "none", "--oversubscribe", "-n", "2"])):
            add_image(folder, ADDED[0])
            run(folder, *ranks)
        self.assertEqual(status(self.folder / "job")["digest"], status(other / "job")["digest"])
        self.assertEqual({file: content for file, (content, _) in unit_files(self.folder).items()},
                         {file: content for file, (content, _) in unit_files(other).items()})

    def test_a_changed_option_touches_what_depends_on_it(self):
        options = {section: dict(values) for section, values in OPTIONS.items()}
        # From the end of the pipeline to its beginning. First set: what must be computed; second: what may be, where
        # the first one's results differ.
        for section, key, value, must, may in (
                ("merge", "scale_sigma", "true", {"merge"}, set()),
                ("adjustment", "max_residual_sigmas", 3.5, {"adjustment", "merge"}, set()),
                ("adjustment", "image_sigma_px", 0.4, {"orientation", "adjustment", "merge"}, set()),
                ("orientation", "max_rotation_error_deg", 8, {"orientation"}, {"adjustment", "merge"}),
                ("tiles", "weak_link_tracks", 9, {"tiles"}, {"tracks", "coverage", "adjustment", "merge"}),
                ("matching", "remove_eccentricity", "false", {"tracks", "coverage", "adjustment", "merge"}, {"orientation"}),
                ("coverage", "min_share", 0.9, set(), set()),
                ("matching", "min_track_length", 3, {"tracks", "orientation", "adjustment", "merge"}, {"coverage"}),
                ("matching", "ratio", 0.8,
                 {"focal_lengths", "matching", "tiles", "tracks", "coverage", "orientation", "adjustment", "merge"}, set()),
                ("candidates", "order_neighbours", 3, {"candidates"},
                 {"focal_lengths", "matching", "tiles", "tracks", "coverage", "orientation", "adjustment", "merge"})):
            with self.subTest(option=f"{section}.{key}"):
                options.setdefault(section, {})[key] = value
                write_project(self.folder, options)
                stages = set(run(self.folder))
                self.assertLessEqual(must, stages)
                # The choice of the parameters of cameras depends on all before the merge; it may well stay as it was.
                choice = set() if section in ("merge", "coverage") else {"cameras"}
                self.assertLessEqual(stages, must | may | choice)
        self.assertEqual(run(self.folder), {})


if __name__ == "__main__":
    unittest.main()
