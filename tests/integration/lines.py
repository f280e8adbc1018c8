#!/usr/bin/python3
"""Tests lines of known direction from the project file to the result, also when the job is run again.
usage: lines.py MEGABLOCK"""
import pathlib
import tempfile

from program import megablock, status

HEADER = "name,direction,image,column1_px,row1_px,column2_px,row2_px\n"


def kinds(job):
    return status(job)["observation_kinds"]


def main():
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        megablock("simulate", "--scene", "street", "--frames", 12, "--rig-cameras", 2, "-o", folder)
        project, job, names = folder / "block.yaml", folder / "job", image_names(folder)
        # Any segments do: their loss forgets what does not fit.
        (folder / "lines.csv").write_text(HEADER + f"edge,vertical,{names[0]},900,200,905,900\n"
                                          f"sill,horizontal,{names[1]},200,600,900,600\n"
                                          f"sill,horizontal,{names[3]},300,610,950,612\n")
        megablock("run", project, "-j", job, "-q")
        assert "line" not in kinds(job)
        plain = status(job)["digest"]
        project.write_text(project.read_text() + "lines: lines.csv\n")
        megablock("run", project, "-j", job, "-q")
        assert kinds(job)["line"]["count"] == 2, kinds(job)
        digest = status(job)["digest"]
        assert digest != plain
        again = megablock("run", project, "-j", job, "-q")
        assert status(job)["digest"] == digest and kinds(job)["line"]["count"] == 2, again
        (folder / "lines.csv").write_text(HEADER + "edge,vertical,nowhere.jpg,900,200,905,900\n")
        message = megablock("run", project, "-j", job, "-q", expect=2)
        assert "lines.csv:2" in message and "nowhere.jpg" in message, message


def image_names(folder):
    """As the simulator names them: frame, camera."""
    return [f"f{frame:06d}_c{camera}.jpg" for frame in range(12) for camera in range(2)]


main()
