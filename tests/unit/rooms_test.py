#!/usr/bin/env python3
"""Rooms depend in one direction; MPI only in cluster/, HDF5 only in io/. usage: rooms_test.py SOURCE_FOLDER"""
import pathlib
import re
import sys

MAY_INCLUDE = {
    "geometry": {"geometry"},
    "io": {"io", "geometry"},
    "partition": {"partition", "io", "geometry"},
    "match": {"match", "io", "geometry"},
    "adjust": {"adjust", "io", "geometry"},
    "merge": {"merge", "adjust", "partition", "io", "geometry"},
    "cluster": {"cluster", "merge", "adjust", "match", "partition", "io", "geometry"},
}
source = pathlib.Path(sys.argv[1])
include = re.compile(r'^\s*#\s*include\s*[<"]([^">]+)[">]')
problems, files = [], 0
for room, allowed in MAY_INCLUDE.items():
    for path in sorted((source / room).rglob("*")):
        if path.suffix not in (".h", ".cpp"):
            continue
        files += 1
        for number, line in enumerate(path.read_text().splitlines(), 1):
            match = include.match(line)
            if not match:
                continue
            name = match.group(1)
            top = name.split("/")[0]
            if top in MAY_INCLUDE and top not in allowed:
                problems.append(f"{path}:{number}: {room} must not include {top}")
            if name.startswith("mpi") and room != "cluster":
                problems.append(f"{path}:{number}: only cluster includes MPI")
            if name.lower().startswith(("hdf5", "h5")) and room != "io":
                problems.append(f"{path}:{number}: only io includes HDF5")
# Tests run side by side: none may name a place in the temporary folder, each gets one of its own.
names_a_place = re.compile(r"TempDir\(|temp_directory_path\(")
for path in sorted((source / "tests").rglob("*")):
    if path.suffix in (".h", ".cpp") and path.name != "scratch_directory.h" and names_a_place.search(path.read_text()):
        problems.append(f"{path}: tests get their folders from ScratchDirectory")
print("\n".join(problems) or f"{files} files keep to the arrows")
sys.exit(1 if problems or files < 50 else 0)
