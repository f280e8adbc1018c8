"""Tests jobs at both levels of arithmetic: they must agree to 1e-6 sigma, and one job must not mix them.
usage: arithmetic.py MEGABLOCK"""
import pathlib
import tempfile

import h5py
import numpy

from program import BAD_INPUT, megablock, one_line

SIGMAS = 1e-6


def centres_and_sigmas(job):
    with h5py.File(job / "result" / "block.h5") as result:
        variance = result["frames/covariance"][:].diagonal(axis1=1, axis2=2)
        return result["frames/centre"][:], numpy.sqrt(variance[:, 3:])


def main():
    cpu = pathlib.Path("/proc/cpuinfo").read_text()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        megablock("simulate", "--scene", "street", "--rig-cameras", 4, "--frames", 60, "-o", folder)
        project = folder / "block.yaml"
        with project.open("a") as out:
            out.write("tiles:\n  tile_max_frames: 20\nmerge:\n  decrement: 1.0e-7\n")
        jobs = {level: folder / level for level in ("avx2", "avx512")}
        megablock("run", project, "-j", jobs["avx2"])
        refused = one_line(megablock("run", project, "-j", folder / "job", "--arithmetic", "mmx", expect=BAD_INPUT))
        assert "--arithmetic" in refused and "avx512" in refused, refused
        if "avx512dq" not in cpu:
            text = one_line(megablock("run", project, "-j", jobs["avx512"], "--arithmetic", "avx512", expect=BAD_INPUT))
            assert "no AVX-512" in text, text
            print("this processor has no AVX-512: its results are not compared")
            return
        megablock("run", project, "-j", jobs["avx512"], "--arithmetic", "avx512")
        text = one_line(megablock("run", project, "-j", jobs["avx512"], expect=BAD_INPUT))
        assert "job of arithmetic level 'avx512'" in text, text

        usual, sigma = centres_and_sigmas(jobs["avx2"])
        wide, _ = centres_and_sigmas(jobs["avx512"])
        difference = numpy.abs(wide - usual) / sigma
        print(f"largest difference {difference.max():.2e} sigma")
        assert difference.max() <= SIGMAS, difference.max()
        assert difference.max() > 0, "both levels gave the same bits: is the option without effect?"


main()
