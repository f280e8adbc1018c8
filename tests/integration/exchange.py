#!/usr/bin/env python3
"""Tests the exchange with other programs: a model is exported from a job, imported as a project, adjusted, and exported
again.

usage: exchange.py MEGABLOCK [unittest arguments]
"""
import pathlib
import shutil
import tempfile
import unittest

from program import BAD_INPUT, megablock, one_line, status

work = pathlib.Path(tempfile.mkdtemp(prefix="megablock-exchange-"))
FORMATS = ("colmap-text", "colmap-bin", "bal", "bundler")


def setUpModule():
    megablock("simulate", "--frames", 30, "--points-per-frame", 150, "--control-points", 0, "--check-points", 0,
              "-o", work / "block")
    megablock("run", work / "block/block.yaml", "-j", work / "job", "-q")


def tearDownModule():
    shutil.rmtree(work)


class Exchange(unittest.TestCase):
    def test_a_model_goes_out_and_comes_back(self):
        before = status(work / "job")
        for form in FORMATS:
            with self.subTest(form):
                model, project, job = work / form, work / f"{form}-project", work / f"{form}-job"
                megablock("export", work / "job", "--format", form, "-o", model)
                said = megablock("import", form, model, "-o", project)
                self.assertIn(f"{project}/block.yaml: 30 images", said)
                megablock("run", project / "block.yaml", "-j", job, "-q")
                after = status(job)
                self.assertEqual(after["oriented"], 30)
                self.assertEqual(after["points"], before["points"])
                # Without positions and the priors of the camera the same observations fit at least as well.
                self.assertLess(after["mean_reprojection_px"], 1.02 * before["mean_reprojection_px"])
                megablock("export", job, "--format", form, "-o", work / f"{form}-again")

    def test_an_edited_project_is_not_overwritten(self):
        megablock("export", work / "job", "--format", "bal", "-o", work / "model.txt")
        project = work / "edited-project"
        for _ in range(2):  # the same once more
            megablock("import", "bal", work / "model.txt", "-o", project)
        with open(project / "block.yaml", "a") as file:
            file.write("merge: {decrement: 1e-6}\n")
        edited = (project / "block.yaml").read_text(), (project / "given.h5").read_bytes()
        line = one_line(megablock("import", "bal", work / "model.txt", "-o", project, expect=BAD_INPUT))
        self.assertIn("block.yaml: this project file exists and differs", line)
        self.assertEqual(((project / "block.yaml").read_text(), (project / "given.h5").read_bytes()), edited)

    def test_a_broken_model_gets_one_line(self):
        megablock("export", work / "job", "--format", "bal", "-o", work / "whole.txt")
        broken, project = work / "broken.txt", work / "broken-project"
        broken.write_text((work / "whole.txt").read_text()[:5000])
        self.assertIn("broken.txt:", one_line(megablock("import", "bal", broken, "-o", project, expect=BAD_INPUT)))
        for form in FORMATS:
            line = one_line(megablock("import", form, work / "nowhere", "-o", project, expect=BAD_INPUT))
            self.assertIn("nowhere", line)
            self.assertIn("cannot be read", line)
        self.assertFalse(project.exists())

    def test_an_unknown_format_is_refused(self):
        self.assertIn("colmap-bin", megablock("import", "nvm", "x", "-o", work / "x", expect=BAD_INPUT))


if __name__ == "__main__":
    unittest.main()
