#!/usr/bin/env python3
"""Checks that everything that the documents name exists: links and their headings, paths, ctest patterns. Also
checks that the documents name everything that the code has: folders, commands with their options, camera
models, keys that a command prints.
usage: docs_test.py SOURCE_FOLDER"""
import pathlib
import re
import sys

source = pathlib.Path(sys.argv[1])
documents = [path for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md") if (path := source / name).exists()]
documents += sorted((source / "docs").rglob("*.md"))
sources = [path for room in ("geometry", "io", "partition", "match", "adjust", "merge", "cluster", "tests")
           for path in sorted((source / room).rglob("*")) if path.suffix in (".h", ".cpp")]
problems, checked = [], 0


def headings(path):
    """The anchors of a document, as GitHub makes them."""
    titles = re.findall(r"^#+ +(.*)$", path.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def test_names():
    """Suite.Name of every GoogleTest case and label.name of every script, with the labels."""
    names, labels = set(), set()
    for path in (source / "tests").rglob("*.cpp"):
        cases = re.findall(r"^TEST(?:_F|_P)?\((\w+),\s*(\w+)\)", path.read_text(), re.MULTILINE)
        names |= {f"{suite}.{case}" for suite, case in cases}
    text = "".join((source / "tests" / folder / "CMakeLists.txt").read_text() for folder in ("", "benchmark"))
    labels |= set(re.findall(r"LABELS? (\w+)", text))
    for label, name in re.findall(r"megablock_script\((\w+) (\w+)", text):
        names.add(f"{label}.{name}")
        labels.add(label)
    names |= set(re.findall(r"add_test\(NAME (\w+\.\w+)", text))
    names |= {f"bench.{name}" for name in re.findall(r"megablock_bench\((\w+)", text)}
    return names, labels


def complain(path, line, what):
    problems.append(f"{path.relative_to(source)}:{line}: {what}")


for path in documents:
    for number, line in enumerate(path.read_text().splitlines(), 1):
        for link in re.findall(r"\]\(([^)\s]+)\)", line):
            if "://" in link:
                continue
            checked += 1
            file, _, anchor = link.partition("#")
            target = (path.parent / file) if file else path
            if not target.exists():
                complain(path, number, f"no such file: {link}")
            elif anchor and anchor not in headings(target):
                complain(path, number, f"no such heading: {link}")

for path in documents + sources:
    for number, line in enumerate(path.read_text().splitlines(), 1):
        for name in re.findall(r"(?<![\w./-])((?:tests|docs)/[\w./-]*[\w/])", line):
            checked += 1
            if not (source / name).exists() and not re.search(r"/[A-Z]+[/_]", name):  # ROOM/NAME_test.cpp: any
                complain(path, number, f"no such file: {name}")

# The architecture explains every folder of the floor plan in a line, and no other.
plan = (source / "tests/unit/rooms_test.py").read_text().split('FOLDERS = """')[1].split('"""')[0].split()
explained = re.findall(r"^\| `([\w/]+)` \|", (source / "docs/developer/architecture.md").read_text(), re.MULTILINE)
checked += len(plan)
problems += [f"docs/developer/architecture.md: the folder {folder} is missing, or is not in the floor plan"
             for folder in sorted(set(plan) ^ set(explained))]

names, labels = test_names()
for path in documents:
    for number, line in enumerate(path.read_text().splitlines(), 1):
        for kind, quoted, plain in re.findall(r"ctest[^`]*? -(R|L) (?:\"([^\"]+)\"|([^\s`\"]+))", line):
            checked += 1
            pattern = re.compile((quoted or plain).replace("\\|", "|"))  # in a table a bar is written \|
            if pattern.pattern.isupper():  # CONTRIBUTING's SUITE: any
                continue
            if not any(pattern.search(name) for name in (names if kind == "R" else labels)):
                complain(path, number, f"ctest -{kind} {pattern.pattern} finds no test")

# The reference of the commands has every command and option of the command line.
commands = (source / "docs/reference/commands.md").read_text()
code = "".join(path.read_text() for folder in ("commands", "terminal")
               for path in sorted((source / "cluster" / folder).glob("*.*")))
options = set(re.findall(r'"(?:-\w,)?(--[a-z][a-z0-9-]*)"', code)) - {"--version", "--output"}
checked += len(options)
problems += [f"docs/reference/commands.md: the option {option} is missing"
             for option in sorted(options) if f"`{option}`" not in commands]
problems += [f"docs/reference/commands.md: the command {name} is missing"
             for name in re.findall(r'add_subcommand\(\s*"([\w-]+)"', code) if f"\n## {name}\n" not in commands]

# The table of the camera models has every model, and the list of the features has it, too.
table = (source / "docs/reference/project-file.md").read_text().split("### Camera models\n")[1].split("\n#")[0]
described = {name.removesuffix("-N") for row in re.findall(r"^\| (`[^|]+) \|", table, re.MULTILINE)
             for name in re.findall(r"`([\w-]+)`", row)} - {"model"}
models = {name for path in (source / "geometry/camera/models").glob("*.h")
          for name in re.findall(r'kName = "([\w-]+)"', path.read_text())}
features = (source / "docs/reference/features.md").read_text()
checked += len(models)
problems += [f"docs/reference/project-file.md: the camera model {name} is missing, or is not in the code"
             for name in sorted(models ^ described)]
problems += [f"docs/reference/features.md: the camera model {name} is missing"
             for name in sorted(models) if f"`{name}`" not in features]

# Folders and files of the code that a document names.
in_the_tree = re.compile(r"`((?:geometry|io|partition|match|adjust|merge|cluster|examples|cmake)/[\w./-]*\w)`")
for path in documents:
    for number, line in enumerate(path.read_text().splitlines(), 1):
        for name in in_the_tree.findall(line):
            checked += 1
            if not (source / name).exists():
                complain(path, number, f"no such file: {name}")

# (where a command's JSON is made, what its keys look like there, document, heading above their table)
for code, key, document, heading in [("io/evaluation/evaluate.cpp", r'json\["(\w+)"\]', "docs/reference/simulate.md",
                                      "Figures of `evaluate`")]:
    section = re.split(r"^## ", (source / document).read_text().split(f"## {heading}\n")[1], flags=re.MULTILINE)[0]
    keys = re.findall(key, (source / code).read_text())
    checked += len(keys)
    for name in keys:
        if f"`{name}`" not in section:
            problems.append(f"{document}: the key '{name}' ({code}) is missing under '{heading}'")
    if not keys:
        problems.append(f"{code}: no keys found")

print("\n".join(problems) or f"{checked} names of the documents are there")
sys.exit(1 if problems or checked < 40 else 0)
