"""Runs the program for the tests of whole jobs. First argument of the test: the program."""
import json
import pathlib
import subprocess
import sys

MEGABLOCK = sys.argv.pop(1)
DONE, FAILED_UNITS, BAD_INPUT, INTERRUPTED = 0, 1, 2, 75


def megablock(*arguments, expect=DONE, before=(), **options):
    """Runs the program; checks the exit code; returns what it wrote to standard error (and output, when it succeeded)."""
    done = subprocess.run([*before, MEGABLOCK, *map(str, arguments)], capture_output=True, text=True, **options)
    assert done.returncode == expect, f"{arguments}: exit code {done.returncode}, not {expect}\n{done.stdout}\n{done.stderr}"
    return done.stderr + (done.stdout if expect == DONE else "")


def one_line(text):
    lines = [line for line in text.splitlines() if line.startswith("megablock: ")]
    assert len(lines) == 1, text
    return lines[0]


def status(job):
    return json.loads(subprocess.check_output([MEGABLOCK, "status", str(job), "--json"]))


def events(job):
    """Of all runs of a job, in order."""
    lines = (line for file in (pathlib.Path(job) / "events").iterdir() for line in file.read_text().splitlines())
    return sorted((json.loads(line) for line in lines), key=lambda event: event["time"])
