#!/usr/bin/env python3
"""Makes sensor_widths.csv, the table of sensor widths that the program carries.

It joins sensor_widths_makers.csv (makers' data sheets, kept by hand) with the public tables of other programs:
  --colmap FILE   src/colmap/sensor/specs.cc (since 3.9) or src/util/camera_specs.cc (up to 3.8) of COLMAP
  --opensfm FILE  opensfm/data/sensor_data.json of OpenSfM, which OpenDroneMap also uses
  --known FILE    an earlier sensor_widths.csv, of which the lines of both are kept
If several tables have the same camera, the makers' table counts first, then COLMAP's, then OpenSfM's. COLMAP and OpenSfM
have the same list of about 3 600 cameras (Gregor Brdnik, digicamdb.com), so OpenSfM adds only those that are not in it.
usage: make_sensor_widths.py [--colmap FILE] [--opensfm FILE] [--known FILE] > sensor_widths.csv
"""
import argparse
import csv
import json
import pathlib
import re


def plain(name):
    """Letters and digits in lower case: programs write the same camera with other spaces and hyphens."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


def of_makers(path):
    rows = csv.reader(line for line in path.read_text().splitlines() if line and not line.startswith("#"))
    next(rows)
    return [(make, model, float(width), "maker") for make, model, width in rows]


def of_colmap(path):
    make, rows = "", []
    for line in path.read_text().splitlines():
        if found := re.search(r'specs\["([^"]+)"\]', line):
            make = found.group(1)
        if found := re.search(r'emplace_back\("([^"]+)", ([0-9.]+)f?\)', line):
            rows.append((make, found.group(1), float(found.group(2)), "colmap"))
    return rows


MAKES_OF_TWO_WORDS = ["LG Electronics", "SAMSUNG TECHWIN"]


def of_opensfm(path):
    rows = []
    for name, width in json.loads(path.read_text()).items():
        make = next((m for m in MAKES_OF_TWO_WORDS if name.startswith(m + " ")), name.split(" ")[0])
        model = name[len(make):]
        rows.append((make, model, float(width), "opensfm"))
    return rows


def of_known(path):
    lines = [line for line in path.read_text().splitlines() if line and not line.startswith("#")]
    return [(make, model, float(width), source) for make, model, width, source in csv.reader(lines[1:]) if source != "maker"]


arguments = argparse.ArgumentParser()
arguments.add_argument("--colmap", type=pathlib.Path)
arguments.add_argument("--opensfm", type=pathlib.Path)
arguments.add_argument("--known", type=pathlib.Path)
options = arguments.parse_args()
folder = pathlib.Path(__file__).parent
rows = of_makers(folder / "sensor_widths_makers.csv")
rows += of_colmap(options.colmap) if options.colmap else []
rows += of_known(options.known) if options.known else []
rows += of_opensfm(options.opensfm) if options.opensfm else []
known = {}
for make, model, width, source in rows:
    if width > 0 and (source != "opensfm" or ("", plain(model)) not in known):  # an empty make stands for any
        known.setdefault((plain(make), plain(model)), (width, source))
sources = {source for _, source in known.values()}
print("# Sensor widths: the larger side in mm. Made by make_sensor_widths.py, not by hand.")
print("# maker: makers' data sheets (sensor_widths_makers.csv).")
if "colmap" in sources:
    print("# colmap: COLMAP 3.8, src/util/camera_specs.cc, copyright ETH Zurich and UNC Chapel Hill, new BSD licence")
    print("# (LICENSES/colmap.txt).")
if "opensfm" in sources:
    print("# opensfm: OpenSfM, opensfm/data/sensor_data.json, which OpenDroneMap uses too, copyright Mapillary AB,")
    print("# simplified BSD licence (LICENSES/opensfm.txt); what it has beyond the list that it shares with COLMAP.")
print("# Names are in lower case without spaces and signs.")
print("make,model,width_mm,source")
for (make, model), (width, source) in sorted(known.items()):
    print(f"{make},{model},{width:g},{source}")
