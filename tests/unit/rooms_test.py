#!/usr/bin/env python3
"""Checks the floor plan: every folder of the code includes only folders that stand before it in the list below.

It also checks that MPI is included only in cluster/, HDF5 only in io/, that no public header includes an internal one,
and that no folder is too full, and it prints the graph of the folders. docs/developer/architecture.md explains the order.
usage: rooms_test.py SOURCE_FOLDER
"""
import collections
import pathlib
import re
import sys

# A folder may include itself and every folder of its room that stands before it, and whole rooms as ROOMS says.
FOLDERS = """
geometry/numbers geometry/threads geometry/estimation geometry/transform geometry/camera/models geometry/camera geometry/similarity
geometry/vanishing geometry/two_view geometry/resection geometry/intersection
io/base io/text io/block io/images io/images/module io/store/hdf5 io/store/job io/store/units io/project/inputs io/project/positions io/project/trajectory io/project io/result io/evaluation io/evaluation/remarks
io/exchange/model io/exchange/bal io/exchange/colmap io/exchange/tables io/exchange
io/simulate/scene io/simulate/streets io/simulate/images io/simulate/blocks io/simulate/files
io/report/drawing io/report/sections io/report
partition/views partition/candidates partition/links partition/tiles partition/diagnostics
match/images match/features match/nearest match/verification match/filter match/pairs match/tracks
adjust/problem adjust/terms adjust/lanes adjust/resection adjust/tile adjust/independent_models adjust/orientation/steps adjust/orientation
adjust/calibration adjust/registration adjust/coplanarity adjust/checks
merge/scratch merge/plan merge/front merge/tile merge/datum merge/step merge/checks merge/tree merge/start merge/rig merge/camera
cluster/process cluster/mpi cluster/job cluster/outcome
cluster/stages/common cluster/stages/registration cluster/stages/pipeline cluster/stages/result cluster/stages/merge
cluster/stages cluster/status cluster/terminal cluster/commands cluster/main
""".split()
ROOMS = {
    "geometry": set(),
    "io": {"geometry"},
    "partition": {"io", "geometry"},
    "match": {"io", "geometry"},
    "adjust": {"io", "geometry"},
    "merge": {"adjust", "partition", "io", "geometry"},
    "cluster": {"merge", "adjust", "match", "partition", "io", "geometry"},
}
MOST_FILES = 25  # of code in one folder
INTERNAL = re.compile(r"^// .*Internal to", re.MULTILINE)  # cmake/install.cmake leaves these headers out

source = pathlib.Path(sys.argv[1])
include = re.compile(r'^\s*#\s*include\s*[<"]([^">]+)[">]')
place = {folder: number for number, folder in enumerate(FOLDERS)}
problems, arrows, files = [], collections.defaultdict(set), collections.Counter()


def check_include(path, number, folder, name):
    room = folder.split("/")[0]
    if name.startswith("mpi") and room != "cluster":
        problems.append(f"{path}:{number}: only cluster/ includes MPI")
    if name.lower().startswith(("hdf5", "h5")) and room != "io":
        problems.append(f"{path}:{number}: only io/ includes HDF5")
    other = name.rpartition("/")[0]
    other_room = name.split("/")[0]
    if other_room not in ROOMS or other == folder:
        return
    if other not in place:
        if (source / name).exists():
            problems.append(f"{path}:{number}: {other}/ is not in the list of folders")
        return
    arrows[folder].add(other)
    if other_room != room and other_room not in ROOMS[room]:
        problems.append(f"{path}:{number}: {room}/ must not include {other_room}/")
    if other_room == room and place[other] > place[folder]:
        problems.append(f"{path}:{number}: {folder}/ must not include {other}/, which stands behind it")


for room in ROOMS:
    for path in sorted((source / room).rglob("*")):
        if path.suffix not in (".h", ".cpp"):
            continue
        folder = path.parent.relative_to(source).as_posix()
        files[folder] += 1
        if folder not in place:
            problems.append(f"{path}: {folder}/ is not in the list of folders")
            continue
        for number, line in enumerate(path.read_text().splitlines(), 1):
            match = include.match(line)
            if match:
                check_include(path, number, folder, match.group(1))
for room in set(ROOMS) - {"cluster"}:
    texts = {path.relative_to(source).as_posix(): path.read_text() for path in sorted((source / room).rglob("*.h"))}
    internal = {name for name, text in texts.items() if INTERNAL.search(text)}
    for name in sorted(set(texts) - internal):
        problems += [f"{name}: a public header must not include {other}, which is internal"
                     for other in re.findall(r'#include "([^"]+)"', texts[name]) if other in internal]
problems += [f"{folder}/ holds {count} files of code, at most {MOST_FILES} are allowed"
             for folder, count in files.items() if count > MOST_FILES]
problems += [f"{folder}/ is in the list of folders but holds no code" for folder in FOLDERS if not files[folder]]

# The files of a room are compiled in batches that change with every file that is added: names in their unnamed
# namespaces must differ.
unnamed = re.compile(r"^namespace \{$(.*?)^\}  // namespace$", re.S | re.M)
named = re.compile(r"^(?:enum class|struct|class) (\w+)[^;]*?\{|^constexpr [^=;(]*?\b(k\w+)\b", re.M)
for room in ROOMS:
    first = {}
    for path in sorted((source / room).rglob("*.cpp")):
        for part in unnamed.findall(path.read_text()):
            for name in {match.group(1) or match.group(2) for match in named.finditer(part)}:
                other = first.setdefault(name, path)
                if other != path:
                    problems.append(f"{path}: the unnamed namespace of {other} has a '{name}' too")

# Tests run side by side: none may name a place in the temporary folder, each gets one of its own.
names_a_place = re.compile(r"TempDir\(|temp_directory_path\(")
for path in sorted((source / "tests").rglob("*")):
    if path.suffix in (".h", ".cpp") and path.name != "scratch_directory.h" and names_a_place.search(path.read_text()):
        problems.append(f"{path}: tests get their folders from ScratchDirectory")

for folder in FOLDERS:
    others = [other if other.split("/")[0] == folder.split("/")[0] else other.split("/")[0] for other in arrows[folder]]
    print(f"{folder} ({files[folder]}) <- {', '.join(sorted(set(others))) or 'nothing'}")
print("\n".join(problems) or f"{sum(files.values())} files in {len(FOLDERS)} folders keep to the arrows")
sys.exit(1 if problems or sum(files.values()) < 50 else 0)
