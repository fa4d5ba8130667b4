"""A scene with what its pictures and solutions are judged by: pictures and particles of
`reference`, two independent runs b, b' of each. The mean of (a - b) (a - b') has none of
their variance in it, whatever that is.

Pictures are of pixel centres, and judged at every third pixel each way: nine times the paths
in each for the same time, which costs less accuracy than it gains."""
import csv
import functools
import io
import json
import math
import os
import shutil
import sys

import numpy as np

from chain import TOP, Failed, picture, run
from measure import fresh, ran

VIEWS = {"cornell": ("classic", 256, 256), "two-pass": ("overview", 320, 240),
         "clutter": ("overview", 320, 240)}


class Lattice:
    """Every third pixel of a picture, as a picture of its own with the same centres."""
    STEP = 3

    def __init__(self, width, height):
        self.height, self.whole = height, width * height
        self.places = [self.axis(n) for n in (width, height)]
        self.size = "{}x{}".format(*(count for count, _ in self.places))
        self.pixels = self.places[0][0] * self.places[1][0]

    @classmethod
    def axis(cls, n):
        """How many of n pixels, symmetric about the middle, and the first of them."""
        count = n // cls.STEP
        count -= (n - count) % 2
        return count, (n - cls.STEP * count) // 2 + cls.STEP // 2

    def pick(self, plane):
        (across, x), (down, y) = self.places
        return plane[y::self.STEP, x::self.STEP][:down, :across]

    def narrowed(self, yfov):
        return 2 * math.atan(math.tan(yfov / 2) * self.STEP * self.places[1][0] / self.height)


QUANTILES = (95, 99)


class Errors:
    """Of a picture, all relative: rmse, bias of the mean, percentiles of pixels by QUANTILES
    (lengths over R, G, B, as exrcmp has them), and what these are of the yardstick itself.

    Noise widens a percentile: its square by about the variance. Half the paths have twice
    that, so that it can be taken off: what is found with half is as much beyond what is found
    with all as this is beyond the truth, in squares."""

    def __init__(self, a, b, c):
        self.rmse, self.bias = off(a, b, c), float(np.mean(a) / np.mean((b + c) / 2) - 1)
        mean = (b + c) / 2
        tail = lambda x, q: float(np.percentile(length(x) / length(mean), q))
        square = lambda x, q: tail(x, q) ** 2
        self.tail = {q: math.sqrt(max(0, 2 * square(a - mean, q) -
                                      (square(a - b, q) + square(a - c, q)) / 2)) for q in QUANTILES}
        self.noise = {q: tail((b - c) / 2, q) for q in QUANTILES}


def length(colours):
    """Of each pixel's colour."""
    return np.maximum(np.sqrt((colours ** 2).sum(0)), 1e-30)


def off(a, b, c, weight=None):
    """Relative rmse of a against b and c, without their noise."""
    weight = np.ones(a.shape[1]) if weight is None else weight
    square, mean = ((x * weight).mean() / weight.mean() for x in ((a - b) * (a - c), (b + c) / 2))
    return math.sqrt(max(0, square)) / mean


class Ladder:
    """What `reference` reaches in how many processor seconds, at growing sample counts."""

    def __init__(self):
        self.points = []

    def add(self, cpu, error):
        if error:
            self.points.append((cpu, error))

    def at(self, cpu):
        """Its error in as much time: on the line between two points, and beyond them by the
        square root."""
        if not self.points or cpu <= 0:
            return None
        x, y = np.log(self.points).T
        t = math.log(cpu)
        beyond = t - min(max(t, x[0]), x[-1])
        return math.exp(np.interp(t, x, y) - beyond / 2)


def irradiance(text):
    """Of the lines of `inspect --csv` or `reference --irradiance`, much faster than table():
    element-sides, areas, H [side, band]."""
    lines = csv.reader(io.StringIO(text))
    at = {name: i for i, name in enumerate(next(lines))}
    element, side, area, *h = (at[n] for n in ("element", "side", "area", "H_0", "H_1", "H_2"))
    rows = [(r[element] + r[side][0], r[area], *(r[k] for k in h)) for r in lines]
    numbers = np.array([r[1:] for r in rows], float)
    return [r[0] for r in rows], numbers[:, 0], numbers[:, 1:]


