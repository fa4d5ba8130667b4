#!/usr/bin/python3
"""Writes `clutter`, a furnished room of about 100 000 triangles, the same bytes at
every run: make_clutter.py OUT.gltf (or .glb)"""
import math
import random
import sys

sys.dont_write_bytecode = True
from gltf_writer import Scene, Shape

X, Y, Z = 8.0, 3.0, 6.0  # the room, metres; Y is up


def power(x, e):
    return math.copysign(abs(x) ** e, x) if abs(x) > 1e-12 else 0.0


def cushion(low, high, columns, rows, e=.35):
    """A superellipsoid filling the box: e = 1 an ellipsoid, towards 0 a box."""
    centre = [(a + b) / 2 for a, b in zip(low, high)]
    half = [(b - a) / 2 for a, b in zip(low, high)]

    def angles(u, v):
        return -2 * math.pi * u, math.pi * (v - .5)

    def point(u, v):
        o, h = angles(u, v)
        r = power(math.cos(h), e) if 0 < v < 1 else 0.0
        q = (r * power(math.cos(o), e), power(math.sin(h), e), r * power(math.sin(o), e))
        return tuple(c + s * t for c, s, t in zip(centre, half, q))

    def normal(u, v):
        o, h = angles(u, v)
        r = power(math.cos(h), 2 - e) if 0 < v < 1 else 0.0
        return (r * power(math.cos(o), 2 - e) / half[0], power(math.sin(h), 2 - e) / half[1],
                r * power(math.sin(o), 2 - e) / half[2])

    return Shape().grid(point, columns, rows, True, normal)


def arc(points, steps):
    """A smooth profile through (radius, height) points (Catmull-Rom)."""
    out = []
    ends = [points[0]] + list(points) + [points[-1]]
    for p0, p1, p2, p3 in zip(ends, ends[1:], ends[2:], ends[3:]):
        for k in range(steps):
            t = k / steps
            out.append(tuple(max(0.0, b + .5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d
                             + t * (3 * (b - c) + d - a)))) for a, b, c, d in zip(p0, p1, p2, p3)))
    return out + [points[-1]]


def ceiling(s, plain, lamp):
    """A grid whose inner cells alternate with lamps, all corners shared."""
    xs, zs = [0, 1, 1.9, 3.55, 4.45, 6.1, 7, X], [0, 1.2, 1.8, 4.2, 4.8, Z]
    panel, rest = Shape(), Shape()
    for i in range(len(xs) - 1):
        for k in range(len(zs) - 1):
            a, b, c, d = xs[i], xs[i + 1], zs[k], zs[k + 1]
            which = panel if i % 2 and k % 2 else rest
            which.polygon((a, Y, c), (b, Y, c), (b, Y, d), (a, Y, d))
    s.shape("ceiling", rest, plain)
    s.shape("ceiling lamps", panel, lamp)


def room(s, m):
    s.shape("floor", Shape().polygon((0, 0, Z), (X, 0, Z), (X, 0, 0), (0, 0, 0)), m["floor"])
    # The walls end at the same corners; the ceiling's rim splits their upper edge.
    xs, zs = [0, 1, 1.9, 3.55, 4.45, 6.1, 7, X], [0, 1.2, 1.8, 4.2, 4.8, Z]
    back = Shape().polygon((0, 0, 0), (X, 0, 0), *[(x, Y, 0) for x in reversed(xs)])
    front = Shape().polygon((X, 0, Z), (0, 0, Z), *[(x, Y, Z) for x in xs])
    left = Shape().polygon((0, 0, Z), (0, 0, 0), *[(0, Y, z) for z in zs])
    right = Shape().polygon((X, 0, 0), (X, 0, Z), *[(X, Y, z) for z in reversed(zs)])
    s.shape("back wall", back, m["white"])
    s.shape("front wall", front, m["white"])
    s.shape("left wall", left, m["sage"])
    s.shape("right wall", right, m["white"])
    ceiling(s, m["white"], m["lamp"])


def bookcase(s, m, rng, name, x, width, shelves):
    """A case against the back wall with its books, by colour."""
    deep, board, step = .30, .02, .36
    high = shelves * step + board
    case = Shape()
    case.box((x, 0, 0), (x + board, high, deep), skip="yz")
    case.box((x + width - board, 0, 0), (x + width, high, deep), skip="yz")
    case.box((x + board, high - board, 0), (x + width - board, high, deep), skip="zxX")
    for k in range(shelves):
        y = k * step + (.04 if k == 0 else 0)
        case.box((x + board, y, 0), (x + width - board, y + board, deep),
                 skip="zxX")
    s.shape(name, case, m["oak"])
    books = {c: Shape() for c in BOOK_COLOURS}
    for k in range(shelves):
        y = k * step + board + (.04 if k == 0 else 0)
        at = x + board + .01
        while True:
            wide = rng.uniform(.018, .05)
            if at + wide > x + width - board - .01 or rng.random() < .015:
                break
            tall, back = rng.uniform(.17, .27), rng.uniform(.12, .19)
            books[rng.choice(BOOK_COLOURS)].box((at, y, .05), (at + wide, y + tall, .05 + back),
                                                skip="y")
            at += wide + .002
    for colour, shape in books.items():
        s.shape(f"{name} {colour}", shape, m[colour])


