"""Runs programs under mpirun and ends them by SIGKILL."""
import contextlib
import os
import pathlib
import signal
import subprocess


def start(command, ranks, log):
    """mpirun in a session of its own."""
    environment = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    return subprocess.Popen(["mpirun", "--bind-to", "none", "--oversubscribe", "--mca", "mpi_yield_when_idle", "1",
                             "-n", str(ranks), *map(str, command)], env=environment, stdout=log, stderr=log,
                            stdin=subprocess.DEVNULL, start_new_session=True)


def processes_of(session):
    """Living processes of a session: mpirun gives its ranks process groups of their own, but keeps its session."""
    found = []
    for entry in pathlib.Path("/proc").iterdir():
        try:
            state, _, _, its_session = (entry / "stat").read_text().rpartition(")")[2].split()[:4]
        except (OSError, ValueError):
            continue  # not a process, or gone
        if int(its_session) == session and state not in "ZX":
            found.append(int(entry.name))
    return found


def kill_all(session):
    while processes := processes_of(session):
        for process in processes:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)


def kill_after(command, ranks, log, moment_s):
    """Whether it still ran then."""
    process = start(command, ranks, log)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(timeout=moment_s)
    running = process.poll() is None
    kill_all(process.pid)
    process.wait()
    return running
