#!/usr/bin/python3
"""Tests `megablock diagnose` before and after the adjustment, in the report and as JSON.
usage: diagnostics.py MEGABLOCK"""
import csv
import json
import math
import pathlib
import subprocess
import tempfile

from program import BAD_INPUT, MEGABLOCK, megablock, one_line, status


def diagnosed(job):
    return json.loads(subprocess.check_output([MEGABLOCK, "diagnose", str(job), "--json"]))


def strip_figures(places):
    """Largest distance from the line through the ends, and largest deviation of a step, over the mean step."""
    count = len(places)
    middle = [sum(place[k] for place in places) / count for k in range(3)]
    way = [places[-1][k] - places[0][k] for k in range(3)]
    length = math.hypot(*way)
    along = [sum((place[k] - middle[k]) * way[k] for k in range(3)) / length for place in places]
    off = max(math.dist(place, [middle[k] + a * way[k] / length for k in range(3)]) for place, a in zip(places, along))
    step = (along[-1] - along[0]) / (count - 1)
    return off / step, max(abs((b - a) / step - 1) for a, b in zip(along, along[1:]))


def check_the_checks(folder, job):
    """Flight lines, attitudes and common tie points against the truth of a block over flat ground."""
    subsets = [[f"f{i:06}.jpg" for i in images] for images in ((0, 1, 4), (0, 1, 2), (0, 1, 29))]
    asked = [option for images in subsets for option in ("--subset", ",".join(images))]
    checks = json.loads(megablock("diagnose", job, "--json", *asked))["checks"]
    text = megablock("diagnose", job, *asked)

    place = {row[0]: [float(x) for x in row[5:8]] for row in csv.reader((folder / "truth.csv").open()) if len(row) > 7
             and row[0] != "name"}
    names = sorted(place)
    assert len(checks["flight_lines"]) > 2
    for line in checks["flight_lines"]:
        first, last = (names.index(name) for name in line["frames"])
        assert last - first + 1 == line["exposures"], line
        off_line, uneven = strip_figures([place[name] for name in names[first:last + 1]])
        assert abs(line["off_line"] - off_line) < 0.03 and abs(line["uneven"] - uneven) < 0.03, (line, off_line, uneven)
        assert line["sound"] == (line["off_line"] <= 0.05 and line["uneven"] <= 0.05)
    assert f"check of {len(checks['flight_lines'])} flight lines: off their line by " in text, text

    assert checks["ground"]["sound"] and "do not lie on two levels" in text, text

    subset, errors = checks["point_subsets"], json.loads(megablock("evaluate", job, folder / "truth.csv", "--json"))
    per_axis = errors["rotation_rms_deg"] / math.sqrt(3)
    print(f"attitudes: error {per_axis:.2g} degrees per axis, stated {subset['rotation_sigma_deg']:.2g}")
    assert subset["subsets"] == 5 and per_axis < 3 * subset["rotation_sigma_deg"] < 15 * per_axis, (subset, errors)
    assert "check by 5 subsets of the tie points: attitudes " in text, text

    seen = {name: set() for images in subsets for name in images}
    for row in json.loads(megablock("measurements", job, "--near", "0,0", "--radius", 10000, "--json")):
        if row["kept"] and row["image"] in seen:
            seen[row["image"]].add(row["track"])
    expected = sorted(((len(set.intersection(*(seen[name] for name in images))), images) for images in subsets),
                      key=lambda row: -row[0])
    assert [(row["tracks"], row["images"]) for row in checks["common_tracks"]] == expected, (checks, expected)
    assert expected[0][0] > expected[-1][0] and f"{expected[0][0]} tie points in all of {', '.join(expected[0][1])}" in text
    said = one_line(megablock("diagnose", job, "--subset", "f000000.jpg,other.jpg", expect=BAD_INPUT))
    assert "the block has no image 'other.jpg'" in said, said


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
        printed = diagnosed(job)
        del printed["checks"]
        assert printed.pop("remarks") == status(job)["remarks"] == []
        assert after == printed
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
        folder = pathlib.Path(folder)
        megablock("simulate", "--frames", 30, "--relief", 0, "--points-per-frame", 150, "--attitude-sigma", 0.05,
                  "-o", folder)
        megablock("partition", folder / "block.yaml", "-j", folder / "job", "--quiet")
        early = json.loads(megablock("diagnose", folder / "job", "--json"))["checks"]
        assert early["point_subsets"] is None and early["point_subsets_omitted"] == "there is no result yet", early
        megablock("run", folder / "block.yaml", "-j", folder / "job", "--quiet")
        check_the_checks(folder, folder / "job")

    with tempfile.TemporaryDirectory() as folder:
        megablock("simulate", "--scene", "street", "--frames", 24, "--points-per-frame", 60, "-o", folder)
        job = pathlib.Path(folder) / "job"
        megablock("run", pathlib.Path(folder) / "block.yaml", "-j", job, "--quiet")
        street = json.loads((job / "result/diagnostics.json").read_text())
        assert not street["aerial"] and street["pairs"] == [] and street["proposals"] == [], street
        checks = diagnosed(job)["checks"]
        assert checks["flight_lines"] == [] and checks["ground"] is None, checks
        assert "Most images look sideways" in (job / "result/report.html").read_text()


main()
