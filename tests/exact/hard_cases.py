#!/usr/bin/python3
"""The numerically hard inputs of tests/exact/data/hard_cases.json on the chain, as TAP:
hard_cases.py [ID...]. Every case of the file is here, as a test of the stated
behaviour."""
import json
import math
import os
import sys
import tempfile
import time

import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "independent"))
from chain import DATA, TOP, Failed, Tap, container, run
from oracle2gltf import convert, oracles, scene_of
from oracles import chain_field

CASES = {}


def case(function):
    CASES[function.__name__] = function
    return function


class Wrong(Exception):
    pass


def need(condition, what):
    if not condition:
        raise Wrong(what)


def near(got, expected, tolerance, what):
    need(math.isfinite(got) and abs(got - expected) <= tolerance,
         f"{what}: expected {expected:.10g} within {tolerance:.2g}, got {got:.10g}")


# ---- building scenes ----

def mat(front=None, back=None, **coefficients):
    return {"front": front or coefficients, "back": back or {}}


def face(name, material, *verts):
    return {"name": name, "mat": material, "verts": [list(map(float, v)) for v in verts]}


def square(name, material, x0, x1, y0, y1, z, down=False):
    corners = [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]
    return face(name, material, *(corners[::-1] if down else corners))


def box(material, low, high, inwards=True, prefix=""):
    """The six faces of a box; material: a name or {face: name}."""
    (x, y, z), (X, Y, Z) = low, high
    walls = {"floor": [(x, y, z), (X, y, z), (X, Y, z), (x, Y, z)],
             "ceiling": [(x, Y, Z), (X, Y, Z), (X, y, Z), (x, y, Z)],
             "xmin": [(x, y, z), (x, Y, z), (x, Y, Z), (x, y, Z)],
             "xmax": [(X, y, Z), (X, Y, Z), (X, Y, z), (X, y, z)],
             "ymin": [(x, y, z), (x, y, Z), (X, y, Z), (X, y, z)],
             "ymax": [(X, Y, z), (X, Y, Z), (x, Y, Z), (x, Y, z)]}
    pick = lambda n: material if isinstance(material, str) else material.get(n, material["*"])
    return [face(prefix + n, pick(n), *(v if inwards else v[::-1])) for n, v in walls.items()]


UNIT = ((0, 0, 0), (1, 1, 1))


class Lab:
    """A scratch directory and the chain in it."""

    def __init__(self, folder):
        self.folder, self.count = folder, 0

    def path(self, suffix):
        return os.path.join(self.folder, f"{self.count}{suffix}")

    def mesh(self, materials, faces, size, change=None):
        """Writes the scene and meshes it; change: what to do to the glTF first."""
        self.count += 1
        scene = scene_of("hard", materials, faces)
        if change:
            change(scene)
        scene.write(self.path(".gltf"))
        return self.mesh_file(size)

    def mesh_file(self, size):
        self.said = run("mesh", self.path(".gltf"), "-o", self.path(".mesh"), "-p", size, "-e", size).stderr
        return self.path(".mesh")

    def solve(self, method="rays", n=None, stop="1e-9", more=()):
        """ffcalc (with more options) and shoot on the last mesh: its Field."""
        n = n or {"hemicube": 128}.get(method, 4096)
        run("ffcalc", self.path(".mesh"), "-o", self.path(".ff"), "-m", method, "-n", n, *more)
        run("shoot", self.path(".mesh"), self.path(".ff"), "-o", self.path(".rad"), "-e", stop)
        self.field, self.ledger = chain_field(self.path(".rad"))
        need(np.isfinite(self.field.h).all(), "finite irradiance")
        return self.field

    def run(self, materials, faces, size=.25, method="rays", n=None, stop="1e-9", change=None, more=()):
        self.mesh(materials, faces, size, change)
        return self.solve(method, n, stop, more)

    def oracle(self, name, size, method="rays", n=None, stop="1e-9", more=()):
        self.count += 1
        convert(oracles()[name], self.path(".gltf"))
        self.mesh_file(size)
        return self.solve(method, n, stop, more)

    def refused(self, words, materials, faces, change=None):
        """mesh exits 1 with these words in its one line and leaves no file."""
        self.count += 1
        scene = scene_of("hard", materials, faces)
        if change:
            change(scene)
        scene.write(self.path(".gltf"))
        said = run("mesh", self.path(".gltf"), "-o", self.path(".mesh"), expect=1).stderr
        for word in words:
            need(word in said, f"'{word}' in: {said.strip()}")
        need(not os.path.exists(self.path(".mesh")), "no output file")