class Scene:
    """A scene in a directory of its own. samples: paths a pixel and particles of the
    yardsticks, each in two halves, which commands() makes. Those found in the directory
    are taken."""

    def __init__(self, name, work, samples, particles):
        self.name, self.work = name, os.path.join(work, name)
        self.samples, self.particles = samples, particles
        self.camera, self.width, self.height = VIEWS[name]
        self.lattice = Lattice(self.width, self.height)
        os.makedirs(self.work, exist_ok=True)
        self.gltf = self.path("gltf")
        self.copy_scene()
        with open(self.gltf) as f:
            root = json.load(f)
        self.views = sum("camera" in node for node in root["nodes"])
        for camera in root["cameras"]:
            lens = camera["perspective"]
            lens["yfov"] = self.lattice.narrowed(lens["yfov"])
        with open(self.path("lattice.gltf"), "w") as f:
            json.dump(root, f)
        run("mesh", self.gltf, "-o", self.path("default.mesh"))
        run("mesh", self.path("lattice.gltf"), "-o", self.path("lattice.mesh"))
        self.ladders, self.keep = {}, None

    def copy_scene(self):
        kept = os.path.join(TOP, "scenes", self.name + ".gltf")
        if os.path.exists(kept):
            shutil.copy(kept, self.gltf)
            return
        scenes = os.path.join(TOP, "scenes")
        words = [sys.executable, os.path.join(scenes, f"make_{self.name}.py"), self.gltf]
        if os.spawnv(os.P_WAIT, words[0], words):
            raise Failed(f"make_{self.name}.py could not write {self.gltf}")

    def path(self, extension):
        return os.path.join(self.work, f"{self.name}.{extension}")

    def size(self):
        return f"{self.width}x{self.height}"

    # ---- what `reference` makes ----

    def drawn(self, samples, seed, path):
        """Arguments of `reference` for a picture at the lattice's pixels."""
        return ("reference", self.path("lattice.mesh"), "-c", self.camera, "-s", self.lattice.size,
                "--centre", "--seed", seed, "--samples", samples, "--compression", "none", "-o", path)

    def counted(self, particles, seed, path):
        return ("reference", self.path("default.mesh"), "--irradiance", "--seed", seed, "--samples",
                particles, "-o", path)

    def yardsticks(self):
        """{file: how it is made}, pictures first."""
        kinds = ((self.drawn, self.samples, "exr"), (self.counted, self.particles, "csv"))
        paths = [(make, count // 2, seed, self.path(f"{count // 2}.{seed}.{extension}"))
                 for make, count, extension in kinds for seed in (1, 2) if count]
        return {path: make(count, seed, path) for make, count, seed, path in paths}

    def commands(self):
        """Of the yardsticks that are not there yet, by file."""
        return {path: words for path, words in self.yardsticks().items() if not os.path.exists(path)}

    @functools.cached_property
    def exact(self):
        """Two independent pictures [band, y, x]."""
        return [self.colours(path) for path in self.yardsticks() if path.endswith("exr")]

    @functools.cached_property
    def lit(self):
        """Two independent fields of irradiance."""
        return [self.field(path) for path in self.yardsticks() if path.endswith("csv")]

    @staticmethod
    def colours(path):
        planes = picture(path)
        return np.array([planes[c] for c in "RGB"])

    @staticmethod
    def field(path):
        with open(path) as f:
            return irradiance(f.read())

    def picture_ladder(self, counts):
        """Of `reference`, as if it drew the whole picture."""
        def climb():
            for samples in counts:
                out = fresh(self.path("ladder.exr"))
                took = ran(*self.drawn(samples, 100 + samples, out))
                yield (took.cpu * self.lattice.whole / self.lattice.pixels,
                       off(*(x[:, self.seen()] for x in (self.colours(out), *self.exact))))
        return self.ladder("picture", climb)

    def irradiance_ladder(self, counts):
        def climb():
            for particles in counts:
                out = fresh(self.path("ladder.csv"))
                took = ran(*self.counted(particles, 100 + particles, out))
                yield took.cpu, self.irradiance_error(self.field(out))
        return self.ladder("irradiance", climb)

    def ladder(self, kind, climb):
        """Measured once."""
        if kind not in self.ladders:
            self.ladders[kind] = Ladder()
            for point in climb():
                self.ladders[kind].add(*point)
        return self.ladders[kind]

    # ---- what is judged ----

    def seen(self):
        """The pixels that see neither a lamp nor nothing; from any solution."""
        if self.keep is None:
            out = fresh(self.path("seen.exr"))
            run("trace", self.path("rad"), "-c", self.camera, "-s", self.size(), "-d", "mesh",
                "--samples", 1, "--layers", "emission,Z", "--compression", "none", "-o", out)
            planes = {name: self.lattice.pick(p) for name, p in picture(out).items()}
            lamp = sum(planes["emission." + c] for c in "RGB") > 0
            self.keep = ~lamp & np.isfinite(planes["Z"])
        return self.keep

    def picture_errors(self, path):
        planes = picture(path)
        a = np.array([self.lattice.pick(planes[c]) for c in "RGB"])
        return Errors(*(x[:, self.seen()] for x in (a, *self.exact)))

    def irradiance_error(self, field):
        """Of element-sides, weighted by area; None if they are not those of the yardstick."""
        if not self.lit or field[0] != self.lit[0][0]:
            return None
        return off(*(h.T for _, _, h in (field, *self.lit)), field[1])
