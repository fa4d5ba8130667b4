#!/usr/bin/python3
"""Scenes to measure form factors on: ff_scenes.py NAME OUT.gltf

  cubeK       a closed unit cube seen from inside, K x K square patches a face: cube16,
              cube24; cube58 has 20 184
  room        a closed room, 8 x 8 a face, on whose floor stand two boxes, 4 x 4 on top and
              3 x 3 a side; 8 floor squares that they hide are left out: 480 patches
  room-turned the same room whole, in whose air hang two turned boxes of six faces, 2 x 4
              each: 480 patches
  ball        the same room, 3 x 3 a face and without the boxes, and in it a ball of 320 facets:
              curved patches, and hidden pairs of plane ones
  city100, city370, city2100
              blocks of different heights on a ground in a box of sky: 100, 369 and 2105
              patches. The ground is cut along the blocks' walls; there is none under them

All patches but the ball are one-sided and rectangular, each a node of its own name, and all can be
seen; no two cross. Every scene is closed: whatever leaves a patch arrives at another. The
same bytes every time. Written for `mesh -p inf -e inf`."""
import os
import random
import re
import sys

import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scenes"))
from gltf_writer import Scene, Shape

# A face of the unit cube by its first corner and two sides, in front from inside.
INSIDE = {"x": ((0, 0, 0), (0, 1, 0), (0, 0, 1)), "X": ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
          "y": ((0, 0, 0), (0, 0, 1), (1, 0, 0)), "Y": ((0, 1, 0), (1, 0, 0), (0, 0, 1)),
          "z": ((0, 0, 0), (1, 0, 0), (0, 1, 0)), "Z": ((0, 0, 1), (0, 1, 0), (1, 0, 0))}


class Patches:
    """Collects grids of rectangular patches."""

    def __init__(self, about):
        self.scene = Scene(about)
        self.material = self.scene.material("grey", {"rho_d": .5})

    def patch(self, name, corner, u, v):
        self.scene.rectangle(name, (corner, corner + u, corner + u + v, corner + v), self.material)

    def grid(self, name, corner, u, v, across, along, hidden=lambda i, j: False):
        """across x along patches name[i,j] over a face, without the hidden ones."""
        corner, u, v = (np.array(a, float) for a in (corner, u, v))
        for i in range(across):
            for j in range(along):
                if not hidden(i, j):
                    self.patch(f"{name}[{i},{j}]", corner + u * (i / across) + v * (j / along),
                               u / across, v / along)

    def box(self, name, low, size, counts, inside, degrees=0):
        """A box seen from inside or outside; counts: {face of xXyYzZ: (patches along the
        first, the second of its axes in alphabetic order)}; turned about its vertical axis (Z)."""
        low, size = np.array(low, float), np.array(size, float)
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) if degrees else np.eye(3)
        middle = low + size / 2
        for face, (first, second) in counts.items():
            corner, u, v = (np.array(a, float) for a in INSIDE[face])
            if np.argmax(u) > np.argmax(v):
                first, second = second, first
            if not inside:
                u, v, first, second = v, u, second, first
            corner = middle + turn @ (low + corner * size - middle)
            self.grid(f"{name}.{face}", corner, turn @ (u * size), turn @ (v * size), first, second)

    def write(self, path):
        self.scene.write(path)
        return len(self.scene.root["nodes"])


def cube(k):
    p = Patches(f"cube, {k} x {k} patches a face")
    p.box("cube", (0, 0, 0), (1, 1, 1), {face: (k, k) for face in INSIDE}, True)
    return p


def room():
    p = Patches("room with two boxes on the floor")
    cells, size = 8, np.array((4.0, 4.0, 3.0))
    p.box("room", (0, 0, 0), size, {face: (cells, cells) for face in "xXyYZ"}, True)
    stands = lambda i, j: (i in (1, 2) and j in (4, 5)) or (i in (5, 6) and j in (2, 3))
    p.grid("room.z", (0, 0, 0), (4, 0, 0), (0, 4, 0), cells, cells, stands)
    counts = {**{face: (3, 3) for face in "xXyY"}, "Z": (4, 4)}
    p.box("tall", (.5, 2, 0), (1, 1, 1.8), counts, False)
    p.box("low", (2.5, 1, 0), (1, 1, .9), counts, False)
    return p


def room_turned():
    p = Patches("room with two boxes in the air")
    p.box("room", (0, 0, 0), (4, 4, 3), {face: (8, 8) for face in INSIDE}, True)
    counts = {face: (2, 4) for face in INSIDE}
    p.box("tall", (.6, 1.9, .3), (1, 1, 1.7), counts, False, 17)
    p.box("low", (2.3, .9, .2), (1.1, .9, .8), counts, False, -23)
    return p


def ball():
    p = Patches("room with a ball in it")
    p.box("room", (0, 0, 0), (4, 4, 3), {face: (3, 3) for face in INSIDE}, True)
    p.scene.shape("ball", Shape().sphere((2.2, 1.7, 1.4), .8, 2), p.material)
    return p


def city(blocks, columns, storeys, roof, sky_walls, sky_top, seed=1):
    """blocks x blocks of them, walls columns x storeys patches, roofs roof x roof."""
    p, dice = Patches(f"city of {blocks} x {blocks} blocks"), random.Random(seed)
    lines = [[0.0], [0.0]]
    for line in lines:
        for i in range(2 * blocks + 1):  # street, block, street, ..., street
            line.append(line[-1] + (dice.uniform(12, 30) if i % 2 else dice.uniform(8, 20)))
    x, y = lines
    for i in range(2 * blocks + 1):
        for j in range(2 * blocks + 1):
            corner, wide, deep = np.array((x[i], y[j], 0.0)), x[i + 1] - x[i], y[j + 1] - y[j]
            if i % 2 and j % 2:
                counts = {**{face: (columns, storeys) for face in "xXyY"}, "Z": (roof, roof)}
                p.box(f"block{i // 2},{j // 2}", corner, (wide, deep, dice.uniform(6, 60)), counts, False)
            else:
                p.patch(f"ground[{i},{j}]", corner, np.array((wide, 0, 0)), np.array((0, deep, 0)))
    counts = {**{face: sky_walls for face in "xXyY"}, "Z": sky_top}
    p.box("sky", (0, 0, 0), (x[-1], y[-1], 100), counts, True)
    return p


SCENES = {"room": room, "room-turned": room_turned, "ball": ball,
          "city100": lambda: city(3, 1, 1, 1, (3, 1), (3, 1)),
          "city370": lambda: city(5, 1, 2, 1, (4, 2), (4, 4)),
          "city2100": lambda: city(10, 2, 2, 1, (4, 3), (4, 4))}


def make(name):
    """The Patches of a scene, or None."""
    k = re.fullmatch(r"cube([1-9]\d{0,2})", name)
    return cube(int(k[1])) if k else SCENES[name]() if name in SCENES else None


def main():
    patches = make(sys.argv[1]) if len(sys.argv) == 3 else None
    if not patches:
        sys.exit("usage: ff_scenes.py cubeK|" + "|".join(SCENES) + " OUT.gltf")
    print(patches.write(sys.argv[2]), "patches")


if __name__ == "__main__":
    main()