def mean(field, pattern, side="front", quantity="H"):
    rows = field.faces(pattern, side)
    need(len(rows), f"face {pattern} {side}")
    return float(np.average(field.of(quantity)[rows], weights=field.area[rows]))


def spread(field, pattern, side="front"):
    """Standard error of a face's mean, elements as if independent."""
    rows = field.faces(pattern, side)
    return float(np.sqrt(((field.area[rows] * field.error[rows]) ** 2).sum()) / field.area[rows].sum())


def agree(field, pattern, expected, relative=0.0, side="front"):
    """A face's mean H within 4 standard errors (and a relative part)."""
    near(mean(field, pattern, side), expected,
         4 * spread(field, pattern, side) + relative * abs(expected), f"mean H of {pattern}")


def facing(gap=1.0):
    """An emitter below and a black receiver above, unit squares."""
    return ({"e": mat(E=1), "k": mat()},
            [square("emitter", "e", 0, 1, 0, 1, 0), square("receiver", "k", 0, 1, 0, 1, gap, True)])


def point_to_unit_square(x, y, h):
    """View factor of a point at height h, facing down, to the unit square below
    (Lambert; Howell B-3 for each quadrant)."""
    def corner(a, b):
        p, q = math.hypot(a, h), math.hypot(b, h)
        return (a / p * math.atan(b / p) + b / q * math.atan(a / q)) / (2 * math.pi)
    return corner(x, y) + corner(1 - x, y) + corner(x, 1 - y) + corner(1 - x, 1 - y)


# ---- the cases, in the order of the file ----

@case
def coplanar_abutting(lab):
    two = [square("a", "w", 0, 1, 0, 1, 0), square("b", "w", 1, 2, 0, 1, 0)]
    for method in ("rays", "hemicube"):
        f = lab.run({"w": mat(E=1, rho_d=.5)}, two, method=method)
        need((f.h == 0).all() and len(set(f.b)) == 1, "H = 0 and B = E exactly")


@case
def perpendicular_abutting(lab):
    faces = [square("floor", "e", 0, 1, 0, 1, 0),
             face("wall", "k", (0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1))]
    for size in (1, .25):
        f = lab.run({"e": mat(E=1), "k": mat()}, faces, size, "analytic", more=["-t", "1e-7"])
        near(mean(f, "wall"), .2000437760754, 1e-6, "mean H of wall, analytic")


@case
def touching_at_point(lab):
    faces = [face("a", "w", (0, 0, 0), (1, 0, 0), (0, 1, 0)),
             face("b", "w", (0, 0, 0), (0, -.3, 1), (-.4, .2, 1))]
    materials = {"w": mat({"E": 1, "rho_d": .5}, {"rho_d": .5})}
    for method, bound, options in (("rays", .05, ()), ("analytic", 1e-9, ["--to", "patches", "--precision", "f64"])):
        worst = irreciprocity(lab, lab.run(materials, faces, 2, method, more=options))
        need(worst <= bound, f"reciprocity within {bound:g}, {method}: {worst:.2g}")


def irreciprocity(lab, f):
    """The largest |A_i F_ij - A_j F_ji| of the last form factors."""
    text = run("inspect", lab.path(".ff"), "--patch-matrix").stdout.splitlines()
    names = text[0].split(",")[1:]
    rows = {line.split(",")[0]: list(map(float, line.split(",")[1:])) for line in text[1:]}
    need(all(np.isfinite(r).all() for r in rows.values()), "finite form factors")
    area = {f.name[i] + ":" + "fb"[f.side[i]]: f.area[i] for i in range(len(f.name))}
    return max(abs(area[i] * rows[i][names.index(j)] - area[j] * rows[j][names.index(i)])
               for i in rows for j in rows)


