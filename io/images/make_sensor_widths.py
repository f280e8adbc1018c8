#!/usr/bin/env python3
"""Makes sensor_widths.csv, the table of sensor widths that the program carries.

It joins sensor_widths_makers.csv (makers' data sheets, kept by hand) with the public tables of other programs:
  --colmap FILE   src/colmap/sensor/specs.cc (since 3.9) or src/util/camera_specs.cc (up to 3.8) of COLMAP
  --opensfm FILE  opensfm/data/sensor_data.json of OpenSfM, which OpenDroneMap also uses
If several tables have the same camera, the makers' table counts first, then COLMAP's, then OpenSfM's.
usage: make_sensor_widths.py [--colmap FILE] [--opensfm FILE] > sensor_widths.csv
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


def of_opensfm(path):
    rows = []
    for name, width in json.loads(path.read_text()).items():
        make, _, model = name.partition(" ")
        rows.append((make, model, float(width), "opensfm"))
    return rows


arguments = argparse.ArgumentParser()
arguments.add_argument("--colmap", type=pathlib.Path)
arguments.add_argument("--opensfm", type=pathlib.Path)
options = arguments.parse_args()
folder = pathlib.Path(__file__).parent
rows = of_makers(folder / "sensor_widths_makers.csv")
rows += of_colmap(options.colmap) if options.colmap else []
rows += of_opensfm(options.opensfm) if options.opensfm else []
known = {}
for make, model, width, source in rows:
    if width > 0:
        known.setdefault((plain(make), plain(model)), (width, source))
print("# Sensor widths: the larger side in mm. Made by make_sensor_widths.py, not by hand.")
print("# maker: makers' data sheets (sensor_widths_makers.csv).")
if options.colmap:
    print("# colmap: COLMAP 3.8, src/util/camera_specs.cc, copyright ETH Zurich and UNC Chapel Hill, new BSD licence")
    print("# (LICENSES/colmap.txt).")
if options.opensfm:
    print("# opensfm: OpenSfM, opensfm/data/sensor_data.json, copyright Mapillary AB, 2-clause BSD licence.")
print("# Names are in lower case without spaces and signs.")
print("make,model,width_mm,source")
for (make, model), (width, source) in sorted(known.items()):
    print(f"{make},{model},{width:g},{source}")
