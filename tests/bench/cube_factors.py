"""Exact form factors between the square patches of a cube seen from inside: corner sums
of parallel and perpendicular rectangles in general position (Howell's catalogue, C-13 and
C-15; Ehlert & Smith 1993), in long double. Lengths are in patches, so all differences are
whole numbers and the sums are differences of one table. Good to 2e-10 of the smallest factor
for K = 24, to 1e-16 absolute."""
import os
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "exact"))
from contour import PI, REAL


def parallel(k):
    """[K-1+di, K-1+dj] of patches opposite, di and dj apart."""
    u = np.arange(-k, k + 1, dtype=REAL)
    v, z = u[None], REAL(k)
    u = u[:, None]
    p, q = np.sqrt(u * u + z * z), np.sqrt(v * v + z * z)
    b = v * p * np.arctan(v / p) + u * q * np.arctan(u / q) - z * z / 2 * np.log(u * u + v * v + z * z)
    return np.diff(np.diff(b, 2, 0), 2, 1) / (2 * PI)


def perpendicular(k):
    """[i, m, K-1+dj] of patches i and m from the common edge, dj apart along it."""
    x = np.arange(k + 1, dtype=REAL)
    c2 = (x * x)[:, None, None] + (x * x)[None, :, None]
    d, c = np.arange(-k, k + 1, dtype=REAL), np.sqrt(c2)
    r2 = c2 + d * d
    g = d * c * np.arctan2(d, c) - (c2 - d * d) / 4 * np.log(np.where(r2 > 0, r2, 1))
    return abs(np.diff(np.diff(np.diff(g, 2, 2), 1, 0), 1, 1)) / (2 * PI)


def cube_factors(k, corner):
    """F [n,n] between patches of a unit cube, K x K a face; corner [n,4,3]: vertices."""
    low = np.rint(k * corner.min(1)).astype(int)
    axis = np.argmin(np.ptp(corner, 1), 1)
    far = low[np.arange(len(low)), axis] > 0
    opposite, beside, f = parallel(k), perpendicular(k), np.zeros((len(low), len(low)))
    faces = [np.flatnonzero((axis == a) & (far == side)) for a in range(3) for side in (0, 1)]
    for one in faces:
        for other in faces:
            a, b = axis[one[0]], axis[other[0]]
            from_, to = low[one][:, None], low[other][None]
            if a == b and one is not other:
                along = [c for c in range(3) if c != a]
                f[np.ix_(one, other)] = opposite[tuple(from_[..., c] - to[..., c] + k - 1 for c in along)]
            elif a != b:
                inwards = lambda cell, face: k - 1 - cell if far[face[0]] else cell
                f[np.ix_(one, other)] = beside[inwards(from_[..., b], other), inwards(to[..., a], one),
                                               from_[..., 3 - a - b] - to[..., 3 - a - b] + k - 1]
    return f