@case
def coincident_duplicate(lab):
    lamp = square("lamp", "e", 0, 1, 0, 1, 2, True)
    both = [square("up", "s", 0, 1, 0, 1, 0), square("down", "s", 0, 1, 0, 1, 0, True)]
    f = lab.run({"e": mat(E=1), "s": mat(rho_d=.5)}, [lamp] + both)
    need(lab.said.count("coincid") + lab.said.count("duplicate") >= 1, "a warning: " + lab.said.strip())
    upper = mean(f, "up") if len(f.faces("up", "front")) else 0
    single = lab.run({"e": mat(E=1), "s": mat({"rho_d": .5}, {"rho_d": .5})}, [lamp, both[0]])
    near(upper, mean(single, "up"), 6 * spread(single, "up"), "the lit side")


@case
def sliver_1e_6(lab):
    s = 1e-6
    walls = box("w", *UNIT)
    walls = [w for w in walls if w["name"] != "ceiling"]
    walls += [face("seam", "w", (0, s, 1), (1, s, 1), (1, 0, 1), (0, 0, 1)),
              face("ceiling", "w", (0, 1, 1), (1, 1, 1), (1, s, 1), (0, s, 1))]
    f = lab.run({"w": mat(E=1, rho_d=.5)}, walls, 2, "analytic")
    need(len(f.faces("seam", "front")), "the seam is kept")
    emitted = float((f.area * 1.0).sum())
    near(float((f.area * f.h).sum()) * .5, emitted, 1e-6 * emitted, "flux absorbed")
    near(mean(f, "seam"), 2, .02, "seam H")


@case
def zero_area(lab):
    def spoil(scene):
        from gltf_writer import Shape
        scene.shape("collinear", Shape().polygon((0, 0, .5), (.5, 0, .5), (1, 0, .5)), 0)
        scene.shape("repeated", Shape().polygon((0, 0, .5), (0, 0, .5), (1, 0, .7)), 0)
    materials = {"w": mat(E=1, rho_d=.5)}
    clean = lab.run(materials, box("w", *UNIT))
    f = lab.run(materials, box("w", *UNIT), change=spoil)
    need("collinear" in lab.said or "2" in lab.said, "says how many in which node: " + lab.said.strip())
    need(np.array_equal(f.h, clean.h), "as the scene without them")


@case
def duplicate_vertices(lab):
    lamp = square("lamp", "e", 0, 1, 0, 1, 1, True)
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
    materials = {"e": mat(E=1), "k": mat()}
    f = lab.run(materials, [lamp, face("t", "k", *corners, corners[2])])
    g = lab.run(materials, [lamp, face("t", "k", *corners)])
    need(np.array_equal(f.h, g.h), "as the triangle")


@case
def nan_inf_input(lab):
    import struct
    walls = box("w", *UNIT)
    good = {"w": mat(E=1, rho_d=.5)}
    for value in ("nan", "inf"):
        def spoil(scene):
            scene.points[0:4] = struct.pack("<f", float(value))
        lab.refused([], good, walls, spoil)
    for key, value in (("rho_d", math.nan), ("rho_d", math.inf), ("E", math.nan), ("rho_d", 10 ** 400)):
        lab.refused([], {"w": mat(**{**dict(E=1, rho_d=.5), key: value})}, walls)


@case
def albedo_gt_1(lab):
    lab.refused(["bright", "front"],
                {"bright": mat(E=1, rho_d=.4, tau_d=.3, rho_s=.3, tau_s=.2, n=10)}, box("bright", *UNIT))
    lab.refused(["bright", "back"],
                {"bright": mat({"E": 1}, {"rho_d": .7, "tau_d": .5})}, box("bright", *UNIT))


def no_steady_state(lab, material):
    lab.mesh({"w": mat(**material), "e": mat(**{**material, "E": 1})}, box({"floor": "e", "*": "w"}, *UNIT), .5)
    run("ffcalc", lab.path(".mesh"), "-o", lab.path(".ff"), "-m", "rays", "-n", "256")
    begun = time.time()
    said = run("shoot", lab.path(".mesh"), lab.path(".ff"), "-o", lab.path(".rad"), expect=1, seconds=20).stderr
    need("no steady state" in said, f"'no steady state' in: {said.strip()}")
    need(time.time() - begun < 1, "within a second")
    need(not os.path.exists(lab.path(".rad")), "no output file")


