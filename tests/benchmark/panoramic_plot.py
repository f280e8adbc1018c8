#!/usr/bin/python3
"""Plots the simulations of panoramic self-calibration, and prints their table in Markdown.

    build/release/tests/benchmark/compare_panoramic 5 > panoramic.csv
    tests/benchmark/panoramic_plot.py panoramic.csv docs/results/panoramic.svg
"""
import csv
import math
import sys

COLOURS = {"consumer 20 mm": "#1f6f8b", "consumer 50 mm": "#b26a00", "HD": "#2e7d4f", "aerial": "#8a3ffc"}
FIGURES = [("focal_px", "focal length"), ("principal_px", "principal point"), ("edge_px", "correction at the edge")]
WIDTH, HEIGHT = 300, 230  # of a panel
LEFT, TOP, RIGHT, BOTTOM = 52, 30, 12, 40


class Panel:
    """One diagram at a place of the page; axes linear or logarithmic."""

    def __init__(self, column, row, title, x_title, x_range, y_range, logarithmic):
        self.x0, self.y0 = 10 + column * WIDTH, 40 + row * HEIGHT
        self.x_range, self.y_range, self.logarithmic = x_range, y_range, logarithmic
        self.svg = [f'<text x="{self.x0 + LEFT}" y="{self.y0 + 20}" class="title">{title} [px]</text>',
                    f'<text x="{self.x(x_range[1])}" y="{self.y0 + HEIGHT - 6}" text-anchor="end">{x_title}</text>']
        self.grid()

    def share(self, value, limits):
        if self.logarithmic:
            return (math.log10(value) - math.log10(limits[0])) / (math.log10(limits[1]) - math.log10(limits[0]))
        return (value - limits[0]) / (limits[1] - limits[0])

    def x(self, value):
        return self.x0 + LEFT + self.share(value, self.x_range) * (WIDTH - LEFT - RIGHT)

    def y(self, value):
        return self.y0 + HEIGHT - BOTTOM - self.share(value, self.y_range) * (HEIGHT - TOP - BOTTOM)

    def ticks(self, limits):
        if self.logarithmic:
            return [10.0 ** e for e in range(round(math.log10(limits[0])), round(math.log10(limits[1])) + 1)]
        step = next(s for s in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20) if (limits[1] - limits[0]) / s <= 6)
        return [step * i for i in range(int(limits[1] / step + 1e-9) + 1)]

    def grid(self):
        bottom, right = self.y(self.y_range[0]), self.x(self.x_range[1])
        for tick in self.ticks(self.x_range):
            self.svg.append(f'<path d="M{self.x(tick):.1f} {bottom:.1f}V{self.y(self.y_range[1]):.1f}" class="grid"/>'
                            f'<text x="{self.x(tick):.1f}" y="{bottom + 16:.1f}" text-anchor="middle">{tick:g}</text>')
        for tick in self.ticks(self.y_range):
            self.svg.append(f'<path d="M{self.x(self.x_range[0]):.1f} {self.y(tick):.1f}H{right:.1f}" class="grid"/>'
                            f'<text x="{self.x0 + LEFT - 6}" y="{self.y(tick) + 4:.1f}" text-anchor="end">{tick:g}</text>')

    def curve(self, points, colour):
        low, high = self.y_range
        inside = [(x, min(max(y, low), high)) for x, y in points]
        path = "L".join(f"{self.x(x):.1f} {self.y(y):.1f}" for x, y in inside)
        self.svg.append(f'<path d="M{path}" fill="none" stroke="{colour}" stroke-width="1.8"/>')
        self.svg += [f'<circle cx="{self.x(x):.1f}" cy="{self.y(y):.1f}" r="2.6" fill="{colour}"/>'
                     for x, y in inside if y < high]


def draw(rows, path):
    def points(camera, kinds, figure):
        levels = sorted({float(r["level"]) for r in rows if r["camera"] == camera and r["kind"] in kinds})
        worst = lambda level: max(float(r[figure]) for r in rows if r["camera"] == camera and r["kind"] in kinds
                                  and float(r["level"]) == level)
        return [(level, worst(level)) for level in levels]

    off_centre = ("off-centre x", "off-centre y", "off-centre z")
    svg = []
    for column, (figure, title) in enumerate(FIGURES):
        highest = max(y for camera in COLOURS for _, y in points(camera, ("noise",), figure))
        top = next(t for t in (0.5, 1, 2, 5, 10, 20, 50) if highest <= t or t == 50)
        panel = Panel(column, 0, "Error of the " + title, "noise [px]", (0, 3), (0, top), False)
        for camera, colour in COLOURS.items():
            panel.curve(points(camera, ("noise",), figure), colour)
        svg += panel.svg
        panel = Panel(column, 1, "Error of the " + title, "centre beside the axis [m], points at 10 m, worst direction",
                      (0.001, 0.1), (0.01, 1000), True)
        for camera, colour in COLOURS.items():
            panel.curve([p for p in points(camera, off_centre, figure) if p[0] > 0], colour)
        svg += panel.svg
    key = "".join(f'<path d="M{62 + 190 * i} 22h24" stroke="{colour}" stroke-width="2"/>'
                  f'<text x="{92 + 190 * i}" y="26">{camera}</text>' for i, (camera, colour) in enumerate(COLOURS.items()))
    with open(path, "w") as file:
        file.write(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {3 * WIDTH + 20} {2 * HEIGHT + 50}">\n'
                   "<style>text{font:11px sans-serif;fill:#5f6c79}.title{fill:#1c2733;font-size:12px}"
                   ".grid{stroke:#dfe5ea;fill:none}</style>\n"
                   f'<rect width="100%" height="100%" fill="#fff"/>\n{key}\n' + "\n".join(svg) + "\n</svg>\n")


def table(rows):
    print("| camera | | focal length | principal point | centre of symmetry | edge |")
    print("|---|---|---|---|---|---|")
    for row in rows:
        if row["kind"] == "noise":
            if float(row["level"]) not in (0, 0.5, 1, 2, 3):
                continue
            what = f'{float(row["level"]):g} px of noise'
        elif float(row["level"]) in (0.001, 0.01, 0.1) and row["kind"][-1] in "xz":
            what = f'{1000 * float(row["level"]):g} mm along {row["kind"][-1]}'
        else:
            continue
        print(f'| {row["camera"]} | {what} | ' + " | ".join(
            f'{float(row[f]):.3g}' for f in ("focal_px", "principal_px", "symmetry_px", "edge_px")) + " |")


def main():
    with open(sys.argv[1]) as file:
        rows = list(csv.DictReader(file))
    draw(rows, sys.argv[2])
    table(rows)


if __name__ == "__main__":
    main()
