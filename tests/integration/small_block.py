"""A small rendered block and its finished job for tests of whole runs: import setUpModule and tearDownModule as well."""
import pathlib
import shutil
import tempfile
import unittest

from program import DONE, megablock

work = pathlib.Path(tempfile.mkdtemp(prefix="megablock-small-block-"))


def simulate(name, frames, width, height, *options):
    megablock("simulate", "--rendered", "--frames", frames, "--width", width, "--image-height", height, "--focal", 375,
              *options, "-o", work / name)
    with (work / name / "block.yaml").open("a") as f:
        f.write("features:\n  max_features: 1200\n  max_megapixels: 2\n")


def setUpModule():
    simulate("clean", 12, 480, 360)
    megablock("run", work / "clean/block.yaml", "-j", work / "clean_job", "-q")


def tearDownModule():
    shutil.rmtree(work)


class CopyOfTheBlock(unittest.TestCase):
    def setUp(self):
        self.folder = work / self.id().split(".")[-1]
        shutil.copytree(work / "clean", self.folder)
        self.project = self.folder / "block.yaml"
        self.images = self.folder / "images"
        self.job = self.folder / "job"

    def run_job(self, expect=DONE):
        return megablock("run", self.project, "-j", self.job, "-q", expect=expect)