@case
def albedo_eq_1_closed(lab):
    no_steady_state(lab, {"rho_d": 1})


@case
def albedo_eq_1_with_sink(lab):
    f = lab.oracle("all_white_one_black", .25)
    near(mean(f, "ceiling"), 1, 1e-6, "mean H of the black ceiling")
    a, b = .45, .55
    walls = [w for w in box({"floor": "e", "*": "w"}, *UNIT) if w["name"] != "ceiling"]
    walls += [square("sink", "k", a, b, a, b, 1, True), square("c1", "w", 0, 1, 0, a, 1, True),
              square("c2", "w", 0, 1, b, 1, 1, True), square("c3", "w", 0, a, a, b, 1, True),
              square("c4", "w", b, 1, a, b, 1, True)]
    f = lab.run({"e": mat(E=1, rho_d=1), "w": mat(rho_d=1), "k": mat()}, walls, .25)
    near(mean(f, "sink"), 100, 1e-4, "mean H of the sink")


@case
def albedo_0_999(lab):
    f = lab.oracle("furnace_cube_rho0.999", .25, stop="1e-8")
    near(float(np.average(f.b, weights=f.area)), 1000, 1e-3, "mean B")


def rescaled(lab, factor, offset, method):
    o = oracles()["emitter_diffuser_receiver"]
    base = lab.run(o["materials"], o["faces"], .25, method)
    moved = [dict(f, verts=[[factor * c + d for c, d in zip(v, offset)] for v in f["verts"]])
             for f in o["faces"]]
    f = lab.run(o["materials"], moved, .25 * factor, method)
    need(len(f.b) == len(base.b), "the same elements")
    return float(np.abs(f.b - base.b).max())


@case
def scale_1e_6(lab):
    for method in ("rays", "analytic"):
        off = rescaled(lab, 1e-6, (0, 0, 0), method)
        need(off <= 1e-9, f"B identical to 1e-9, {method}: {off:.2g}")


@case
def scale_1e_plus_6(lab):
    for method in ("rays", "analytic"):
        off = rescaled(lab, 1e6, (0, 0, 0), method)
        need(off <= 1e-9, f"B identical to 1e-9, {method}: {off:.2g}")


@case
def offset_1e6(lab):
    for method in ("rays", "analytic"):
        off = rescaled(lab, 1, (1e6, -1e6, 1e6), method)
        need(off <= 1e-6, f"B identical to 1e-6, {method}: {off:.2g}")


def lobe_scene(n, receiver):
    """An emitter above a lobe of exponent n, and a receiver somewhere."""
    return ({"e": mat(E=1), "m": mat(rho_s=.8, n=n), "k": mat(rho_d=.3)},
            [square("emitter", "e", 0, 1, 0, 1, 1, True), square("lobe", "m", 0, 1, 0, 1, 0), receiver])


@case
def cos_theta_zero(lab):
    f = lab.run(*lobe_scene(10, square("beside", "k", 1, 2, 0, 1, 0)))
    agree(f, "beside", mean(f, "beside"))
    need(mean(f, "beside") < .8, "no more than the lobe sends")


@case
def cos_neg_pow(lab):
    for n in (2.5, .3, 33.3):
        lab.run(*lobe_scene(n, face("wall", "k", (1, 0, 0), (1, 0, 1), (1, 1, 1), (1, 1, 0))))


@case
def n_0_and_fraction(lab):
    o = oracles()["infinite_plates_directional_partition_n1"]
    for n in (0, .5, 1):
        materials = json.loads(json.dumps(o["materials"]))
        for side in ("front", "back"):
            materials["p"][side]["n"] = n
        f = lab.run(materials, o["faces"])
        for e in o["expect"]:
            if e["quantity"] == "H":
                agree(f, e["face"], e["value"], .001, e["side"])


