"""Form factors between two plane polygons with nothing between them, by Stokes' double
contour integral (E. M. Sparrow 1963):

  F12 = |sum over edges e1, e2 of (d1 . d2) int int ln r ds1 ds2| / (2 pi A1)

The inner integral is analytic, the outer one tanh-sinh between the points where it is
singular or nearly so. In long double: 1e-16 absolute or better, touching edges included. The
contours of polygons far apart nearly cancel: those take Gauss's rule over both areas, good to
1e-14 of the factor."""
import numpy as np

REAL = np.longdouble
PI = REAL("3.14159265358979323846264338327950288")
STEP = 1 / 64
FAR = 8        # times the larger radius: 12 points a side are exact to rounding
GAUSS = 12


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


def _points(polygon):
    """Points and weights along the normal [m,3] that integrate over a polygon."""
    x, w = (np.asarray(a, REAL) for a in np.polynomial.legendre.leggauss(GAUSS))
    s, t = np.meshgrid((x + 1) / 2, (x + 1) / 2, indexing="ij")
    weight = (np.outer(w, w) / 4 * s).ravel()[:, None]
    at, normal = [], []
    for a, b in zip(polygon[1:-1] - polygon[0], polygon[2:] - polygon[0]):
        at.append(polygon[0] + (s * (1 - t)).ravel()[:, None] * a + (s * t).ravel()[:, None] * b)
        normal.append(weight * np.cross(a, b))
    return np.concatenate(at), np.concatenate(normal)


def _far_form_factor(emitter, receiver):
    (x, n), (y, m) = _points(emitter), _points(receiver)
    r = y[None] - x[:, None]
    kernel = _dot(r, n[:, None]) * _dot(r, m[None]) / _dot(r, r) ** 2
    return abs(kernel.sum()) / (PI * area(emitter))


def _radius(polygon):
    return _length(polygon - polygon.mean(0)).max()


def form_factor(emitter, receiver):
    """F from the first polygon to the second, vertices [n,3] of any float type, which see
    all of each other's fronts."""
    emitter, receiver = np.asarray(emitter, REAL), np.asarray(receiver, REAL)
    apart = _length(receiver.mean(0) - emitter.mean(0))
    if apart > FAR * max(_radius(emitter), _radius(receiver)):
        return _far_form_factor(emitter, receiver)
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


def _in_front(polygon, other):
    """The part of a convex polygon in front of the other's plane: vertices, or none."""
    n = area_vector(other)
    height = (polygon - other[0]) @ n / _length(n)
    height[abs(height) < 1e-15 * abs(polygon - polygon[0]).max()] = 0
    if (height >= 0).all():
        return polygon
    kept = []
    for p, a, q, b in zip(polygon, height, np.roll(polygon, -1, 0), np.roll(height, -1)):
        if a >= 0:
            kept.append(p)
        if a * b < 0:
            kept.append(p + (q - p) * (a / (a - b)))
    return np.array(kept) if len(kept) > 2 else None


def visible_form_factor(emitter, receiver):
    """The same where either may reach behind the other's plane; convex if it does."""
    p, q = np.asarray(emitter, REAL), np.asarray(receiver, REAL)
    a, b = _in_front(p, q), _in_front(q, p)
    if a is None or b is None:
        return REAL(0)
    return form_factor(a, b) * area(a) / area(p)