def instance(s, name, mesh, x, y, z, degrees=0.0):
    half = math.radians(degrees) / 2
    s.node(name, mesh=mesh, translation=[x, y, z],
           rotation=[0.0, math.sin(half), 0.0, math.cos(half)])


def sofa(s, m, name, seats, x, z, degrees, cloth):
    wide = .7 * seats
    frame = Shape().box((-wide / 2 - .2, .06, -.45), (wide / 2 + .2, .30, .45))
    for side in (-1, 1):
        for end in (-.36, .36):
            fx = side * (wide / 2 + .12)
            frame.box((fx - .03, 0, end - .03), (fx + .03, .06, end + .03), skip="yY")
    instance(s, name + " frame", s.mesh(name + " frame", frame, m["oak"]), x, 0, z, degrees)
    soft = Shape()
    for k in range(seats):
        a = -wide / 2 + .7 * k
        soft.join(cushion((a + .005, .28, -.22), (a + .695, .47, .47), 44, 22))
        soft.join(cushion((a + .005, .40, -.46), (a + .695, .92, -.20), 44, 22))
    for side in (-1, 1):
        a = side * (wide / 2 + .1)
        soft.join(cushion((a - .1, .28, -.45), (a + .1, .66, .46), 44, 22))
    instance(s, name + " cushions", s.mesh(name + " cushions", soft, m[cloth]), x, 0, z, degrees)


def dining(s, m):
    cx, cz = 2.3, 4.2
    top = Shape().box((cx - 1, .71, cz - .5), (cx + 1, .75, cz + .5))
    s.shape("table top", top, m["varnish"])
    legs = Shape()
    for dx in (-.92, .92):
        for dz in (-.42, .42):
            legs.box((cx + dx - .03, 0, cz + dz - .03), (cx + dx + .03, .71, cz + dz + .03),
                     skip="yY")
    s.shape("table legs", legs, m["oak"])

    chair = Shape()
    for dx in (-.18, .18):
        for dz in (-.18, .18):
            leg = Shape().lathe([(.014, 0), (.018, .2), (.022, .42)], 16)
            chair.join(leg.turned(0, by=(dx, 0, dz)))
        post = Shape().lathe([(.016, .45), (.016, .7), (.012, .95)], 16)
        chair.join(post.turned(0, by=(dx, 0, -.19)))
    for k in range(3):
        y = .60 + .12 * k
        chair.join(cushion((-.2, y, -.205), (.2, y + .05, -.175), 20, 8))
    chair_mesh = s.mesh("chair", chair, m["oak"])
    seat_mesh = s.mesh("chair seat", cushion((-.21, .41, -.21), (.21, .47, .21), 32, 14), m["blue"])
    plate = s.mesh("plate", Shape().lathe(arc([(0, .006), (.06, .006), (.12, .018), (.122, .015),
                                               (.07, .001), (0, .001)][::-1], 3), 36), m["china"])
    cup = s.mesh("cup", Shape().lathe(arc([(0, .001), (.028, .001), (.038, .05), (.04, .085),
                                           (.036, .085), (.034, .05), (.02, .008), (0, .008)], 3),
                                      22), m["china"])
    for k, (dx, side) in enumerate([(-.6, 1), (0, 1), (.6, 1), (-.6, -1), (0, -1), (.6, -1)]):
        turn = 180 if side > 0 else 0
        wobble = (7, -5, 11, -9, 4, -13)[k]
        instance(s, f"chair {k + 1}", chair_mesh, cx + dx, 0, cz + side * .62, turn + wobble)
        instance(s, f"seat {k + 1}", seat_mesh, cx + dx, 0, cz + side * .62, turn + wobble)
        instance(s, f"plate {k + 1}", plate, cx + dx, .75, cz + side * .33)
        instance(s, f"cup {k + 1}", cup, cx + dx + .17, .75, cz + side * .28)
    bowl = [(0, .002), (.06, .002), (.13, .05), (.16, .09), (.152, .09), (.12, .055), (.05, .012),
            (0, .012)]
    instance(s, "bowl", s.mesh("bowl", Shape().lathe(arc(bowl, 4), 48), m["teal"]), cx, .75, cz)
    fruit = Shape()
    for k in range(5):
        a = 2 * math.pi * k / 5
        fruit.join(Shape().sphere((.068 * math.cos(a), .06, .068 * math.sin(a)), .037, 2))
    fruit.join(Shape().sphere((0, .11, 0), .037, 2))
    instance(s, "fruit", s.mesh("fruit", fruit, m["orange"]), cx, .75, cz)