@case
def n_1e4_to_1e8(lab):
    o = oracles()["mirror_virtual_image_rs1.0"]
    for n in (1e4, 1e6, 1e8):
        materials = json.loads(json.dumps(o["materials"]))
        materials["m"]["front"]["n"] = n
        for method in ("rays", "hemicube"):
            f = lab.run(materials, o["faces"], .25, method)
            near(mean(f, "receiver"), .04806410298507045, .05 * .048, f"receiver, {method}, n = {n:g}")
            emitted, *gone = lab.ledger.values()
            near(float(sum(gone)[0]), float(emitted[0]), 1e-8, "light conserved")


@case
def grazing_incidence(lab):
    faces = [face("emitter", "e", (1, 0, 0), (1, 1, 0), (1, 1, .02), (1, 0, .02)),
             square("lobe", "m", -1, 1, 0, 1, 0)] + box("k", (-3, -3, -1), (3, 3, 2), True, "room ")
    f = lab.run({"e": mat(E=1), "m": mat(rho_s=1, n=5), "k": mat()}, faces, .5)
    emitted, absorbed, *rest = [float(v[0]) for v in lab.ledger.values()]
    near(absorbed, emitted, 1e-6 * emitted + 1e-9, "all light ends on the walls")


@case
def lobe_into_void(lab):
    for method in ("rays", "hemicube"):
        f = lab.oracle("open_lobe_normaliser", .125, method, {"rays": 131072, "hemicube": 512}[method])
        flux = lambda name: mean(f, name) * f.area[f.faces(name, "front")].sum()
        near(flux("receiver") / flux("mirror"), .0333070, .002, f"fraction, {method}")


@case
def isolated_unlit(lab):
    faces = box("w", *UNIT) + box("d", (2, 0, 0), (3, 1, 1), True, "dark ")
    for method in ("rays", "hemicube"):
        f = lab.run({"w": mat(E=1, rho_d=.5), "d": mat(rho_d=.5)}, faces, method=method)
        need((f.h[f.faces("dark *", "front")] == 0).all(), f"exactly dark, {method}")


@case
def light_leak_under_wall(lab):
    for method in ("rays", "hemicube"):
        f = lab.oracle("box_in_box_isolated", .25, method)
        need((f.h[f.faces("floor", "front")] == 0).all(), f"box in box, {method}")
    w = .37
    faces = box({"xmin": "e", "*": "w"}, (0, 0, 0), (1, 1, 1))
    faces += [face("wall", "w", (w, 0, 0), (w, 0, 1), (w, 1, 1), (w, 1, 0)),
              face("wall 2", "w", (w + .02, 0, 0), (w + .02, 1, 0), (w + .02, 1, 1), (w + .02, 0, 1))]
    f = lab.run({"e": mat(E=1), "w": mat(rho_d=.5)}, faces, .5)
    need((f.h[f.faces("xmax", "front")] == 0).all(), "the far room is exactly dark")


@case
def interpenetrating(lab):
    faces = box("e", (-2, -2, -2), (3, 3, 3)) + box("w", (0, 0, 0), (1, 1, 1), False, "a ")
    faces += box("w", (.9, .25, .25), (1.9, .75, .75), False, "b ")
    f = lab.run({"e": mat(E=1), "w": mat(rho_d=.5)}, faces, 1)
    need((f.h[f.faces("b xmin", "front")] == 0).all(), "dark inside")


@case
def winding_flip(lab):
    """By rays within the standard error, since other triangles are sampled; by formula to
    rounding."""
    o = oracles()["emitter_diffuser_receiver"]
    materials = dict(o["materials"])
    materials["p"] = mat({"rho_d": .3, "tau_d": .4}, {"rho_d": .2, "tau_d": .6})
    f = lab.run(materials, o["faces"], .5, n=65536)
    flipped = [dict(x, verts=x["verts"][::-1]) if x["name"] == "pane" else x for x in o["faces"]]
    materials["p"] = mat(materials["p"]["back"], materials["p"]["front"])
    g = lab.run(materials, flipped, .5, n=65536)
    for name, side, other in (("emitter", "front", "front"), ("receiver", "front", "front"),
                              ("pane", "front", "back"), ("pane", "back", "front")):
        agree(g, name, mean(f, name, side), 4 * spread(f, name, side) / mean(f, name, side), other)
    exact = ("--to", "patches", "--precision", "f64")
    f = lab.run(dict(o["materials"], p=materials["p"]), flipped, .5, "analytic", 64, more=exact)
    materials["p"] = mat(materials["p"]["back"], materials["p"]["front"])
    g = lab.run(materials, o["faces"], .5, "analytic", 64, more=exact)
    for name, side, other in (("receiver", "front", "front"), ("pane", "front", "back"), ("pane", "back", "front")):
        off = abs(mean(g, name, other) - mean(f, name, side))
        need(off <= 1e-12, f"{name} {side} to rounding: {off:.2g}")


