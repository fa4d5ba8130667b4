"""Pairs of polygons that a form factor may go wrong for, beside those of
tests/exact/data/form_factors.json: by a fixed seed, in classes. Their exact factors are
computed (tests/exact/contour.py)."""
import numpy as np

from contour import REAL, area_vector, visible_form_factor

EACH = 6  # cases of a class


def turn_of(dice):
    """A random rotation, in long double."""
    w, x, y, z = (lambda q: q / np.sqrt(q @ q))(dice.normal(size=4).astype(REAL))
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def triangle(dice, height=None):
    """From (0,0,0) along +X to about (1,0,0) and up +Y; area at least a tenth of a square."""
    return np.array([(0, 0, 0), (dice.uniform(.6, 1.4), 0, 0),
                     (dice.uniform(-.3, 1.3), dice.uniform(.4, 1.4) if height is None else height, 0)], REAL)


def facing(p, target):
    """p, wound so that its front looks at a point."""
    return p if area_vector(p) @ (target - p.mean(0)) >= 0 else p[::-1]


def hinged(p, q, degrees):
    """q with its first edge on that of p, as if turned from lying on p by some degrees
    about it, front to front."""
    a = np.radians(REAL(degrees))
    q = q * (p[1, 0] / q[1, 0], 1, 1)
    return np.stack([q[:, 0], q[:, 1] * np.cos(a), q[:, 1] * np.sin(a)], 1)[::-1]


def general(dice, i):
    """Anywhere; half of them reach behind the other's plane."""
    p = triangle(dice)
    q = triangle(dice) @ turn_of(dice).T + (*dice.uniform(-1, 1, 2), dice.uniform(.2, 1))
    return p, facing(q, p.mean(0))


def touching(dice, i):
    p = triangle(dice)
    return p, hinged(p, triangle(dice), [1, 20, 60, 100, 160, 179.9][i])


def corner(dice, i):
    """One common vertex."""
    p = triangle(dice)
    q = triangle(dice) @ turn_of(dice).T
    q = q * (1, 1, np.copysign(1, q[:, 2].sum()))
    return p, facing(q, p.mean(0))


def close(dice, i):
    """Parallel, in part one above the other, 10 to 1e-6 of their size apart."""
    return triangle(dice), (triangle(dice) + (dice.uniform(-.2, .2), 0, REAL(10) ** (-i - 1)))[::-1]


def far(dice, i):
    p = triangle(dice)
    way = np.array([*dice.uniform(-1, 1, 2), 1]) * 10 ** (1 + i / 2)
    return p, facing(triangle(dice) @ turn_of(dice).T + way, p.mean(0))


def needle(dice, i):
    """A thin one before another, 1:10 to 1:1e6."""
    p = triangle(dice, 10.0 ** -(i + 1))
    q = triangle(dice) @ turn_of(dice).T + (0, 0, .8)
    return p, facing(q, p.mean(0))


def thin_hinge(dice, i):
    """Two thin ones along a common edge."""
    p = triangle(dice, 10.0 ** -(i / 2 + 1))
    return p, hinged(p, triangle(dice, 10.0 ** -(i / 2 + 1)), dice.uniform(20, 160))


def unequal(dice, i):
    """A small one before a large one, 1:10 to 1:1e6."""
    p = triangle(dice) * 10.0 ** -(i + 1) + (.4, .2, .3)
    return p, triangle(dice)[::-1] * (1, 1, 1) + (0, 0, REAL("0.9"))


def standing(dice, i):
    """The second stands on the first, within its outline."""
    p = np.array([(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)], REAL)
    q = triangle(dice)[:, [0, 2, 1]]
    a = dice.uniform(0, 2 * np.pi)
    c, s = REAL(np.cos(a)), REAL(np.sin(a))
    q = np.stack([c * q[:, 0], s * q[:, 0], q[:, 2]], 1) * REAL(".5") + (1, 1, 0)
    return p, q


def concave(dice, i):
    """An L, and a triangle above it."""
    p = np.array([(0, 0, 0), (3, 0, 0), (3, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)], REAL) / 2
    q = triangle(dice) + (*dice.uniform(-.5, .5, 2), 10.0 ** (-i / 2))
    return (p, q[::-1]) if i % 2 else (q[::-1], p)


CLASSES = (general, touching, corner, close, far, needle, thin_hinge, unequal, standing, concave)


def entries():
    """As those of tests/exact/data/form_factors.json; every scene turned and moved somewhere."""
    for c, make in enumerate(CLASSES):
        for i in range(EACH):
            dice = np.random.default_rng((c, i))
            pair = make(dice, i)
            turn, shift = turn_of(dice), dice.uniform(-5, 5, 3).astype(REAL)
            if make is not concave:  # float32 has its corners as they are only unturned
                pair = [p @ turn.T + shift for p in pair]
            yield {"id": f"{make.__name__}{i + 1}", "emitter": pair[0], "receiver": pair[1],
                   "F12": visible_form_factor(*pair)}