def plant_leaves(rng, count, height):
    """Curved leaves about a stem, as sheets."""
    leaves = Shape()
    for k in range(count):
        turn, rise = 137.5 * k, rng.uniform(.25, 1.0) * height
        length, width = rng.uniform(.25, .42), rng.uniform(.035, .06)
        droop = rng.uniform(.1, .9)

        def point(u, v):
            w = width * math.sin(math.pi * min(v + .08, 1)) if 0 < v < 1 else 0.0
            a = 1.1 - droop * 1.6 * v
            return (length * v * math.cos(a) + .012, rise + length * v * math.sin(a), w * (1 - 2 * u))

        leaves.join(Shape().grid(point, 2, 10).turned(turn))
    return leaves


def plants(s, m, rng):
    pot = [(.13, 0), (.16, .14), (.18, .28), (.165, .28), (.15, .22), (0, .22)]
    pot_mesh = s.mesh("pot", Shape().lathe(arc(pot, 4), 40), m["clay"])
    stem_mesh = s.mesh("stem", Shape().lathe([(.012, .21), (.01, .6), (0, 1.0)], 12), m["leaf solid"])
    kinds = [s.mesh(f"leaves {k}", plant_leaves(rng, 64, .95), m["leaf"]) for k in (1, 2)]
    for k, (x, z, turn) in enumerate([(.5, .78, 20), (7.5, .5, 110), (7.55, 5.5, 200), (.5, 5.5, 300)]):
        instance(s, f"pot {k + 1}", pot_mesh, x, 0, z, turn)
        instance(s, f"stem {k + 1}", stem_mesh, x, 0, z, turn)
        instance(s, f"leaves {k + 1}", kinds[k % 2], x, 0, z, turn)


def lounge(s, m):
    s.shape("rug", Shape().box((4.2, 0, 1.35), (7.4, .012, 4.65), skip="y"), m["rug"])
    lift = .012
    sofa(s, m, "sofa", 3, 5.8, 4.55, 180, "wine")
    sofa(s, m, "armchair 1", 1, 4.35, 2.1, 55, "blue")
    sofa(s, m, "armchair 2", 1, 7.2, 2.0, -50, "blue")
    table = [(.22, 0), (.05, .06), (.045, .34), (.10, .39)]
    foot = s.mesh("coffee table foot", Shape().lathe(arc(table, 6), 48), m["oak"])
    top = [(0, .385), (.50, .385), (.52, .395), (.52, .41), (.50, .42), (0, .42)]
    instance(s, "coffee table foot", foot, 5.8, lift, 3.0)
    instance(s, "coffee table top", s.mesh("coffee table top", Shape().lathe(top, 72, False),
                                           m["varnish"]), 5.8, lift, 3.0)
    vase = [(.05, 0), (.10, .1), (.09, .2), (.035, .29), (.045, .34), (.038, .34),
            (.028, .29), (.07, .18), (0, .03)]
    shape = Shape().lathe(arc(vase, 5), 48)
    glossy, plain = s.mesh("vase", shape, m["glaze"]), s.mesh("vase", shape, m["clay"])
    instance(s, "vase 1", glossy, 5.95, lift + .42, 2.9)
    instance(s, "vase 2", plain, 3.55, 1.10, .2)
    instance(s, "vase 3", plain, 3.95, 1.10, .18)
    balls = Shape().sphere((0, .12, 0), .12, 3)
    mesh = s.mesh("ball", balls, m["china"])
    for k, (x, z) in enumerate([(4.75, 3.7), (4.98, 3.52), (6.9, 3.6)]):
        instance(s, f"ball {k + 1}", mesh, x, lift, z)


