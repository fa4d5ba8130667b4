"""Plane polygons as glTF patches whose vertices are right to float64.

glTF positions are float32, node matrices are not: a polygon becomes positions that
float32 holds exactly under a matrix that says where they are. A triangle or
parallelogram is a unit one; any polygon of short decimals is integers under a scale.
What is neither (a 32-gon) is rounded to float32 about its first vertex."""
import os
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scenes"))
from contour import REAL, area_vector
from gltf_writer import Scene, Shape

EXACT = 4e-16  # of the polygon's size: what rounding to float64 leaves
DIGITS = 7     # most decimals of the integers that a scale is tried for


def polygon(vertices):
    """[n,3] in long double, from decimal strings or numbers."""
    return np.array([[REAL(x) for x in v] for v in vertices])


def frames(p):
    """Matrices whose columns polygon p may have float32 coordinates in, best last."""
    p = p - p[0]
    n = area_vector(p)
    n = n / np.sqrt(n @ n)
    u = p[1] / np.sqrt(p[1] @ p[1])
    yield np.stack([u, np.cross(n, u), n], 1)
    for digits in range(DIGITS, -1, -1):
        yield np.eye(3, dtype=REAL) / REAL(10) ** digits
    yield np.stack([p[1], p[-1], n], 1)


def solve(matrix, vectors):
    """Coordinates of vectors [n,3] in the columns, by Cramer's rule in long double."""
    a, b, c = matrix.T
    volume = a @ np.cross(b, c)
    return np.stack([vectors @ np.cross(b, c), vectors @ np.cross(c, a), vectors @ np.cross(a, b)],
                    1) / volume


def place(p):
    """float32 positions [n,3], the frame [3,3] about p[0] they are meant in, and
    whether the two together are p."""
    best = None
    for frame in frames(p):
        x = solve(frame, p - p[0])
        x = np.where(abs(x - np.round(x)) < 1e-9, np.round(x), x).astype(np.float32)
        off = abs(x.astype(REAL) @ frame.T - (p - p[0])).max() / abs(p - p[0]).max()
        if best is None or off <= max(best[2], EXACT):
            best = x, frame, off
    return best[0], best[1], bool(best[2] <= EXACT)


class Placement:
    """x -> scale * turn x + shift, in long double."""

    def __init__(self, scale=1, turn=np.eye(3), shift=(0, 0, 0)):
        self.linear = REAL(scale) * np.asarray(turn, REAL)
        self.shift = np.asarray(shift, REAL)


def add_polygon(scene, name, p, material, where):
    """Adds polygon p, moved, as a node; False if its vertices had to be rounded."""
    x, frame, exact = place(p)
    columns = where.linear @ frame
    origin = where.linear @ p[0] + where.shift
    matrix = np.zeros((4, 4))
    matrix[:3, :3], matrix[:3, 3], matrix[3, 3] = columns, origin, 1
    mesh = scene.mesh(name, Shape().polygon(*x.tolist()), material)
    scene.node(name, mesh=mesh, matrix=matrix.T.ravel().tolist())
    return exact


def write(path, emitter, receiver, occluders=(), where=Placement(), flip=False):
    """A scene of two diffuse patches "emitter" and "receiver", which see each other's
    fronts, and black occluders. flip: every winding reversed and the
    sides of the two swapped. True if all vertices are exact."""
    scene = Scene("form factor")
    side, black = {"rho_d": .5}, scene.material("black", {}, colour=(0, 0, 0), double_sided=flip)
    if flip:
        grey = scene.material("grey", {"rho_d": 0, "back": side}, colour=(.5, .5, .5),
                              double_sided=True)
    else:
        grey = scene.material("grey", side)
    exact = True
    parts = [("emitter", emitter, grey), ("receiver", receiver, grey)]
    parts += [(f"occluder{i}", p, black) for i, p in enumerate(occluders)]
    for name, p, material in parts:
        exact &= add_polygon(scene, name, p[::-1] if flip else p, material, where)
    scene.write(path)
    return exact
