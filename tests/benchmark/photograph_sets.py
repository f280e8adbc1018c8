"""The common parts of scripts that compare whole runs over sets of real images. Their arguments are MEGABLOCK DATA
[TURNS [SET ...]]; they exit with 77 without the images."""
import json
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

MEGABLOCK, DATA = sys.argv[1], pathlib.Path(sys.argv[2])
TURNS = int(sys.argv[3]) if len(sys.argv) > 3 else 1


def projects(*default):
    """Name, a folder to work in and the project of each set."""
    sets = sys.argv[4:] or default
    if not (DATA / sets[0]).is_dir():
        print(f"skipped: no photographs in {DATA}")
        sys.exit(77)
    with tempfile.TemporaryDirectory() as folder:
        for name in sets:
            work = pathlib.Path(folder) / name
            work.mkdir()
            call("init", DATA / name, "-o", work / "block.yaml")
            yield name, work, work / "block.yaml"


def call(*arguments):
    """Seconds of the clock and of the processor."""
    start, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([MEGABLOCK, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.monotonic() - start, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def status_of(job):
    return json.loads(subprocess.check_output([MEGABLOCK, "status", str(job), "--json"]))


def listed(seconds):
    return ", ".join(f"{s:.1f}" for s in seconds)
