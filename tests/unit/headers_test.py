#!/usr/bin/env python3
"""Checks that every source file has its own header, and that every header has a test.

A header has a test if a file under tests/ includes it. If one of the two is missing, tests/unit/headers.txt says why:
  part    SOURCE HEADER REASON   the source file implements a part of this header
  covered HEADER TEST   REASON   the test (a file under tests/) goes through this header without including it
usage: headers_test.py SOURCE_FOLDER
"""
import pathlib
import re
import sys

ROOMS = ("geometry", "io", "partition", "match", "adjust", "merge", "cluster")
source = pathlib.Path(sys.argv[1])
problems = []


def files(folder, ending):
    return [path.relative_to(source).as_posix() for path in sorted((source / folder).rglob(f"*{ending}"))]


parts, covered = set(), {}
for number, line in enumerate((source / "tests/unit/headers.txt").read_text().splitlines(), 1):
    if not line.strip() or line.startswith("#"):
        continue
    kind, name, where, reason = (line.split(None, 3) + [""] * 4)[:4]
    place = f"tests/unit/headers.txt:{number}"
    if not reason:
        problems.append(f"{place}: says no reason")
    if not (source / name).exists():
        problems.append(f"{place}: there is no {name}")
    if not (source / where).exists():
        problems.append(f"{place}: there is no {where}")
    if kind == "part":
        parts.add(name)
    elif kind == "covered":
        covered[name] = where
    else:
        problems.append(f"{place}: '{kind}' is neither 'part' nor 'covered'")

included = set()
for path in (source / "tests").rglob("*"):
    if path.suffix in (".h", ".cpp"):
        included |= set(re.findall(r'#include "([^"]+)"', path.read_text()))

for room in ROOMS:
    for path in files(room, ".cpp"):
        folder = path.rpartition("/")[0]
        lone = not (source / path).with_suffix(".h").exists()
        if lone and path not in parts and not folder.endswith(("/main", "/module")):
            problems.append(f"{path}: has no header of its own; give it one, or say in headers.txt which it implements")
        if not lone and path in parts:
            problems.append(f"{path}: has a header of its own; remove its line from headers.txt")
    for header in files(room, ".h"):
        if header not in included and header not in covered:
            problems.append(f"{header}: no test includes it; give it a test, or say in headers.txt what covers it")
        if header in included and header in covered:
            problems.append(f"{header}: a test includes it; remove its line from headers.txt")
print("\n".join(problems) or f"every source file of {len(ROOMS)} rooms has its header, every header its test")
sys.exit(1 if problems else 0)
