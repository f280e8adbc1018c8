#!/usr/bin/env python3
"""Tests that `megablock masks` leaves existing masks as they are, and accepts the proposals of an earlier run.
usage: masks.py MEGABLOCK"""
import pathlib
import tempfile

import pictures
from program import BAD_INPUT, megablock, one_line

WIDTH, HEIGHT = 160, 90


def main():
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        megablock("simulate", "--scene", "stereopolis", "--rendered", "--vehicle", "--frames", 10, "--drives", 2,
                  "--street-spacing", 40, "--width", WIDTH, "--image-height", HEIGHT, "--focal", 117, "--control-zones",
                  0, "-o", folder)
        project, masks = folder / "block.yaml", folder / "masks"
        propose = ("masks", project, "--min-images", 10, "--min-distance", 1, "-o", masks)
        said = megablock(*propose)
        proposed = {file.name: file.read_bytes() for file in masks.iterdir()}
        names = sorted(name for name in proposed if name.endswith(".png"))
        assert len(names) == 7, said  # the cameras that look up see nothing of the vehicle
        assert said == megablock(*propose)
        assert proposed == {file.name: file.read_bytes() for file in masks.iterdir()}

        drawn = masks / names[0]
        pictures.write_png(drawn, WIDTH, HEIGHT, lambda y: bytes([255 if y < 80 else 0]) * WIDTH)
        by_hand, before = drawn.read_bytes(), drawn.stat().st_mtime_ns
        said = megablock(*propose)
        assert f"{drawn} is there already and stays as it is" in said, said
        assert "6 masks in" in said, said
        assert drawn.read_bytes() == by_hand and drawn.stat().st_mtime_ns == before
        # The project's own masks stay, too, when proposals go elsewhere.
        project.write_text(project.read_text() + "masks: masks\n")
        said = megablock("masks", project, "--min-images", 10, "--min-distance", 1, "-o", folder / "others")
        assert "the project has" in said and "which stays as it is" in said, said
        assert drawn.read_bytes() == by_hand and (folder / "others" / names[0]).read_bytes() == proposed[names[0]]

        # The trajectory of these images, misspelt.
        given = (folder / "poses.csv").read_text()
        for header, said in ("name,qq,qx", "column 'qw' is missing"), ("name,a,b", "no columns of poses"):
            text = given.replace("name,qw,qx", header)
            (folder / "poses.csv").write_text(text if "qq" in header else text.replace("qy,qz", "c,d"))
            message = one_line(megablock("register", project, "-j", folder / "job", "-q", expect=BAD_INPUT))
            assert said in message and "poses.csv" in message, message


main()
