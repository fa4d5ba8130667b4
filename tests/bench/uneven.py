#!/usr/bin/python3
"""The irradiance of elements against particles, in rooms drawn at random whose lamps stand close to
walls: uneven.py [-n SCENES] [--seed N] [--particles N] [--kinds KIND,...] [--ffcalc OPTIONS]

For each room a line: what is in it, elements, seconds of ffcalc and shoot, the true root mean square
error over elements, what is stated for it and their ratio; the worst mean of a surface, and of
that what the particles may be off by. At the end the distribution of the ratios. Per cent of the
mean irradiance; the noise of the particles is taken out."""
import argparse
import math
import os
import resource
import shlex
import sys
import tempfile
from dataclasses import dataclass

import numpy as np

sys.dont_write_bytecode = True
HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [os.path.join(HERE, "..", "independent"), os.path.join(HERE, "..", "..", "scenes")]
from chain import container, run, table
from gltf_writer import Scene, Shape

KINDS = ("plain", "sheet", "mirror", "pane", "lobe")


def rotation(random):
    """A random turn: of a quaternion uniform on the sphere."""
    w, x, y, z = (q := random.normal(size=4)) / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


class Room:
    """A closed room of random size and colours, a lamp, and what its kind says."""

    def __init__(self, seed, kind):
        self.random = random = np.random.default_rng(seed)
        self.scene, self.names = Scene(f"room {seed}"), []
        self.turn = rotation(random) if random.random() < .7 else np.eye(3)
        self.size = w, h, d = random.uniform((2, 2, 2), (6, 3.5, 6))
        self.walls()
        self.lamp = random.choice(("wall", "cove", "ceiling"))
        self.hang(self.lamp)
        for i in range(random.integers(0, 3)):
            self.box(f"box{i}")
        if kind != "plain":
            self.extra(kind)

    def put(self, name, shape, material):
        shape.positions = [tuple(self.turn @ np.array(p)) for p in shape.positions]
        self.scene.shape(name, shape, material)
        self.names.append(name)

    def diffuse(self, name):
        base = self.random.uniform(.1, .85)
        return self.scene.material(name, {"rho_d": list(base * self.random.uniform(.6, 1, 3))})

    def walls(self):
        w, h, d = self.size
        for name, corners in (("floor", [(0, 0, 0), (0, 0, d), (w, 0, d), (w, 0, 0)]),
                              ("ceiling", [(0, h, 0), (w, h, 0), (w, h, d), (0, h, d)]),
                              ("left", [(0, 0, 0), (0, h, 0), (0, h, d), (0, 0, d)]),
                              ("right", [(w, 0, 0), (w, 0, d), (w, h, d), (w, h, 0)]),
                              ("back", [(0, 0, 0), (w, 0, 0), (w, h, 0), (0, h, 0)]),
                              ("front", [(0, 0, d), (0, h, d), (w, h, d), (w, 0, d)])):
            self.put(name, Shape().polygon(*corners), self.diffuse(name))

    def hang(self, lamp):
        w, h, d = self.size
        glow = self.scene.material("lamp", {"emission_front": [10, 8, 6], "rho_d": .3})
        long, wide = self.random.uniform(.3, .8) * w, self.random.uniform(.1, .3)
        x = (w - long) * self.random.uniform(.2, .8)
        gap, y = self.random.uniform(.03, .3), self.random.uniform(.5, .85) * h
        if lamp == "wall":      # faces down, close to the wall at z = 0
            corners = [(x, y, gap), (x + long, y, gap), (x + long, y, gap + wide), (x, y, gap + wide)]
        elif lamp == "cove":    # faces the wall
            corners = [(x, y, gap), (x, y + wide, gap), (x + long, y + wide, gap), (x + long, y, gap)]
        else:
            z = self.random.uniform(.2, .7) * d
            corners = [(x, h - gap, z), (x + long, h - gap, z), (x + long, h - gap, z + wide),
                       (x, h - gap, z + wide)]
        self.put("lamp", Shape().polygon(*corners), glow)
        if lamp == "cove" and self.random.random() < .5:  # a ledge in front of it
            self.lamp = "ledge"
            self.put("ledge", Shape().box((x - .05, y - .05, gap + .02),
                                          (x + long + .05, y + wide + .05, gap + .04)),
                     self.diffuse("ledge"))

    def box(self, name):
        w, h, d = self.size
        low = self.random.uniform((.1 * w, 0, .4 * d), (.6 * w, 0, .6 * d))
        size = self.random.uniform((.3, .2, .3), (.3 * w, .6 * h, .3 * d))
        low[1] = 0 if self.random.random() < .7 else self.random.uniform(.1, .3) * h
        skip = "y" if low[1] == 0 else ""
        self.put(name, Shape().box(low, low + size, skip), self.diffuse(name))

    def extra(self, kind):
        """A sheet that stands in the room, or a panel close to the left wall."""
        w, h, d = self.size
        random = self.random
        mine = {"sheet": {"rho_d": .3, "tau_d": .5}, "mirror": {"rho_d": .1, "rho_s": .8},
                "pane": {"tau_s": .85},
                "lobe": {"rho_d": .2, "rho_s": .6, "alpha": random.uniform(2, 60)}}[kind]
        two = kind in ("sheet", "pane")
        material = self.scene.material(kind, mine, double_sided=two)
        x = random.uniform(.3, .7) * w if two else .02
        low, high = random.uniform(0, .3, 2), random.uniform(.6, .95, 2)
        y, z, Y, Z = low[0] * h, low[1] * d, high[0] * h, high[1] * d
        self.put(kind, Shape().polygon((x, y, z), (x, Y, z), (x, Y, Z), (x, y, Z)), material)


