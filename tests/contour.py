"""Form factors between two plane polygons that see all of each other's fronts, by
Stokes' double contour integral (E. M. Sparrow 1963):

  F12 = |sum over edges e1, e2 of (d1 . d2) int int ln r ds1 ds2| / (2 pi A1)

The inner integral is analytic, the outer one tanh-sinh between the points where it is
singular or nearly so. In long double: 1e-15 or better of 1, touching edges included."""
import numpy as np

REAL = np.longdouble
PI = REAL("3.14159265358979323846264338327950288")
STEP = 1 / 64


def _tanh_sinh():
    """Fractions of an interval and weights that sum to 1."""
    t = np.arange(-4, 4 + STEP / 2, STEP, dtype=REAL)
    s = 1 / (1 + np.exp(-PI * np.sinh(t)))
    w = STEP * PI * np.cosh(t) * s * (1 - s)
    return s, w / w.sum()


NODE, WEIGHT = _tanh_sinh()


def _dot(a, b):
    return (a * b).sum(-1)


def _length(a):
    return np.sqrt(_dot(a, a))


def _unit(a):
    length = _length(a)
    return a / length[..., None], length


def area_vector(polygon):
    """The area along the normal, for vertices [n,3]."""
    p = np.asarray(polygon, REAL)
    p = p - p[0]
    return np.cross(p[1:-1], p[2:]).sum(0) / 2


def area(polygon):
    return _length(area_vector(polygon))


def _antiderivative(y, h):
    """Of ln sqrt(y^2 + h^2) over y."""
    square = y * y + h * h
    return y * np.log(np.where(square > 0, square, 1)) / 2 - y + h * np.arctan2(y, h)


def _breaks(p, d, length, q, e, reach):
    """Where on the edge p + s d the inner integral over q + t e is not smooth: abreast
    of the ends of the other edge, and nearest to its line; ascending, with both ends."""
    w, along = q - p, _dot(d, e)
    slant = 1 - along * along
    nearest = (_dot(w, d) - along * _dot(w, e)) / np.where(slant > 1e-30, slant, 1)
    s = [_dot(w, d), _dot(w + reach[..., None] * e, d), nearest]
    s = [np.clip(x, 0, length) for x in s] + [0 * along, length + 0 * along]
    return np.sort(np.stack(s), 0)


def form_factor(emitter, receiver):
    """F from the first polygon to the second; vertices [n,3] of any float type."""
    emitter, receiver = np.asarray(emitter, REAL), np.asarray(receiver, REAL)
    origin = emitter[0]
    p, q = (emitter - origin)[:, None], (receiver - origin)[None]
    d, length = _unit(np.roll(p, -1, 0) - p)
    e, reach = _unit(np.roll(q, -1, 1) - q)
    at = _breaks(p, d, length, q, e, reach)
    total = REAL(0)
    for low, high in zip(at, at[1:]):
        s = low[..., None] + (high - low)[..., None] * NODE
        x = p[:, :, None] + s[..., None] * d[:, :, None] - q[:, :, None]
        t = _dot(x, e[:, :, None])
        h = _length(np.cross(x, e[:, :, None]))
        inner = _antiderivative(reach[..., None] - t, h) - _antiderivative(-t, h)
        total += (_dot(d, e) * (high - low) * (inner * WEIGHT).sum(-1)).sum()
    return abs(total) / (2 * PI * area(emitter))
