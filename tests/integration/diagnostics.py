#!/usr/bin/python3
"""What a block lacks, before and after its adjustment, in the report and as JSON. usage: diagnostics.py MEGABLOCK"""
import json
import pathlib
import subprocess
import tempfile

from program import BAD_INPUT, MEGABLOCK, megablock, one_line


def diagnosed(job):
    return json.loads(subprocess.check_output([MEGABLOCK, "diagnose", str(job), "--json"]))


def main():
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        project, job = folder / "block.yaml", folder / "job"
        megablock("simulate", "--frames", 30, "--points-per-frame", 80, "-o", folder)

        megablock("partition", project, "-j", job, "--quiet")
        before = diagnosed(job)  # given poses alone
        assert before["aerial"] and not before["links_known"] and len(before["footprints"]) == 30, before

        megablock("run", project, "-j", job, "--quiet")
        after = json.loads((job / "result/diagnostics.json").read_text())
        assert after == diagnosed(job)
        assert after["links_known"] and after["part_frames"] == [30] and after["gaps"] == [], after
        assert after["pair_count"] == 30 - after["flight_lines"] and after["pairs"] == [], after["pairs"]
        page = (job / "result/report.html").read_text()
        assert "Gaps and links" in page and "No exposure and no flight line is missing." in page
        digest = megablock("status", job, "--digest")

        # Other wishes: nothing is computed again, page and file follow.
        project.write_text(project.read_text() + "diagnostics: {min_base_to_height: 0.5}\n")
        megablock("run", project, "-j", job, "--quiet")
        megablock("report", job)
        after = json.loads((job / "result/diagnostics.json").read_text())
        assert len(after["pairs"]) == after["pair_count"] and all(pair["outside"] for pair in after["pairs"])
        assert megablock("status", job, "--digest") == digest

        project.write_text(project.read_text().replace("0.5}", "5}"))
        assert "min_base_to_height" in one_line(megablock("run", project, "-j", job, "--quiet", expect=BAD_INPUT))
        assert "job.json" in one_line(megablock("diagnose", folder / "nowhere", expect=BAD_INPUT))

    with tempfile.TemporaryDirectory() as folder:
        megablock("simulate", "--scene", "street", "--frames", 24, "--points-per-frame", 60, "-o", folder)
        job = pathlib.Path(folder) / "job"
        megablock("run", pathlib.Path(folder) / "block.yaml", "-j", job, "--quiet")
        street = json.loads((job / "result/diagnostics.json").read_text())
        assert not street["aerial"] and street["pairs"] == [] and street["proposals"] == [], street
        assert "Most images look sideways" in (job / "result/report.html").read_text()


main()