def seconds(tool, *arguments):
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    run(tool, "-j", 1, *arguments)
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def truth(mesh, particles, seed):
    """Irradiance and its standard error of all element-sides, [sides][bands]; names."""
    rows = table(run("reference", "-q", "--irradiance", "--samples", particles, "--seed", seed,
                     mesh).stdout)
    bands = [k[2:] for k in rows[0] if k.startswith("H_")]
    value = lambda what: np.array([[r[what + b] for b in bands] for r in rows])
    return rows, value("H_"), value("SE_")


def compare(stem, particles, seed):
    rows, h, se = truth(stem + ".mesh", particles, seed)
    _, a = container(stem + ".rad")
    at = np.array([2 * int(r["element"]) + (r["side"] == "back") for r in rows])
    got = sum(a["irradiance_" + part].sum(0) for part in ("direct", "caustic", "indirect"))[at]
    stated = a["irradiance_error"][at]
    if "irradiance_error_uneven" in a:
        stated = np.hypot(stated, a["irradiance_error_uneven"][at])
    area = np.array([r["area"] for r in rows])[:, None]
    rms = lambda x: math.sqrt((area * x * x).mean() / area.mean())
    mean = (area * h).mean() / area.mean()
    error = math.sqrt(max(0, rms(got - h) ** 2 - rms(se) ** 2))
    worst = (0, "", 0)
    names = np.array([r["name"] + " " + r["side"] for r in rows])
    for name in sorted(set(names)):
        k = names == name
        part = area[k] / area[k].sum()
        off = (part * (got - h)[k]).sum(0).mean() / (part * h[k]).sum(0).mean()
        noise = math.sqrt((part ** 2 * se[k] ** 2).sum(0).mean()) / (part * h[k]).sum(0).mean()
        worst = max(worst, (abs(off), name, noise, off))
    return error / mean, rms(stated) / mean, rms(se) / mean, worst, len(a["irradiance_error"]) // 2


@dataclass
class Tried:
    """A room: seconds of ffcalc and shoot; errors over the mean irradiance."""
    seed: int
    kind: str
    lamp: str
    size: str
    elements: int
    ffcalc: float
    shoot: float
    error: float
    stated: float
    noise: float
    worst: float             # of the means of surfaces, with its sign
    worst_name: str
    worst_noise: float

    @property
    def ratio(self):
        return self.error / self.stated

    def line(self):
        p = lambda x: 100 * x
        return (f"{self.seed:3} {self.kind:6} {self.lamp:7} {self.size:7} {self.elements:6} "
                f"{self.ffcalc:5.1f} {self.shoot:4.1f} s  true {p(self.error):5.2f} stated "
                f"{p(self.stated):5.2f} ratio {self.ratio:4.2f} (noise {p(self.noise):4.2f})  worst "
                f"{self.worst_name:14} {p(self.worst):+6.2f} +- {p(self.worst_noise):.2f}")


def try_room(seed, kind, particles, mesh=None, ffcalc=()):
    """mesh: its options, or None: coarse or default sizes, by lot."""
    with tempfile.TemporaryDirectory() as folder:
        stem = os.path.join(folder, "room")
        room = Room(seed, kind)
        room.scene.write(stem + ".gltf")
        coarse = room.random.random() < .5
        size = "given" if mesh is not None else "coarse" if coarse else "default"
        if mesh is None:
            mesh = ["-p", "25%", "-e", "10%"] if coarse else []
        run("mesh", "-q", *mesh, stem + ".gltf", "-o", stem + ".mesh")
        ff = seconds("ffcalc", "-q", *ffcalc, stem + ".mesh", "-o", stem + ".ff")
        shoot = seconds("shoot", "-q", stem + ".mesh", stem + ".ff", "-o", stem + ".rad")
        error, stated, noise, worst, elements = compare(stem, particles, seed)
        return Tried(seed, kind, room.lamp, size, elements, ff, shoot, error, stated, noise,
                     worst[3], worst[1], worst[2])


def rms_of(tried):
    return math.sqrt(np.mean([t.ratio ** 2 for t in tried]))


def quantiles(tried):
    """Least, quarters and largest ratio."""
    return np.quantile([t.ratio for t in tried], (0, .25, .5, .75, 1))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("-n", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--particles", type=int, default=4000000)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--mesh", default=None, help="options of mesh")
    parser.add_argument("--ffcalc", default="", help="options of ffcalc")
    parser.add_argument("--check", action="store_true",
                        help="exit 1 if the root mean square of the ratios is not in .5 to 1.4, or one above 2")
    o = parser.parse_args()
    kinds, tried = o.kinds.split(","), []
    mesh = None if o.mesh is None else shlex.split(o.mesh)
    for i in range(o.n):
        tried.append(try_room(o.seed + i, kinds[i % len(kinds)], o.particles, mesh,
                              shlex.split(o.ffcalc)))
        print(tried[-1].line(), flush=True)
    low, first, median, third, high = quantiles(tried)
    worst = np.abs([t.worst for t in tried])
    print(f"true / stated: rms {rms_of(tried):.2f}, from {low:.2f} by {first:.2f}, {median:.2f}, "
          f"{third:.2f} to {high:.2f}; worst mean of a surface {100 * worst.max():.1f} %, "
          f"median {100 * np.median(worst):.2f} %")
    if o.check:
        sys.exit(0 if .5 < rms_of(tried) < 1.4 and high < 2 else 1)


if __name__ == "__main__":
    main()