def receiver_error(lab, size, n):
    """Relative rms error of H on a black unit square, element by element, with the
    value at the centroid as the truth (the elements are small)."""
    materials, faces = facing()
    lab.mesh(materials, faces, size)
    run("mesh", lab.path(".gltf"), "-o", lab.path(".mesh"), "-p", ".25", "-e", size)
    f = lab.solve("hemicube", n)
    rows = f.faces("receiver", "front")
    centre = f.corners[rows].mean(1)
    exact = np.array([point_to_unit_square(x, y, 1) for x, y, _ in centre])
    return float(np.sqrt(np.mean((f.h[rows] / exact - 1) ** 2)))


@case
def patch_below_pixel(lab):
    error = receiver_error(lab, 1 / 64, 64)
    need(error < .05, f"rms error below 5 %: {100 * error:.2f} %")


@case
def hemicube_aliasing(lab):
    errors = [receiver_error(lab, 1 / 24, n) for n in (32, 64, 128, 256)]
    slope = np.polyfit(np.log([32, 64, 128, 256]), np.log(errors), 1)[0]
    need(slope <= -1 or errors[-1] < 2e-3, f"errors {errors}, slope {slope:.2f}")


@case
def hemicube_near_plane(lab):
    materials, faces = facing()
    faces.append(square("shutter", "k2", -.1, 1.1, -.1, 1.1, 1e-4))
    materials["k2"] = mat({}, {"rho_d": .1})
    for method in ("rays", "hemicube"):
        f = lab.run(materials, faces, .5, method)
        need(mean(f, "receiver") < 1e-3, f"blocked, {method}: {mean(f, 'receiver'):.2g}")


@case
def patch_centre_covered(lab):
    faces = [square("floor", "e", 0, 1, 0, 1, 0), square("ceiling", "k", 0, 1, 0, 1, 1, True)]
    faces += [b for b in box("k", (.47, .47, 0), (.53, .53, .3), False, "leg ") if b["name"] != "leg floor"]
    materials = {"e": mat(E=1), "k": mat()}
    for method in ("rays", "hemicube"):
        fine = mean(lab.run(materials, faces, .125, method), "ceiling")
        lab.mesh(materials, faces, 1)
        coarse = mean(lab.solve(method), "ceiling")
        near(coarse, fine, .05 * fine, f"flux past the leg, {method}")


@case
def nonplanar_quad(lab):
    top = TOP
    scene = os.path.join(top, "scenes", "cornell.gltf")
    run("mesh", scene, "-o", lab.path(".mesh"))
    _, arrays = container(lab.path(".mesh"))
    from chain import table
    rows = table(run("inspect", lab.path(".mesh"), "--csv").stdout)
    got = sum(r["area"] for r in rows if r["name"] == "left")
    v = np.array([(.5528, 0, 0), (.5496, 0, .5592), (.556, .5488, .5592), (.556, .5488, 0)])
    half = lambda a, b, c: np.linalg.norm(np.cross(b - a, c - a)) / 2
    near(got, half(v[0], v[1], v[2]) + half(v[0], v[2], v[3]), 1e-6, "area of the left wall")


@case
def source_straddles_plane(lab):
    faces = [square("lobe", "m", 0, 1, 0, 1, 0),
             face("emitter", "e", (1.2, 0, .5), (1.2, 1, .5), (1.2, 1, -.5), (1.2, 0, -.5))]
    sides = {"rho_s": .5, "n": 10}
    lab.mesh({"m": mat(dict(sides), dict(sides)), "e": mat(E=1)}, faces, 2)
    f = lab.solve()
    front, back = mean(f, "lobe"), mean(f, "lobe", "back")
    need(front > 0 and back > 0, f"both sides lit: {front:.3g}, {back:.3g}")
    near(front, back, 6 * (spread(f, "lobe") + spread(f, "lobe", "back")) + .02 * front, "front against back")


