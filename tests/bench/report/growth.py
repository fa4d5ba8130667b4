"""What the stages cost as patches, elements, triangles and lobes grow: generated scenes,
processor seconds, and the exponents that fit them."""
import math
import os

import numpy as np

from gltf_writer import Scene as Gltf
from gltf_writer import Shape
from measure import fresh, ran
from page import Table, Title, Words
from plot import Curve, Panel, draw
from speed import seconds

STAGES = ["mesh", "ffcalc", "shoot", "trace"]
LEAST = .02  # seconds: less is mostly the start of a program


def room(level=0, gloss=0):
    """A closed room of 4 x 3 x 4 m with a lamp and a table; a ball of 20 4^level triangles,
    `gloss` of 16 stripes of the floor in a lobe."""
    s = Gltf("room")
    white, grey = s.material("white", {"rho_d": .7}), s.material("grey", {"rho_d": .4})
    shiny = s.material("shiny", {"rho_d": .3, "rho_s": .3, "alpha": 30})
    lamp = s.material("lamp", {"rho_d": .7}, glow=(10, 10, 10))
    s.shape("walls", Shape().polygon((0, 0, 0), (4, 0, 0), (4, 3, 0), (0, 3, 0))
            .polygon((4, 0, 4), (0, 0, 4), (0, 3, 4), (4, 3, 4))
            .polygon((0, 0, 4), (0, 0, 0), (0, 3, 0), (0, 3, 4))
            .polygon((4, 0, 0), (4, 0, 4), (4, 3, 4), (4, 3, 0))
            .polygon((0, 3, 0), (4, 3, 0), (4, 3, 4), (0, 3, 4)), white)
    for i in range(16):
        z = i / 4
        stripe = Shape().polygon((0, 0, z + .25), (4, 0, z + .25), (4, 0, z), (0, 0, z))
        s.shape(f"stripe {i}", stripe, shiny if i < gloss else grey)
    s.shape("lamp", Shape().polygon((1.5, 2.9, 1.5), (2.5, 2.9, 1.5), (2.5, 2.9, 2.5),
                                    (1.5, 2.9, 2.5)), lamp)
    s.shape("table", Shape().box((.5, .7, .5), (1.7, .75, 1.7)), grey)
    if level:
        s.shape("ball", Shape().sphere((2.8, .8, 2.6), .6, level), white)
    s.camera("view", (3.8, 1.8, 3.8), (1.2, .8, 1.2), 60)
    return s


class Sweep:
    """name: what grows, as `counted` in what a stage prints: (stage, pattern); steps:
    (arguments of room(), options of mesh)."""

    def __init__(self, name, counted, about, steps, ffcalc=()):
        self.name, self.counted, self.about, self.steps = name, counted, about, steps
        self.ffcalc = ffcalc


def sizes(patch, element):
    return ["-p", f"{100 * patch:g}%", "-e", f"{100 * element:g}%"]


SWEEPS = [
    Sweep("patches", (0, r"^patches +(\d+)"), "patches grow smaller, elements stay",
          [({}, sizes(p, .0175)) for p in (.1, .07, .05, .035, .025, .0175)]),
    Sweep("elements", (0, r"^elements +(\d+)"), "elements grow smaller, patches stay",
          [({}, sizes(.1, e)) for e in (.05, .035, .025, .0175, .0125, .00875)]),
    Sweep("triangles", (0, r"^triangles +(\d+)"), "a ball in ever more triangles",
          [({"level": n}, sizes(.1, .1)) for n in (2, 3, 4, 5, 6)]),
    Sweep("lobes", (1, r"^rows .* (\d+) reflected"), "more of the floor is glossy; the number of "
          "lobes, one for each directional patch and source; `ffcalc -n 256`",
          [({"gloss": n}, sizes(.05, .05)) for n in (1, 2, 4, 8, 16)], ("-n", 256))]


class Point:
    """A scene run through the chain: the count that grows and the stages' seconds."""

    def __init__(self, work, sweep, how, options):
        path = lambda extension: os.path.join(work, "growth." + extension)
        room(**how).write(path("gltf"))
        runs = [ran("mesh", *options, path("gltf"), "-o", fresh(path("mesh"))),
                ran("ffcalc", *sweep.ffcalc, path("mesh"), "-o", fresh(path("ff"))),
                ran("shoot", path("mesh"), path("ff"), "-o", fresh(path("rad"))),
                ran("trace", path("rad"), "-c", "view", "-s", "160x160", "--samples", 1, "-o",
                    fresh(path("exr")))]
        stage, pattern = sweep.counted
        self.count = runs[stage].said(pattern)
        self.cpu = [r.cpu for r in runs]
        self.megabytes = os.path.getsize(path("ff")) / 1e6


class Fit:
    """y = c x^exponent by least squares of logarithms, and the exponent's standard error."""

    def __init__(self, x, y, least):
        pairs = [(a, b) for a, b in zip(x, y) if b >= least]
        self.exponent = self.error = None
        if len(pairs) < 3:
            return
        lx, ly = np.log(np.array(pairs)).T
        design = np.stack([np.ones_like(lx), lx], 1)
        (_, self.exponent), *_ = np.linalg.lstsq(design, ly, rcond=None)
        left = ly - design @ np.linalg.lstsq(design, ly, rcond=None)[0]
        spread = (left ** 2).sum() / (len(pairs) - 2)
        self.error = math.sqrt(spread / ((lx - lx.mean()) ** 2).sum())

    def text(self):
        return "–" if self.exponent is None else f"{self.exponent:.2f} ± {self.error:.2f}"


def section(run):
    rows, panels, fits = [], [], []
    work = run.directory("growth")
    for sweep in run.told("growth", SWEEPS):
        steps = sweep.steps[:run.plan.steps]
        points = [Point(work, sweep, *step) for step in steps]
        x = [p.count for p in points]
        for p in points:
            rows.append([sweep.name, f"{p.count:.0f}", *map(seconds, p.cpu), f"{p.megabytes:.1f}"])
        fits.append([sweep.name, sweep.about,
                     *(Fit(x, [p.cpu[i] for p in points], LEAST).text() for i in range(len(STAGES))),
                     Fit(x, [p.megabytes for p in points], 0).text()])
        panels.append(Panel(sweep.about.split(";")[0], sweep.name, "processor seconds",
                            [Curve(stage, [(p.count, p.cpu[i]) for p in points])
                             for i, stage in enumerate(STAGES)]))
    yield Title("Cost as scenes grow")
    yield Words(f"""A room of 4 x 3 x 4 m at default settings but for the sizes of patches and
        elements; processor seconds of all threads, one run each; a view of 160x160. The
        exponents are fitted to points of at least {LEAST} s.""")
    yield draw(run.out, "growth", "processor seconds of the stages against the number of patches, "
               "elements, triangles and lobes", panels)
    yield Table("Exponents: seconds grow as the number to this power",
                ["grows", "how", *STAGES, "bytes of .ff"], fits, left=2)
    yield Table("Seconds", ["grows", "number", *STAGES, "MB of .ff"], rows)
