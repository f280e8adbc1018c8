#!/usr/bin/env python3
"""Runs the program with bad input: it must print one clear line, lose nothing, and end with the documented exit code.
This test changes the project and the files that it names; bad_input_job.py changes the job.

usage: bad_input.py MEGABLOCK [unittest arguments]
Works on a small rendered block; needs nothing but the program and the standard library.
"""
import json
import os
import pty
import random
import re
import shutil
import subprocess
import unittest

import pictures
from program import BAD_INPUT, FAILED_UNITS, MEGABLOCK, megablock, one_line, status
from small_block import CopyOfTheBlock, setUpModule, simulate, tearDownModule, work


def on_terminal(columns, *arguments):
    """What the program writes to a terminal of so many columns."""
    terminal, end = pty.openpty()
    program = subprocess.Popen([MEGABLOCK, *map(str, arguments)], stdout=end, stderr=subprocess.DEVNULL,
                               env=dict(os.environ, COLUMNS=str(columns)))
    os.close(end)
    text = b""
    try:
        while part := os.read(terminal, 1 << 16):
            text += part
    except OSError:  # the other end is closed
        pass
    os.close(terminal)
    assert program.wait() == 0
    return text.decode().replace("\r\n", "\n")


class BadInput(CopyOfTheBlock):
    def pictures(self):
        return sorted(self.images.glob("*.jpg"))

    def assert_reported(self, pattern):
        report = (self.job / "result/report.html").read_text()
        self.assertTrue(re.search(pattern, report), f"the report does not say '{pattern}'")

    def errors(self):
        """Of the finished job, against the truth of the frames of the block as it was rendered."""
        return json.loads(megablock("evaluate", self.job, self.folder / "truth.csv", "--json"))

    # --- the project -------------------------------------------------------------------------------------------------
    def test_missing_folder(self):
        line = one_line(megablock("init", self.folder / "nowhere", "-o", self.folder / "x.yaml", expect=BAD_INPUT))
        self.assertIn("nowhere", line)

    def test_misspelled_command_line(self):
        self.assertIn("unknown command 'runn'; did you mean 'run'?", megablock("runn", expect=BAD_INPUT))
        self.assertIn("Usage:", megablock(expect=BAD_INPUT))
        self.assertIn("Usage:", megablock("help"))
        said = megablock("run", self.project, "-j", self.job, "--threads", "two", expect=BAD_INPUT)
        self.assertIn("'two' is not a number of 0 to 1024; see 'megablock run --help'", said)
        for value in ("-3", "1025", "99999999", "1e9"):
            for command in (("run", self.project, "-j", self.job), ("simulate", "-o", self.folder / "simulated")):
                said = megablock(*command, "--threads", value, expect=BAD_INPUT)
                self.assertIn(f"--threads: '{value}' is not a number of 0 to 1024; see 'megablock {command[0]} --help'", said)
        for option in ("--memory", "--scratch"):
            for value in ("1e300", "1.1e12", "-1", "nan"):
                said = megablock("run", self.project, "-j", self.job, option, value, expect=BAD_INPUT)
                self.assertIn(f"{option}: '{value}' is not a number of 0 to 1e+12 MiB; see 'megablock run --help'", said)
        said = megablock("run", self.project, "-j", self.job, "--thread", "2", expect=BAD_INPUT)
        self.assertIn("argument '--thread' was not expected; did you mean '--threads'? see 'megablock run --help'", said)
        said = megablock("run", self.project, "--jobs=" + str(self.job), expect=BAD_INPUT)  # not: --job is required
        self.assertIn("argument '--jobs' was not expected; did you mean '--job'? see 'megablock run --help'", said)
        said = megablock("run", self.project, "-j", self.job, "--colour", expect=BAD_INPUT)
        self.assertIn("argument '--colour' was not expected; see 'megablock run --help'", said)

    def test_empty_names(self):
        for command in (("run", self.project, "-j"), ("register", self.project, "-j"), ("simulate", "-o"),
                        ("init", self.images, "-o"), ("export", work / "clean_job", "--format", "csv", "-o"),
                        ("measurements", work / "clean_job", "--image", "f000001.jpg", "-o"),
                        ("calibrate", self.project, "-o"), ("verticals", self.project, "-o")):
            option = "--job" if command[-1] == "-j" else "--output"
            self.assertIn(f"{option}: the name is empty; name a file or folder; see 'megablock {command[0]} --help'",
                          one_line(megablock(*command, "", expect=BAD_INPUT)))

    def test_rig_to_calibrate_is_missed_before_any_picture_is_read(self):
        calibration = self.folder / "calibration"
        line = one_line(megablock("calibrate", self.project, "-q", "-o", calibration, expect=BAD_INPUT))
        self.assertIn("no rig of two or more cameras", line)
        self.assertFalse(list(calibration.glob("features/*")))

    def test_edited_project_of_a_simulation(self):
        simulation = ("simulate", "--frames", 6, "-o", self.folder / "simulated")
        megablock(*simulation)
        megablock(*simulation)
        with (self.folder / "simulated/block.yaml").open("a") as f:
            f.write("tiles: {tile_max_frames: 6}\n")
        self.assertRegex(one_line(megablock(*simulation, expect=BAD_INPUT)),
                         "simulated/block.yaml: this project file exists and differs .*; "
                         "name another folder with -o, or give --overwrite")
        megablock(*simulation, "--overwrite")
        self.assertNotIn("tiles", (self.folder / "simulated/block.yaml").read_text())

    def test_refused_values_are_named(self):
        for option, value, words in (("--frames", 1, "frames must be at least 2"),
                                     ("--outliers", 1.5, "the share of outliers in this scene must lie in"),
                                     ("--gps-sigma", 1e300, "gps_sigma_m must be at most"),
                                     ("--image-height", 8, "image_height must be at least 64"),
                                     ("--drift-per-frame", -1, "drift_per_frame_m must lie in")):
            said = one_line(megablock("simulate", "--scene", "stereopolis", "--drift", 3, option, value, "-o", self.folder / "x",
                                      expect=BAD_INPUT))
            self.assertIn(f"megablock: {option} {value}: simulation: {words}", said)
        said = one_line(megablock("register", self.project, "-j", self.job, "--min-frames", 9, expect=BAD_INPUT))
        self.assertIn("--min-frames 9: ", said)
        self.assertFalse(self.job.exists())
        with self.project.open("a") as f:
            f.write("tiles: {min_tiles: 0}\n")
        self.assertRegex(one_line(self.run_job(BAD_INPUT)), "block.yaml:[0-9]+: tiles: min_tiles must be at least 1, not 0")

    def test_simulate_refuses_options_without_effect(self):
        for options, said in (
                (["--scene", "street", "--height", 50], "--height has no effect on the scene 'street', only on: aerial; "
                 "leave it out, or choose another --scene"),
                (["--path", "loop"], "--path has no effect on the scene 'aerial', only on: target-field"),
                (["--no-bridge"], "--no-bridge has no effect on the scene 'aerial', only on: stereopolis"),
                (["--scene", "stereopolis", "--camera-model", "opencv-fisheye"], "only on: aerial, street, panorama"),
                (["--scene", "street", "--repeated-facades", 1], "--repeated-facades has no effect without --rendered"),
                (["--start-chain", 3], "(--start-chain) has no effect without start_offset_m (--start-offset)"),
                (["--rendered", "--outliers", 0.1], "--outliers has no effect with --rendered; leave one of them out"),
                (["--published-camera", 3, "--width", 640], "--width has no effect with --published-camera")):
            self.assertIn(said, one_line(megablock("simulate", *options, "-o", self.folder / "x", expect=BAD_INPUT)))
            self.assertFalse((self.folder / "x").exists())

    def test_help_is_as_wide_as_the_terminal(self):
        def help_of(columns, *command):
            text = megablock(*command, "--help", env=dict(os.environ, COLUMNS=str(columns)))
            return re.split("^(?:Example|Exit codes): ", text, flags=re.MULTILINE)[0]

        commands = re.findall("^  ([a-z-]+)  ", help_of(1000).partition("Subcommands:")[2], flags=re.MULTILINE)
        self.assertIn("simulate", commands)
        for command in ([], *([name] for name in commands)):
            narrow, wide = help_of(60, *command), help_of(1000, *command)
            self.assertLessEqual(max(map(len, narrow.splitlines())), 60, narrow)
            self.assertEqual("".join(narrow.split()), "".join(wide.split()))
        self.assertIn("of the\n" + 30 * " " + "merge, MiB", help_of(80, "run"))  # below the description

    def test_status_and_diagnose_are_as_wide_as_the_terminal(self):
        for command in ("status", "diagnose"):
            whole = megablock(command, work / "clean_job")
            self.assertEqual(megablock(command, work / "clean_job", env=dict(os.environ, COLUMNS="60")), whole)  # a pipe
            narrow = on_terminal(60, command, work / "clean_job")
            self.assertGreater(max(map(len, whole.splitlines())), 60)
            # What has no blank, as a path, cannot be broken.
            self.assertFalse([line for line in narrow.splitlines() if len(line) > 60 and " " in line.strip()[:60]], narrow)
            self.assertEqual("".join(narrow.split()), "".join(whole.split()))

    def test_held_positions_that_contradict_the_images(self):
        megablock("simulate", "--frames", 40, "--gps-sigma", 0.5, "-o", self.folder / "aerial")
        project = self.folder / "aerial/block.yaml"
        megablock("run", project, "-j", self.job, "-q")
        self.assertNotIn("look: Tie points", megablock("status", self.job))
        with project.open("a") as f:
            f.write("gps: {sigma_horizontal_m: 0, sigma_vertical_m: 0}\n")
        megablock("run", project, "-j", self.job, "-q")
        for command in ("status", "diagnose"):
            said = megablock(command, self.job)
            self.assertRegex(said, "\n  look: Tie points fit to [0-9.]+ px only, .*[(]positions are held[,)].*use_position_priors")
        self.assertEqual(json.loads(megablock("diagnose", self.job, "--json"))["remarks"], status(self.job)["remarks"])
        self.assert_reported("<li class=look>Tie points fit to")

    def test_job_among_photographs(self):
        before = sorted(self.images.iterdir())
        line = one_line(megablock("run", self.project, "-j", self.images, "-q", expect=BAD_INPUT))
        self.assertIn("holds other files and no job", line)
        self.assertEqual(sorted(self.images.iterdir()), before)

    def test_job_of_another_block(self):
        shutil.copytree(work / "clean_job", self.job)
        before = {file: file.stat().st_mtime_ns for file in self.job.rglob("*.*")}
        megablock("simulate", "--frames", 6, "-o", self.folder / "other")
        line = one_line(megablock("run", self.folder / "other/block.yaml", "-j", self.job, "-q", expect=BAD_INPUT))
        self.assertRegex(line, f"{self.job}: is the job of another block: .*other/block.yaml has none of its 12 images; "
                               "name another folder with -j, or delete this one")
        self.assertEqual({file: file.stat().st_mtime_ns for file in self.job.rglob("*.*")}, before)
        for picture in self.pictures()[8:]:
            picture.unlink()
        self.run_job()  # some are left: the block begins anew
        self.assertEqual(status(self.job)["images"], 8)

    def test_control_point_in_another_country(self):
        image = self.pictures()[0].name
        gcp = self.folder / "gcp_list.txt"
        gcp.write_text(f"EPSG:4326\n2.35 48.85 100 200 150 {image} right\n48.85 2.35 100 200 150 {image} swapped\n")
        line = one_line(megablock("init", self.images, "-o", self.folder / "new.yaml", "--control", gcp, expect=BAD_INPUT))
        self.assertRegex(line, r"gcp_list.txt: 1 of 2 control points \('swapped'\) lie [0-9]+ km from the images; with x "
                               "and y .* exchanged they would lie near the images; exchange these columns")

    def test_missing_units_and_older_results_are_said(self):
        shutil.copytree(work / "clean_job", self.job)
        megablock("check", self.job)
        shutil.rmtree(self.job / "features")
        megablock("check", self.job, expect=FAILED_UNITS)
        said = subprocess.run([MEGABLOCK, "check", self.job], capture_output=True, text=True).stdout
        self.assertRegex(said, "stage 'features': 0 of [0-9]+ units are there; run the job again to complete it")
        self.assertIn("warning: ", megablock("export", self.job, "--format", "csv", "-o", self.folder / "csv"))
        self.assertIn("this is an older result", megablock("report", self.job))
        self.assertIn("this is an older result",
                      megablock("evaluate", self.job, self.folder / "truth.csv"))

    def test_unreadable_folder(self):
        nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"] if os.geteuid() == 0 else []
        if nobody and not shutil.which("setpriv"):
            self.skipTest("root reads everything; needs setpriv")
        self.images.chmod(0)
        work.chmod(0o755)
        self.folder.chmod(0o777)
        line = one_line(megablock("init", self.images, "-o", self.folder / "x.yaml", expect=BAD_INPUT, before=nobody))
        self.assertIn("images", line)
        self.assertIn("permission", line.lower())

    def test_file_in_place_of_the_folder(self):
        line = one_line(megablock("init", self.project, "-o", self.folder / "x.yaml", expect=BAD_INPUT))
        self.assertIn("block.yaml", line)

    def test_missing_project(self):
        self.assertIn("megablock init", one_line(megablock("run", "no.yaml", "-j", self.job, expect=BAD_INPUT)))

    def test_unknown_key(self):
        with self.project.open("a") as f:
            f.write("matchng:\n  ratio: 0.7\n")
        line = one_line(self.run_job(BAD_INPUT))
        self.assertIn(f"{self.project}:{len(self.project.read_text().splitlines()) - 1}", line)
        self.assertIn("matching", line)

    def test_wrong_unit(self):
        with self.project.open("a") as f:
            f.write("adjustment:\n  image_sigma_px: 0.5 mm\n")
        self.assertIn("block.yaml:", one_line(self.run_job(BAD_INPUT)))

    def test_absurd_numbers(self):
        for line, said in (("gps: {sigma_horizontal_m: 1e300}", "sigma_horizontal_m must lie in"),
                           ("merge: {decrement: 1e300}", "merge: decrement must lie in"),
                           ("adjustment: {image_loss_scale: 1e-300}", "adjustment: image_loss_scale must lie in"),
                           ("cameras: {default: {focal_px: 1e300}}", "cameras.default.focal_px must lie in")):
            self.project.write_text(f"images: images\n{line}\n")
            self.assertRegex(one_line(self.run_job(BAD_INPUT)), rf"block.yaml:2: {said} \[.*\], .*not 1e[+-]?300")
        self.assertFalse(self.job.exists())

    def test_control_point_names_missing_image(self):
        control = next(iter(self.folder.glob("gcp_list.txt")), None) or self.folder / "gcp_list.txt"
        control.write_text("WGS84\n2.35 48.85 50 320 240 not_there.jpg p1\n")
        text = self.project.read_text()
        text = "\n".join(line for line in text.splitlines() if not line.startswith("control:"))
        self.project.write_text(text + "\ncontrol: gcp_list.txt\n")
        line = one_line(self.run_job(BAD_INPUT))
        self.assertIn("not_there.jpg", line)
        self.assertIn("gcp_list.txt:2", line)

    # --- images ------------------------------------------------------------------------------------------------------
    def test_bad_files_among_good(self):
        first = sorted(self.images.glob("*.jpg"))
        data = first[0].read_bytes()
        (self.images / "zero.jpg").write_bytes(b"")
        (self.images / "text.jpg").write_text("this is not an image\n")
        (self.images / "truncated.jpg").write_bytes(data[: len(data) // 2])
        corrupt = bytearray(data)
        corrupt[len(data) // 3: len(data) // 3 + 400] = b"\xff" * 400
        (self.images / "corrupt.jpg").write_bytes(corrupt)
        self.run_job(FAILED_UNITS)
        figures = status(self.job)
        self.assertGreaterEqual(figures["oriented"], 12)
        for name in ("zero.jpg", "text.jpg", "truncated.jpg"):
            self.assert_reported(name)

    def test_duplicate_file(self):
        first = sorted(self.images.glob("*.jpg"))[0]
        shutil.copy(first, self.images / "zz_copy.jpg")
        self.run_job()
        self.assertEqual(status(self.job)["images"], 12)
        self.assert_reported("zz_copy.jpg")

    def test_no_images(self):
        for image in self.images.iterdir():
            image.unlink()
        self.assertIn("image", one_line(self.run_job(BAD_INPUT)))

    def test_images_without_exif(self):
        for picture in self.pictures():
            pictures.strip_exif(picture)
        self.run_job()
        self.assertEqual(status(self.job)["oriented"], 12)
        errors = self.errors()
        self.assertTrue(errors["aligned"])  # a free block
        self.assertLess(errors["position_rms_m"], 0.2)

    def test_wrong_gps_positions(self):
        zero, swapped, far, bare = self.pictures()[:4]
        latitude, longitude = pictures.Exif(far).position()
        pictures.Exif(zero).set_position(0, 0)
        pictures.Exif(swapped).set_position(longitude, latitude)
        pictures.Exif(far).set_position(latitude + 0.09, longitude)  # 10 km north
        pictures.strip_exif(bare)
        self.run_job()
        self.assertEqual(status(self.job)["oriented"], 12)
        warnings = json.loads((self.job / "job.json").read_text())["warnings"]
        for picture, words in ((zero, "0, 0"), (swapped, "swapped"), (far, "km from the others")):
            self.assertEqual(len([w for w in warnings if picture.name in w and words in w]), 1, warnings)
        self.assertEqual(len(warnings), 3)
        self.assertLess(self.errors()["position_max_m"], 0.5)

    def test_positions_all_wrong_alike(self):
        for picture in self.pictures():
            pictures.Exif(picture).set_position(0, 0)
        self.run_job()
        self.assertEqual(status(self.job)["oriented"], 12)
        self.assert_reported("receiver without a fix")

    def test_two_cameras_mixed(self):
        simulate("smaller", 12, 400, 300)  # another size; on the ground and in its texture the same
        for picture in self.pictures()[::2]:
            shutil.copy(work / "smaller/images" / picture.name, self.images / f"small_{picture.name}")
            picture.unlink()
        self.run_job()
        figures = status(self.job)
        self.assertEqual((figures["images"], figures["oriented"]), (12, 12))
        self.assert_reported("400x300")
        self.assertLess(self.errors()["position_max_m"], 0.5)

    def test_disjoint_sets(self):
        simulate("elsewhere", 6, 480, 360, "--seed", 9)
        for picture in (work / "elsewhere/images").iterdir():
            shutil.copy(picture, self.images / f"other_{picture.name}")
        self.run_job()
        self.assertEqual(status(self.job)["oriented"], 18)
        self.assert_reported("consists of 2 parts that no tie point connects")
        self.assertLess(self.errors()["position_max_m"], 0.5)

    def test_images_matching_nothing(self):
        numbers = random.Random(1)
        noise = [numbers.randbytes(12000) for _ in range(7)]
        pictures.write_png(self.images / "noise.png", 480, 360, lambda y: numbers.randbytes(480))
        pictures.write_png(self.images / "blank.png", 480, 360, lambda y: bytes(480))
        pictures.write_png(self.images / "panorama.png", 12000, 8400, lambda y: noise[y // 40 % 7])  # 100 Mpixel
        self.run_job()
        figures = status(self.job)
        self.assertEqual((figures["images"], figures["oriented"]), (15, 12))
        for name in ("noise.png", "blank.png", "panorama.png"):
            self.assert_reported(name + ".{0,80}no other image shares enough verified matches with it")
        self.assertLess(self.errors()["position_max_m"], 0.5)

    # --- rigs --------------------------------------------------------------------------------------------------------
    def rig_block(self):
        """A street-mapping vehicle with two cameras, three frames."""
        if not (work / "vehicle").exists():
            simulate("vehicle", 3, 320, 180, "--scene", "stereopolis", "--rig-cameras", 2, "--drives", 1, "--days", 1)
        folder = self.folder / "vehicle"
        shutil.copytree(work / "vehicle", folder)
        return folder

    def refused(self, folder):
        before = sorted(folder.rglob("*"))
        line = one_line(megablock("run", folder / "block.yaml", "-j", self.job, "-q", expect=BAD_INPUT))
        self.assertEqual(sorted(folder.rglob("*")), before)
        return line

    def test_mount_of_an_unknown_camera(self):
        folder = self.rig_block()
        file = folder / "rig_assignments.json"
        file.write_text(file.read_text().replace('"c42"', '"c99"', 1))
        line = self.refused(folder)
        self.assertIn("rig_assignments.json: image 'f000000_c42.jpg' is assigned to rig camera 'c99', which the file of "
                      "rig cameras does not have", line)

    def test_missing_camera_images(self):
        folder = self.rig_block()
        (folder / "images/f000001_c22.jpg").unlink()
        megablock("match", folder / "block.yaml", "-j", self.job, "-q")
        warnings = json.loads((self.job / "job.json").read_text())["warnings"]
        self.assertEqual(len(warnings), 1, warnings)
        self.assertIn("rig_assignments.json: 1 of 6 images are not in the folder of images, 'f000001_c22.jpg' for "
                      "example; their frames are built without them", warnings[0])

    def test_mask_of_the_wrong_size(self):
        folder = self.rig_block()
        camera = re.search('"(Megablock Simulated c22 [^"]*)"', (folder / "block.yaml").read_text()).group(1)
        (folder / "masks").mkdir()
        pictures.write_png(folder / f"masks/{camera}.png", 64, 48, lambda y: bytes(64))
        with (folder / "block.yaml").open("a") as f:
            f.write("masks: masks\n")
        line = self.refused(folder)
        self.assertRegex(line, f"block.yaml: mask '.*{camera}.png' has 64 x 48 pixels, camera '{camera}' has 320 x 180")

    def test_trajectory_with_numbers_that_are_none(self):
        folder = self.rig_block()
        rows = (folder / "poses.csv").read_text().splitlines()
        for wrong in ("nan", "inf", "none"):
            values = rows[-1].split(",")
            values[5] = wrong
            (folder / "poses.csv").write_text("\n".join([*rows[:-1], ",".join(values)]) + "\n")
            line = self.refused(folder)
            self.assertIn(f"poses.csv:{len(rows)}: x: '{wrong}' is not a number; delete the line", line)
        (folder / "poses.csv").write_text("\n".join([*rows, rows[-1]]) + "\n")
        self.assertRegex(self.refused(folder), f"poses.csv:{len(rows) + 1}: frame '.*' appears twice")


if __name__ == "__main__":
    unittest.main()
