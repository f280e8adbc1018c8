#!/usr/bin/env python3
"""Runs the program on jobs that are damaged, of another version or block, in use, or on a disk that is full or read-
only: it must print one clear line, lose nothing, and end with the documented exit code.

usage: bad_input_job.py MEGABLOCK [unittest arguments]
Works on a small rendered block; needs nothing but the program and the standard library. Cases that need a file system
of their own (full disk, read-only job) mount a tmpfs and are skipped, saying so, where that is not allowed.
"""
import json
import os
import shutil
import signal
import subprocess
import time
import unittest

from program import BAD_INPUT, DONE, FAILED_UNITS, MEGABLOCK, events, megablock, one_line, status
from small_block import CopyOfTheBlock, setUpModule, simulate, tearDownModule, work


class BadInputJob(CopyOfTheBlock):
    def test_job_of_another_version(self):
        shutil.copytree(work / "clean_job", self.job)
        file = self.job / "job.json"
        content = json.loads(file.read_text())
        content["version"] = 999
        file.write_text(json.dumps(content))
        self.assertIn("version", one_line(self.run_job(BAD_INPUT)))
        del content["version"]
        file.write_text(json.dumps(content))
        self.assertIn("job of version 0", one_line(self.run_job(BAD_INPUT)))
        content.update(version=1, generations=12)
        file.write_text(json.dumps(content))
        self.assertIn(f"{file}: the key 'generations' has another form", one_line(self.run_job(BAD_INPUT)))
        self.assertEqual(json.loads(file.read_text()), content)
        self.assertTrue((self.job / "result/block.h5").exists())

    def test_damaged_units_are_computed_again(self):
        megablock("run", self.project, "-j", self.job, "-q")
        digest = status(self.job)["digest"]
        for unit, damage in (("features/000000.h5", "flip"), ("tracks/000000.h5", "cut"), ("adjust/000000.h5", "flip"),
                             ("matches/000000.h5", "gone"), ("block.h5", "flip"), ("measurements.h5", "cut"),
                             ("result/block.h5", "flip")):
            file = self.job / unit
            data = bytearray(file.read_bytes())
            if damage == "flip":
                data[len(data) // 2] ^= 4
                file.write_bytes(data)
            elif damage == "cut":
                file.write_bytes(data[:-100])
            else:
                file.unlink()
            before = len(events(self.job))
            said = self.run_job()
            if damage == "gone":
                self.assertNotIn("warning: ", said)
            else:
                self.assertRegex(one_line(said), f"warning: {file}: (is damaged|has no valid seal).*; it is computed again")
            if unit not in ("block.h5", "measurements.h5"):  # these are no stage's
                self.assertIn(unit if unit[:6] != "tracks" else "tracks/index.txt",
                              [e["unit"] for e in events(self.job)[before:]])
            self.assertEqual(status(self.job)["digest"], digest)

    def test_check_names_the_damaged_file(self):
        shutil.copytree(work / "clean_job", self.job)
        self.assertIn("whole", megablock("check", self.job))
        file = self.job / "matches/000000.h5"
        data = bytearray(file.read_bytes())
        data[len(data) // 2] ^= 1
        file.write_bytes(data)
        done = subprocess.run([MEGABLOCK, "check", self.job], capture_output=True, text=True)
        self.assertEqual(done.returncode, FAILED_UNITS)
        self.assertRegex(done.stdout, "matches/000000.h5: is damaged .*; run the job again, which computes it anew")

    def test_a_folder_in_place_of_the_coverage(self):
        shutil.copytree(work / "clean_job", self.job)
        table = self.job / "result/coverage.csv"
        whole = table.read_text()
        table.write_text("\n".join(whole.splitlines()[:-1]) + "\n")
        (self.job / "coverage/mine.csv").write_text("mine")
        said = subprocess.run([MEGABLOCK, "check", self.job], capture_output=True, text=True)
        self.assertEqual(said.returncode, FAILED_UNITS)
        self.assertRegex(said.stdout, "result/coverage.csv: has rows of [0-9]+ of [0-9]+ images; delete it and run")
        self.assertRegex(said.stdout, "coverage/mine.csv: is no file of a job; move it away")
        (self.job / "coverage/mine.csv").unlink()
        table.unlink()
        table.mkdir()
        self.assertRegex(one_line(self.run_job(expect=BAD_INPUT)), "result/coverage.csv: cannot be written: a directory is where")
        table.rmdir()
        self.run_job()
        self.assertEqual(table.read_text(), whole)
        self.assertIn("whole", megablock("check", self.job))

    def test_figures_of_another_result_are_not_believed(self):
        shutil.copytree(work / "clean_job", self.job)
        figures, written = self.job / "result/figures.json", status(self.job)
        content = json.loads(figures.read_text())
        self.assertEqual({key: written[key] for key in content}, content)
        for text in (None, figures.read_text()[:-40], "[]", json.dumps(content | {"points": 7, "digest": "0" * 16})):
            figures.unlink(missing_ok=True)
            if text is not None:
                figures.write_text(text)
            self.assertEqual(status(self.job), written)
        figures.write_text(json.dumps(content | {"points": 7}))  # they are read where they are of the result
        self.assertEqual(status(self.job)["points"], 7)

    def test_outputs_take_no_files_place(self):
        shutil.copytree(work / "clean_job", self.job)
        given = work / "clean"  # whose job it is
        inputs = [given / "block.yaml", given / "images/f000001.jpg"]
        own = [self.job / name for name in ("job.json", "rows.csv", "features/000000.h5", "features/rows.csv",
                                            "result/block.h5", "result/figures.json", "result/report.html", "")]
        before = {file: file.read_bytes() for file in [*inputs, *self.job.rglob("*")] if file.is_file()}
        link = self.folder / "link.csv"
        link.symlink_to(given / "block.yaml")
        commands = {"export": ("export", self.job, "--format", "ply"),
                    "measurements": ("measurements", self.job, "--image", "f000001.jpg"),
                    "report": ("report", self.job)}
        for name, command in commands.items():
            for output in [*inputs, link, *own]:
                if (name, output.name) == ("report", "report.html"):
                    continue
                line = one_line(megablock(*command, "-o", output, expect=BAD_INPUT))
                self.assertIn(f"{output}: {'is an input' if output in (*inputs, link) else 'belongs to the job dir'}", line)
        for command in (("masks", given / "block.yaml"), ("verticals", given / "block.yaml"), ("simulate", "--frames", 6)):
            self.assertIn("belongs to the job", one_line(megablock(*command, "-o", self.job / "merge", expect=BAD_INPUT)))
        for output, words in ((self.job, "belongs to the job"), (given / "block.yaml", "is an input")):
            said = one_line(megablock("calibrate", "--compare-models", self.job, "-o", output, expect=BAD_INPUT))
            self.assertIn(f"{output}: {words}", said)
        for project_reader in ("verticals", "resect"):
            for output in inputs:
                said = one_line(megablock(project_reader, given / "block.yaml", "-o", output, expect=BAD_INPUT))
                self.assertIn(f"{output}: is an input", said)
        self.assertEqual({file: file.read_bytes() for file in before}, before)
        for name, command in commands.items():  # a name of its own, and that once more
            for _ in range(2):
                megablock(*command, "-o", self.job / "result" / f"own-{name}")
                megablock(*command, "-o", self.folder / f"own-{name}")
        megablock("report", self.job, "-o", self.job / "result/report.html")
        self.assertIn("whole", megablock("check", self.job))

    def test_questions_for_measurements(self):
        shutil.copytree(work / "clean_job", self.job)

        def asked(*question, expect=BAD_INPUT):
            return one_line(megablock("measurements", self.job, *question, expect=expect))

        self.assertIn("no image 'f7.jpg'", asked("--image", "f000001.jpg", "--image", "f7.jpg"))
        self.assertIn("no frame 'f7'", asked("--frame", "f7"))
        for question in ((), ("--image", "f000001.jpg", "--near", "1,2", "--radius", 3), ("--near", "1,2"),
                         ("--image", "f000001.jpg", "--radius", 3), ("--near", "1", "--radius", 3)):
            asked(*question)
        megablock("measurements", self.job, "--near", "1,east", "--radius", 3, expect=BAD_INPUT)
        self.assertIn("not a job directory", one_line(megablock("measurements", self.images, "--image", "f000001.jpg",
                                                                expect=BAD_INPUT)))
        tile = self.job / "tracks/000000.h5"
        data = bytearray(tile.read_bytes())
        data[len(data) // 2] ^= 1
        tile.write_bytes(data)
        self.assertIn("tracks/000000.h5: is damaged", asked("--image", "f000001.jpg", expect=FAILED_UNITS))
        (self.job / "tracks/index.txt").unlink()
        self.assertIn("no tracks yet", asked("--image", "f000001.jpg"))
        (self.job / "result/block.h5").unlink()
        self.assertIn("no result yet", asked("--near", "1,2", "--radius", 3))
        self.assertIn("finite", asked("--near", "1,nan", "--radius", 3))

    def test_measurements_about_an_empty_place_have_all_columns(self):
        header = "image,track,x_px,y_px,feature,tile,kept,residual_x_px,residual_y_px"
        for place in ("0,0", "90000,0"):
            asked = subprocess.run([MEGABLOCK, "measurements", work / "clean_job", "--near", place, "--radius", "30"],
                                   capture_output=True, text=True, check=True)
            rows = asked.stdout.splitlines()
            self.assertEqual(rows[0], header)
            self.assertEqual(len(rows) > 1, place == "0,0")
            if place != "0,0":
                self.assertRegex(asked.stderr, "clean_job: no point lies within 30 m of the place; points lie from "
                                               "-[0-9.]+ to [0-9.]+ m east, -[0-9.]+ to [0-9.]+ m north, .* m up")
            else:
                self.assertEqual(asked.stderr, "")

    def test_measurements_without_their_index(self):
        shutil.copytree(work / "clean_job", self.job)
        (self.job / "measurements.h5").unlink()
        said = one_line(megablock("measurements", self.job, "--image", "f000001.jpg", expect=FAILED_UNITS))
        self.assertIn("measurements.h5: is missing; run the job again", said)
        checked = subprocess.run([MEGABLOCK, "check", self.job], capture_output=True, text=True)
        self.assertEqual(checked.returncode, FAILED_UNITS)
        self.assertIn("measurements.h5: is missing", checked.stdout)

    def test_tie_points_of_another_block(self):
        for name, frames in (("small", 6), ("large", 12)):
            megablock("simulate", "--frames", frames, "-o", self.folder / name)
        project = self.folder / "mixed.yaml"
        project.write_text("block: small/given.h5\ntie_points: large/tie_points.h5\n")
        said = one_line(megablock("match", project, "-j", self.job, "-q", expect=BAD_INPUT))
        self.assertRegex(said, r"large/tie_points.h5: names image \d+, but the block has 6 images")

    def test_finished_job_computes_nothing(self):
        megablock("run", self.project, "-j", self.job, "-q")
        before = len(events(self.job))
        self.run_job()
        self.assertEqual(events(self.job)[before:], [])

    def test_merge_without_an_optimum(self):
        megablock("simulate", "--frames", 40, "-o", self.folder / "simulated")
        project = self.folder / "simulated/block.yaml"
        given = project.read_text()
        project.write_text(given + "merge: {max_iterations: 1, screening_rounds: 0, decrement: 1e-7}\n")
        for _ in range(2):  # a second run has nothing to do, and the same to say
            megablock("run", project, "-j", self.job, "-q", expect=FAILED_UNITS)
        self.assertTrue((self.job / "result/block.h5").exists())
        failures = status(self.job)["failures"]
        self.assertEqual([(f["stage"], f["unit"]) for f in failures], [("merge", "result/block.h5")])
        self.assertRegex(failures[0]["reason"], r"did not converge: after 1 iteration .*'merge.max_iterations'")
        project.write_text(given)
        megablock("run", project, "-j", self.job, "-q")
        self.assertEqual(status(self.job)["failed"], 0)

    def test_nothing_oriented_is_no_success(self):
        megablock("simulate", "--frames", 40, "--gps-sigma", 0.05, "--attitude-sigma", 0.1, "--control-points", 4,
                  "--check-points", 4, "-o", self.folder / "simulated")
        project = self.folder / "simulated/block.yaml"
        project.write_text(project.read_text() + "adjustment: {max_residual_sigmas: 1e-3}\n")
        for _ in range(2):
            megablock("run", project, "-j", self.job, "-q", expect=FAILED_UNITS)
        said = status(self.job)
        self.assertEqual(said["oriented"], 0)
        self.assertEqual(said["check_points"]["compared"], 0)
        reasons = [f["reason"] for f in said["failures"] if f["unit"] == "result/block.h5"]
        self.assertEqual(len(reasons), 1)
        self.assertIn("no image is oriented", reasons[0])

    def test_two_runs_on_one_job(self):
        first = subprocess.Popen([MEGABLOCK, "run", self.project, "-j", self.job, "-q"], stdout=subprocess.DEVNULL,
                                 stderr=subprocess.DEVNULL)
        lock = self.job / "lock"
        while not (lock.exists() and lock.read_text() and (self.job / "job.json").exists()):  # it says who holds it
            self.assertIsNone(first.poll())
            time.sleep(0.01)
        first.send_signal(signal.SIGSTOP)  # it holds the lock for as long as we like
        try:
            line = one_line(self.run_job(BAD_INPUT))
            self.assertIn(f"stop it (kill -USR1 {first.pid})", line)
            shown = subprocess.run([MEGABLOCK, "status", self.job], capture_output=True, text=True, check=True).stdout
            self.assertIn(f"is at work on it; 'kill -USR1 {first.pid}' stops it", shown)
        finally:
            first.send_signal(signal.SIGCONT)
        self.assertEqual(first.wait(), DONE)

    def with_file_system(self, size):
        self.job.mkdir()
        mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(self.job)]
        if os.geteuid() != 0 or subprocess.run(mount, capture_output=True).returncode != 0:
            self.skipTest("needs the right to mount a tmpfs")
        self.addCleanup(subprocess.run, ["umount", str(self.job)])

    def test_full_disk(self):
        self.with_file_system("1m")
        line = one_line(self.run_job(BAD_INPUT))
        self.assertRegex(line, "(?i)space|full")
        subprocess.check_call(["mount", "-o", "remount,size=500m", str(self.job)])
        self.run_job()
        self.assertEqual(status(self.job)["digest"], status(work / "clean_job")["digest"])

    def test_read_only_job(self):
        self.with_file_system("500m")
        subprocess.check_call(["mount", "-o", "remount,ro", str(self.job)])
        self.assertRegex(one_line(self.run_job(BAD_INPUT)), "(?i)read-only")


if __name__ == "__main__":
    unittest.main()
