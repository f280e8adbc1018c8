#!/usr/bin/python3
"""Runs the program with blocks as people have them: what is harmless must do no harm, and what is missing is said.

usage: everyday_input.py MEGABLOCK [unittest arguments]
Each case is one of shared/data/hard, made from a small rendered block.
"""
import json
import re
import unittest

import h5py
import numpy
import pictures
from PIL import Image
from program import FAILED_UNITS, megablock, status
from small_block import CopyOfTheBlock, setUpModule, simulate, tearDownModule, work

OPTIONS = "features:\n  max_features: 1200\n  max_megapixels: 2\n"


class EverydayInput(CopyOfTheBlock):
    def files(self):
        return sorted(self.images.glob("*.jpg"))

    def write_project(self, text):
        self.project.write_text(f"images: images\n{text}{OPTIONS}")

    def assert_all_oriented(self, images=12, oriented=None):
        state = status(self.job)
        self.assertEqual((state["images"], state["oriented"]), (images, oriented or images))

    def write_positions(self, positions, project=""):
        """A list of positions in metres, one row for each image in the order of the names, sigma 0.05 m."""
        names = sorted(file.name for file in self.images.iterdir())
        rows = [f"{name},{x},{y},{z}" for name, (x, y, z) in zip(names, positions, strict=True)]
        (self.folder / "positions.csv").write_text("\n".join(["image,x,y,z", *rows]))
        self.write_project("positions: {file: positions.csv, crs: local}\n"
                           "gps: {sigma_horizontal_m: 0.05, sigma_vertical_m: 0.05}\n" + project)

    def true_positions(self):
        with h5py.File(self.folder / "truth.h5") as truth:
            return truth["frames/centre"][:]

    def errors(self):
        return json.loads(megablock("evaluate", self.job, self.folder / "truth.h5", "--json"))

    def test_leftovers_of_systems_are_no_images(self):
        for file in self.files()[:3]:
            (self.images / f"._{file.name}").write_bytes(b"\0\5\x16\7\0\2\0\0Mac OS X        " + bytes(4000))
            (self.images / f"{file.name}_original").write_bytes(file.read_bytes())
        (self.images / "Thumbs.db").write_bytes(bytes(600))
        self.run_job()
        self.assert_all_oriented()

    def test_an_image_without_texture_is_named_with_its_grey_values(self):
        dark = self.images / "dark.png"
        pictures.write_png(dark, 480, 360, lambda y: bytes([0, 12]) * 480, bits=16)
        self.write_project("")
        self.run_job()
        self.assert_all_oriented(13, 12)
        self.assertIn("1 of 13 images has fewer than 50 keypoints: dark.png (0, grey values 12 to 12); check exposure, "
                      "focus and masks", status(self.job)["notes"])

    def use(self, name):
        self.folder = work / name
        self.project, self.images, self.job = self.folder / "block.yaml", self.folder / "images", self.folder / "job"

    def test_a_camera_that_only_turned_is_named(self):
        simulate("turned", 8, 320, 240, "--scene", "panorama")
        self.use("turned")
        self.assertIn("no image could be oriented: the camera only turned about its projection centre",
                      self.run_job(expect=FAILED_UNITS))

    def test_sections_of_one_image_may_be_those_of_a_camera_that_only_turned(self):
        random = numpy.random.default_rng(1)
        whole = sum(numpy.kron(random.uniform(0, 255 / 4, (640 // s, 800 // s)), numpy.ones((s, s))) for s in (2, 4, 8, 16))
        for file in self.files():
            file.unlink()
        for i in range(6):
            section = whole[20 * i:20 * i + 300, 50 * i:50 * i + 400].astype(numpy.uint8)
            pictures.write_png(self.images / f"section{i}.png", 400, 300, lambda y: section[y].tobytes())
        for focal, named in (("", True), ("cameras: {default: {focal_px: 480}}\n", False)):
            with self.subTest(focal=focal):
                self.write_project(focal)
                self.run_job()
                self.assertEqual("flat ground, and a camera that only turned" in " ".join(status(self.job)["notes"]), named)

    def test_one_position_for_all_images_is_used_once(self):
        for file in self.files():
            pictures.Exif(file).set_position(48.85, 2.35)
        self.write_project("")
        self.assertIn("12 of 12 images share one position (48.850000, 2.350000)", self.run_job())
        self.assert_all_oriented()

    def test_a_control_point_in_an_absent_image_is_a_warning(self):
        simulate("controlled", 12, 480, 360, "--control-points", 4)
        self.folder = work / "controlled"
        self.project, self.images, self.job = self.folder / "block.yaml", self.folder / "images", self.folder / "job"
        control = self.folder / "gcp_list.txt"
        rows = control.read_text().splitlines()
        absent = rows[1].split()
        absent[5] = "IMG_9999.jpg"
        # As a spreadsheet would write it: byte order mark, semicolons, line ends of Windows, names in other case.
        lines = [rows[0]] + [";".join(row.split()).upper() for row in rows[1:]] + [";".join(absent)]
        control.write_bytes(b"\xef\xbb\xbf" + "\r\n".join(lines).encode())
        self.write_project("control: gcp_list.txt\n")
        said = self.run_job()
        self.assertIn("1 measurement is not used, because the block has no image 'IMG_9999.jpg'", said)
        self.assert_all_oriented()

    def test_positions_47_m_above_the_control_are_moved_onto_it(self):
        simulate("offset", 12, 480, 360, "--control-points", 8, "--gps-sigma", 0.02)
        self.folder = work / "offset"
        self.project, self.job = self.folder / "block.yaml", self.folder / "job"
        control = self.folder / "gcp_list.txt"
        head, *rows = [line.split() for line in control.read_text().splitlines()]
        rows = [[x, y, str(float(z) - 47), *rest] for x, y, z, *rest in rows]
        control.write_text("\n".join(" ".join(row) for row in [head, *rows]))
        check = sorted({row[6] for row in rows})[:2]
        project = f"control: {{file: gcp_list.txt, check: [{', '.join(check)}]}}\n"
        number = r"([0-9.]+)"
        # A focal length that is too long moves the ground as an offset of the heights does: the offset is as good as it.
        with h5py.File(self.folder / "truth.h5") as truth:
            f, cx, cy, k1, k2, k3, p1, p2 = truth["cameras/intrinsics"][0, :8]
        known = (f"cameras: {{default: {{calibrate: false, focal_px: {f}, principal_point_px: [{cx}, {cy}], "
                 f"distortion: {{k1: {k1}, k2: {k2}, k3: {k3}, p1: {p1}, p2: {p2}}}}}}}\n")
        for camera, limit_m in (("", 0.5), (known, 0.1)):
            with self.subTest(camera=camera):
                self.write_project(project + camera)
                self.run_job()
                self.assert_all_oriented()
                state = status(self.job)
                notes = " ".join(state["notes"])
                found = re.search(rf"the positions lie {number} m above the control points \(sigma {number} m, [0-9]+ p", notes)
                self.assertIsNotNone(found, notes)
                self.assertLess(abs(float(found[1]) - 47), 3 * float(found[2]))
                self.assertLess(float(found[2]), 5)
                found = re.search(rf"adjusted block the positions of .* lie {number} m above their places \(sigma {number} m\)",
                                  notes)
                self.assertIsNotNone(found, notes)
                self.assertLess(abs(float(found[1]) - 47), 3 * float(found[2]) + 0.005)
                self.assertLess(abs(float(found[1]) - 47), limit_m)
                self.assertLess(float(found[2]), limit_m)
                self.assertGreaterEqual(state["check_points"]["compared"], 1)
                self.assertLess(state["check_points"]["normalised_error"], 3)
                self.assertLess(state["check_points"]["rms_vertical_m"], 0.2)

    def test_positions_of_two_flights_get_a_shift(self):
        simulate("flights", 12, 480, 360)
        self.use("flights")
        positions = self.true_positions() + 0.05 * numpy.random.default_rng(5).standard_normal((12, 3))
        positions[7:, 2] += 5
        for more in ("", "orientation: {shift_positions: false}\n"):
            with self.subTest(project=more):
                self.write_positions(positions, more)
                self.run_job()
                self.assert_all_oriented()
                state = status(self.job)
                errors = self.errors()
                if more:
                    self.assertGreater(errors["position_rms_m"], 0.3)
                    continue
                notes = " ".join(state["notes"])
                self.assertRegex(notes, "5 positions .* lie [45][0-9.]* m above the 7 of the largest group")
                found = re.search(r"in the adjusted block the positions of \S+ and 4 more lie ([0-9.]+) m above their places", notes)
                self.assertLess(abs(float(found[1]) - 5), 0.2, notes)
                self.assertLess(errors["position_rms_m"], 0.15)

    def test_two_gross_positions_are_named_and_move_nothing(self):
        positions = self.true_positions() + 0.05 * numpy.random.default_rng(3).standard_normal((12, 3))
        self.write_positions(positions)
        self.run_job()
        right = self.errors()
        positions[4, 0] += 248
        positions[9, 2] -= 178
        self.write_positions(positions)
        self.run_job()
        self.assert_all_oriented()
        said = " ".join(status(self.job)["remarks"])
        self.assertRegex(said, "2 of 12 positions differ .* f000004.jpg by 24[78] m, f000009.jpg by 17[789] m")
        self.assertLess(abs(self.errors()["position_rms_m"] - right["position_rms_m"]), 0.03)
        self.assertLess(self.errors()["position_max_m"], 0.15)

    def test_two_images_without_headers(self):
        for file in self.files()[2:]:
            file.unlink()
        for file in self.files():
            pictures.strip_exif(file)
        self.write_project("")
        self.run_job()
        self.assert_all_oriented(2)
        self.assertIn("The datum is free", " ".join(status(self.job)["remarks"]))
        with h5py.File(self.job / "result/block.h5") as result:
            self.assertRegex(result["cameras/choice"].asstr()[0], "estimated: f .*held: cx, cy ")
            sigma_px = result["cameras/covariance"][0, 0, 0] ** 0.5
        self.assertLess(abs(self.focal_px() - 375), 3 * sigma_px)

    def test_images_of_other_kinds_among_others(self):
        positions = self.true_positions()
        for file, mode in zip(self.files(), ("L", "CMYK", "RGBA", "P")):
            image = Image.open(file).convert(mode)
            file.unlink()
            image.save(file if mode in ("L", "CMYK") else file.with_suffix(".png"))
        self.write_positions(positions)
        self.run_job()
        self.assert_all_oriented()
        self.assertLess(self.errors()["position_rms_m"], 0.1)

    def test_a_hot_pixel_among_few_grey_values_of_16_bits(self):
        positions = self.true_positions()
        for file in self.files():
            grey = numpy.asarray(Image.open(file).convert("L")).astype(numpy.uint16) * 8
            grey[100, 200] = 65535
            Image.fromarray(grey).save(file.with_suffix(".tif"))
            file.unlink()
        self.write_positions(positions)
        self.run_job()
        self.assert_all_oriented()
        self.assertLess(self.errors()["position_rms_m"], 0.1)
        self.assertLess(abs(self.focal_px() / 375 - 1), 0.01)

    def focal_px(self):
        with h5py.File(self.job / "result/block.h5") as result:
            return result["cameras/intrinsics"][0, 0]

    def test_a_focal_length_that_the_images_contradict_is_named_and_replaced(self):
        for wrong in (262, 490, 1900):  # of 375
            with self.subTest(focal_px=wrong):
                self.write_project(f"cameras: {{default: {{focal_px: {wrong}}}}}\n")
                self.run_job()
                self.assert_all_oriented()
                self.assertRegex(" ".join(status(self.job)["notes"]), f"the focal length of {wrong} px .* cannot be right")
                self.assertLess(abs(self.focal_px() / 375 - 1), 0.01)

    def test_a_focal_length_that_no_header_tells_comes_from_the_images(self):
        for file in self.files():
            pictures.strip_exif(file)
        self.write_project("")
        self.run_job()
        self.assert_all_oriented()
        notes = " ".join(status(self.job)["notes"])
        start = re.search("the headers tell no focal length; the block starts with ([0-9]+) px", notes)
        self.assertIsNotNone(start, notes)
        self.assertLess(abs(float(start[1]) / 375 - 1), 0.1)
        self.assertLess(abs(self.focal_px() / 375 - 1), 0.01)

    def test_a_right_focal_length_stays(self):
        self.write_project("cameras: {default: {focal_px: 375}}\n")
        self.run_job()
        self.assertNotIn("focal length", " ".join(status(self.job)["notes"]))
        self.assertLess(abs(self.focal_px() / 375 - 1), 0.01)

    def test_positions_without_heights_leave_the_tilt_and_end(self):
        lines = ["EPSG:4326"]
        for file in self.files():
            latitude, longitude = pictures.Exif(file).position()
            lines.append(f"{file.stem} {longitude:.9f} {latitude:.9f}")
            pictures.strip_exif(file)
        (self.folder / "geo.txt").write_text("\n".join(lines))
        self.write_project("positions: geo.txt\ncameras: {default: {focal_px: 375}}\norigin: [48.85, 2.35, 100]\n")
        self.run_job()
        self.assert_all_oriented()
        self.assertIn("heights and attitudes are not usable", " ".join(status(self.job)["remarks"]))

    def test_positions_of_a_file_do_as_those_of_the_headers(self):
        lines = ["EPSG:4326"]
        for file in self.files():
            latitude, longitude = pictures.Exif(file).position()
            lines.append(f"{file.stem} {longitude:.9f} {latitude:.9f} {pictures.Exif(file).height()} 0 0 0 0.05 0.05")
            pictures.strip_exif(file)
        (self.folder / "geo.txt").write_text("\n".join(lines))
        self.write_project("positions: geo.txt\ncameras: {default: {focal_px: 375}}\norigin: [48.85, 2.35, 100]\n")
        self.run_job()
        self.assert_all_oriented()
        errors = json.loads(megablock("evaluate", self.job, self.folder / "truth.csv", "--json"))
        self.assertLess(errors["position_max_m"], 0.5)


if __name__ == "__main__":
    unittest.main()