@case
def self_bucket(lab):
    from gltf_writer import Scene, Shape
    lab.count += 1
    scene, ball = Scene("bowls"), Shape().sphere((0, 0, 0), 1, 1)
    ball = [[ball.positions[i] for i in t] for t in ball.triangles]
    for name, lobe in (("upper", {"rho_d": .2, "rho_s": .3, "alpha": 20, "emission_front": .3}),
                       ("lower", {"rho_d": .4, "rho_s": .4, "alpha": 5})):
        sign = 1 if name == "upper" else -1
        half = Shape()
        for a, b, c in ball:
            if sign * (a[1] + b[1] + c[1]) > 0:
                half.add([c, b, a], [(0, 1, 2)])
        scene.shape(name, half, scene.material(name, lobe))
    scene.write(lab.path(".gltf"))
    run("mesh", lab.path(".gltf"), "-o", lab.path(".mesh"), "-p", 4, "-e", "inf", "--normal-cone", 80)
    lab.solve(n=1024)
    emitted, *gone = lab.ledger.values()
    near(float(sum(gone)[0]), float(emitted[0]), 1e-6 * float(emitted[0]), "light conserved")


@case
def facing_mirrors(lab):
    o = oracles()["facing_mirrors_ninf"]
    for n in (50, "inf"):
        materials = json.loads(json.dumps(o["materials"]))
        materials["f"]["front"]["n"] = materials["c"]["front"]["n"] = n
        f = lab.run(materials, o["faces"], .5, n=1024)
        agree(f, "ceiling", 50.25125628, .001)


@case
def two_perfect_mirrors(lab):
    walls = box({"floor": "e", "*": "m"}, *UNIT)
    lab.mesh({"e": mat(E=1, rho_s=1, n="inf"), "m": mat(rho_s=1, n="inf")}, walls, .5)
    begun = time.time()
    run("ffcalc", lab.path(".mesh"), "-o", lab.path(".ff"), "-m", "rays", "-n", "256", seconds=60)
    run("shoot", lab.path(".mesh"), lab.path(".ff"), "-o", lab.path(".rad"), expect=None, seconds=60)
    need(time.time() - begun < 30, "terminates")


@case
def dynamic_range(lab):
    faces = box("w", *UNIT) + box("d", (2, 0, 0), (3, 1, 1), True, "dim ")
    f = lab.run({"w": mat(E=1e8, rho_d=.5), "d": mat(E=1e-8, rho_d=.5)}, faces)
    for pattern, e in (("floor", 1e8), ("dim floor", 1e-8)):
        rows = [i for i, n in enumerate(f.name) if n.startswith("dim") == pattern.startswith("dim")]
        near(float(np.average(f.b[rows], weights=f.area[rows])) / e, 2, 2e-6, f"B/E where E = {e:g}")


@case
def float32_accumulation(lab):
    f = lab.oracle("furnace_cube_rho0.9", 1 / 16, n=256, stop="1e-10")
    absorbed = float(lab.ledger["absorbed"][0])
    near(float(.1 * (f.area * f.h).sum()), absorbed, 1e-11 * absorbed, "absorbed flux, by elements")


@case
def normalisation_balance(lab):
    lab.run(*facing())
    said = json.loads(run("inspect", lab.path(".ff"), "--json").stdout)
    need("residual" in json.dumps(said), "the residual is stated")


@case
def directional_emitter(lab):
    a = 1e-3

    def shine(scene):
        for m in scene.root["materials"]:
            if m["name"] == "e":
                m["extras"]["twopass"].update(emission_front=1.0, emission_exponent=n)
    walls = [w for w in box("k", (-1, -1, 0), (1, 1, 1)) if w["name"] != "floor"]
    for n, ceiling, wall in ((1, .554126423979572, .11146839400510698),
                             (10, .9865729027550331, .0033567743112417276)):
        for method in ("rays", "hemicube"):
            f = lab.run({"e": mat(), "k": mat()}, [square("lamp", "e", -a, a, -a, a, 0)] + walls, .5,
                        method, 65536 if method == "rays" else 256, change=shine)
            flux = float(lab.ledger["emitted"][0])
            near(flux, 2 * math.pi / (n + 1) * 4 * a * a, 1e-6 * flux, "emitted flux")
            near(4 * mean(f, "ceiling") / flux, ceiling, .002, f"ceiling, {method}, m = {n}")
            near(2 * mean(f, "xmax") / flux, wall, .002, f"wall, {method}, m = {n}")


