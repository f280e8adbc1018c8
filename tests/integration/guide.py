#!/usr/bin/env python3
"""Follows pages of the guide as a new user would, and compares the output with the output that the pages show.

Every block of a page that is marked `console` is run, in the order of the page, in one empty folder. A line that begins
with `$ ` is a command; a trailing backslash continues it. The lines after it are its output. Times, digests and progress
lines may differ; everything else must be equal. --update writes the output of this program into the pages instead.
usage: guide.py MEGABLOCK [--update] PAGE...
"""
import difflib
import os
import pathlib
import re
import subprocess
import sys
import tempfile

update = "--update" in sys.argv
program, *pages = [argument for argument in sys.argv[1:] if argument != "--update"]
environment = dict(os.environ, PATH=f"{pathlib.Path(program).resolve().parent}:{os.environ['PATH']}",
                   OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1", LC_ALL="C.UTF-8")
environment.pop("COLUMNS", None)
BLOCK = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PROGRESS = re.compile(r"^(features|candidates|matching|tiles|tracks|orientation|adjustment|merge|register) +\S.*, \d+ s.*$")


def commands(block):
    """The commands of a block, each as it is written on the page, and the output that the page shows."""
    lines, found = block.splitlines(), []
    while lines:
        line = lines.pop(0)
        if line.startswith("$ "):
            while line.endswith("\\"):
                line += "\n" + lines.pop(0)
            found.append((line, []))
        elif found:
            found[-1][1].append(line)
    return found


def comparable(lines):
    """The lines without what differs from run to run."""
    lines = [re.sub(r"\d+(\.\d+)? (s|min)\b", "TIME", line) for line in lines]
    return [re.sub(r"(digest +)[0-9a-f]{16}", r"\1DIGEST", line) for line in lines]


def run(command, folder):
    """The lines that a command prints; ends the test when it fails."""
    done = subprocess.run(["bash", "-c", command], cwd=folder, env=environment, text=True, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT)
    output = done.stdout.replace(folder, "/home/me/blocks")
    lines = [line.rstrip() for line in output.splitlines() if not PROGRESS.match(line)]
    if done.returncode:
        sys.exit("\n".join([f"exit code {done.returncode}: {command}", *lines]))
    return lines


def follow(page):
    """The page with the output of this program, and the differences from what it shows."""
    differences = []
    with tempfile.TemporaryDirectory() as folder:
        def answer(match):
            written = []
            for command, shown in commands(match[1]):
                lines = run(command.removeprefix("$ "), folder)
                differences.extend(difflib.unified_diff(comparable(shown), comparable(lines), f"{page}: {command}",
                                                        "this program", lineterm=""))
                written += [command, *lines]
            return "```console\n" + "\n".join(written) + "\n```"

        return BLOCK.sub(answer, pathlib.Path(page).read_text()), differences


failed = False
for page in pages:
    text, differences = follow(page)
    print("\n".join(differences) or f"{page}: as shown")
    failed |= bool(differences)
    if update and differences:
        pathlib.Path(page).write_text(text)
sys.exit(failed and not update)