def wall_things(s, m):
    s.shape("sideboard", Shape().box((3.3, .1, 0), (4.9, 1.10, .42), skip="z"), m["oak"])
    s.shape("sideboard foot", Shape().box((3.36, 0, 0), (4.84, .1, .38), skip="zyY"), m["iron"])
    deep = .03
    face = [(3.5, 1.35, deep), (4.7, 1.35, deep), (4.7, 2.25, deep), (3.5, 2.25, deep)]
    edge = [(3.44, 1.29, deep), (4.76, 1.29, deep), (4.76, 2.31, deep), (3.44, 2.31, deep)]
    rim = Shape().box((3.44, 1.29, 0), (4.76, 2.31, deep), skip="zZ")
    for i in range(4):
        j = (i + 1) % 4
        rim.polygon(edge[i], edge[j], face[j], face[i])
    s.shape("mirror", Shape().polygon(*face), m["mirror"])
    s.shape("mirror frame", rim, m["iron"])
    for k, (z, high) in enumerate([(1.2, .7), (2.5, .5), (3.6, .8)]):
        s.shape(f"picture {k + 1}", Shape().box((X - .03, 1.3, z), (X, 1.3 + high, z + .6), skip="X"),
                m[("teal", "orange", "wine")[k]])
    wave = lambda u, v: (.10 + .045 * math.sin(2 * math.pi * 16 * u) * (.6 + .4 * (1 - v)),
                         .03 + 2.6 * v, 4.75 - 3.0 * u)
    s.shape("curtain", Shape().grid(wave, 256, 10), m["curtain"])


def floor_lamps(s, m):
    stand = [(.15, 0), (.15, .015), (.012, .03), (.01, 1.0), (.01, 1.42), (0, 1.42)]
    shade = [(.22, 1.35), (.20, 1.45), (.17, 1.55), (.15, 1.65)]
    stand_mesh = s.mesh("lamp stand", Shape().lathe(stand, 24), m["iron"])
    shade_mesh = s.mesh("lamp shade", Shape().lathe(shade, 64), m["shade"])
    bulb_mesh = s.mesh("bulb", Shape().sphere((0, 1.48, 0), .05, 2), m["bulb"])
    for k, (x, z) in enumerate([(7.5, 4.3), (3.6, 1.1)]):
        instance(s, f"lamp stand {k + 1}", stand_mesh, x, 0, z)
        instance(s, f"lamp shade {k + 1}", shade_mesh, x, 0, z)
        instance(s, f"bulb {k + 1}", bulb_mesh, x, 0, z)


BOOK_COLOURS = ["wine", "teal", "orange", "blue", "cream"]


def materials(s):
    paints = {"floor": (.45, .33, .22), "white": (.80, .79, .76), "sage": (.42, .52, .40),
              "oak": (.48, .32, .18), "iron": (.07, .07, .075), "wine": (.34, .05, .07),
              "blue": (.10, .17, .38), "teal": (.05, .33, .35), "orange": (.72, .30, .06),
              "cream": (.75, .68, .52), "china": (.82, .81, .78), "clay": (.50, .22, .13),
              "rug": (.38, .20, .17), "leaf solid": (.12, .26, .06)}
    m = {name: s.material(name, {"rho_d": list(c)}) for name, c in paints.items()}
    m["varnish"] = s.material("varnish", {"rho_d": [.28, .14, .07], "rho_s": .15, "alpha": 120})
    m["glaze"] = s.material("glaze", {"rho_d": [.04, .10, .28], "rho_s": .20, "alpha": 40})
    m["mirror"] = s.material("mirror", {"rho_s": .9})
    m["leaf"] = s.material("leaf", {"rho_d": [.14, .32, .07], "tau_d": [.08, .20, .03]},
                           double_sided=True)
    m["curtain"] = s.material("curtain", {"rho_d": [.50, .47, .40], "tau_d": [.26, .24, .19]},
                              double_sided=True)
    m["shade"] = s.material("shade", {"rho_d": [.42, .38, .30], "tau_d": [.45, .40, .30]},
                            double_sided=True)
    m["lamp"] = s.material("lamp", {"rho_d": .7}, glow=(11, 11, 10.5))
    m["bulb"] = s.material("bulb", {"rho_d": .7}, glow=(500, 330, 170))
    return m


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: make_clutter.py OUT.gltf")
    rng = random.Random(1990)
    s = Scene("clutter")
    m = materials(s)
    room(s, m)
    bookcase(s, m, rng, "bookcase 1", .9, 2.0, 6)
    bookcase(s, m, rng, "bookcase 2", 5.2, 1.8, 6)
    dining(s, m)
    lounge(s, m)
    wall_things(s, m)
    floor_lamps(s, m)
    plants(s, m, rng)
    s.camera("overview", (7.7, 1.75, 5.75), (2.9, .75, 1.6), 52, 4 / 3)
    s.camera("table", (.55, 1.45, 3.0), (3.4, .7, 3.7), 52, 4 / 3)
    s.write(sys.argv[1])


if __name__ == "__main__":
    main()