@case
def empty_scene(lab):
    lab.count += 1
    with open(lab.path(".gltf"), "w", encoding="utf-8") as f:
        json.dump({"asset": {"version": "2.0"}}, f)
    said = run("mesh", lab.path(".gltf"), "-o", lab.path(".mesh"), expect=1).stderr
    need("no geometry" in said and not os.path.exists(lab.path(".mesh")), said.strip())


@case
def one_patch(lab):
    for method in ("rays", "hemicube"):
        f = lab.run({"w": mat(E=1, rho_d=.5)}, [square("a", "w", 0, 1, 0, 1, 0)], 2, method)
        need((f.h == 0).all() and lab.ledger["escaped"][0] == lab.ledger["emitted"][0], "all escapes")


@case
def order_and_threads(lab):
    o = oracles()["emitter_diffuser_receiver"]
    f = lab.run(o["materials"], o["faces"], .25)
    g = lab.run(o["materials"], o["faces"][::-1], .25)
    for name in ("emitter", "receiver"):
        agree(g, name, mean(f, name), 4 * spread(f, name) / mean(f, name))
    off = abs(mean(g, "receiver") - mean(f, "receiver"))
    need(off <= 1e-12, f"permuted faces within 1e-12: {off:.2g}")


@case
def bucket_memory(lab):
    """A link for every pair of patches would be 16 times as many."""
    links = []
    faces = box("w", *UNIT) + [square("lamp", "e", .45, .55, .45, .55, .9, True)]
    for size in (1 / 4, 1 / 8):
        lab.mesh({"w": mat(rho_d=.3, rho_s=.3, n=10), "e": mat(E=1)}, faces, size)
        run("ffcalc", lab.path(".mesh"), "-o", lab.path(".ff"), "-n", 64, "--lobe-rays", 64)
        links.append(len(container(lab.path(".ff"))[1]["link_target"]))
    need(links[1] < 8 * links[0], f"links of 96 and of 384 patches: {links}")


@case
def denormals(lab):
    times = []
    for stop in ("1e-4", "1e-12"):
        lab.oracle("furnace_cube_rho0.9", .125, n=256, stop=stop)
        begun = time.time()
        run("shoot", lab.path(".mesh"), lab.path(".ff"), "-o", lab.path("again.rad"), "-e", stop)
        times.append(time.time() - begun)
    need(times[1] < 10 * times[0] + 1, f"time for long tails: {times}")


NAMES = {"sliver_1e-6": "sliver_1e_6", "albedo_0.999": "albedo_0_999", "scale_1e-6": "scale_1e_6",
         "scale_1e+6": "scale_1e_plus_6"}


def listed():
    """Ids and stated behaviour, in the order of the file."""
    with open(os.path.join(DATA, "hard_cases.json"), encoding="utf-8") as f:
        return [(entry["id"], entry["check"]) for entry in json.load(f)]


def tried(name):
    """What is wrong with a case, as lines: none if it behaves as stated."""
    name = NAMES.get(name, name)
    if name not in CASES:
        return ["there is no test for this case"]
    with tempfile.TemporaryDirectory() as folder:
        try:
            CASES[name](Lab(folder))
        except (Wrong, Failed) as problem:
            return [str(problem)]
        except Exception as problem:  # a test must not end the others
            return [f"{type(problem).__name__}: {problem}"]
    return []


def main():
    tap = Tap()
    for name, check in listed():
        if sys.argv[1:] and name not in sys.argv[1:]:
            continue
        begun = time.time()
        notes = tried(name)
        if os.environ.get("VERBOSE"):
            print(f"# {time.time() - begun:.1f} s")
        tap.ok(not notes, f"{name}: {check}", *notes)
    sys.exit(tap.finish())


if __name__ == "__main__":
    main()
