#!/usr/bin/python3
"""Turns a scene of tests/exact/data/global_illumination.json, or the Cornell box at one
wavelength (tests/exact/data/cornell_box.json), into glTF: oracle2gltf.py ID OUT.gltf, or
oracle2gltf.py --list.

Each face becomes a node of its own name; rectangles keep their float64 corners (a
unit square under a matrix), other polygons are rounded to float32. An exitance E
becomes the radiance E/pi. A material whose back has no coefficient and no emission,
and whose front does not transmit, is one-sided."""
import fnmatch
import functools
import json
import math
import os
import sys

import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scenes"))
from gltf_writer import Scene, Shape
from oracle_tables import scenes_of_tables

DATA = os.path.join(os.path.dirname(os.path.abspath(__file__)), "data")
KEYS = ("rho_d", "tau_d", "rho_s", "tau_s")


@functools.cache
def oracles():
    """All scenes by id; not to be changed."""
    with open(os.path.join(DATA, "global_illumination.json"), encoding="utf-8") as f:
        data = json.load(f)
    known = {o["id"]: o for o in data["oracles"]}
    known["khodulev_cube"] = khodulev(known["khodulev_cube"])
    for o in scenes_of_tables({a["id"]: a for a in data["analytic"]}, known["phong_to_mirror_n10"]):
        known.setdefault(o["id"], o)
    with open(os.path.join(DATA, "cornell_box.json"), encoding="utf-8") as f:
        box = json.load(f)
    for wavelength in box["reference_mean_irradiance_per_unit_light_exitance"]:
        known["cornell_" + wavelength] = cornell(box, wavelength)
    return known


def cornell(box, wavelength):
    """The Cornell box at one wavelength, its lamp of exitance 1, in metres: the left
    wall split along its diagonal, the ceiling cut around the lamp."""
    at = box["wavelengths_nm"].index(int(wavelength))
    materials = {name: {"front": {"rho_d": values[at]}, "back": {}}
                 for name, values in box["reflectance"].items()}
    materials["light"] = {"front": {"rho_d": box["light_reflectance"], "E": 1.0}, "back": {}}
    corners = {f["name"]: np.array(f["verts"]) / 1000 for f in box["faces"]}
    faces = []
    for f in box["faces"]:
        v = corners[f["name"]]
        parts = [v]
        if f["name"] == "left":
            parts = [v[[0, 1, 2]], v[[0, 2, 3]]]
        elif f["name"] == "ceiling":
            hole = corners["light"]
            parts = [np.array([v[i], v[(i + 1) % 4], hole[(i + 1) % 4], hole[i]]) for i in range(4)]
        faces += [{"name": f"{f['name']} {i}", "mat": f["mat"], "verts": part.tolist()}
                  for i, part in enumerate(parts)]
    lamp = corners["light"]
    area = np.linalg.norm(np.cross(lamp[1] - lamp[0], lamp[3] - lamp[0]))
    expect = []
    for name, answer in box["reference_mean_irradiance_per_unit_light_exitance"][wavelength].items():
        e = {"quantity": "H", "face": name + " *", "side": "front", "stat": "mean",
             "value": answer["H"], "rel_tol_hemicube": .02,
             "rel_tol": max(.005, 4 * answer["se"] / answer["H"])}  # it is sampled, too
        if name == "escaped_fraction":
            e.update(quantity="escaped_flux", face="*", value=answer["H"] * area)
        expect.append(e)
    return {"id": "cornell_" + wavelength, "group": "cornell", "materials": materials,
            "faces": faces, "expect": expect}


def khodulev(oracle):
    """The cube, its point light, and what is said of any face as irradiance of the floor."""
    rho, half = 2 / 3, 5
    name = ["zmin", "zmax", "ymin", "ymax", "xmin", "xmax"]
    square = [(-half, -half), (half, -half), (half, half), (-half, half)]
    faces = []
    for i, n in enumerate(name):
        turn = lambda u, v, w: [(u, v, w), (w, u, v), (v, w, u)][i // 2]
        at = half if i % 2 else -half
        corners = [turn(u, v, at) for u, v in (square[::-1] if i % 2 else square)]
        faces.append({"name": n, "mat": "wall", "verts": corners})
    expect = []
    for e in oracle["expect"]:
        # Nothing is said of hemicubes, which are at their worst where faces meet: D, E, F.
        loose = .1 if half in e.get("offset_from_face_centre", ()) else .01
        e = {**e, "side": "front", "rel_tol_hemicube": loose}
        if e["quantity"] == "luminance":
            x, y = e["offset_from_face_centre"]
            e.update(quantity="H", stat="point", face="zmin", point=[x, y, -half],
                     value=e["value"] * math.pi / rho)
        expect.append(e)
    return {**oracle, "materials": {"wall": {"front": {"rho_d": rho}, "back": {}}}, "faces": faces,
            "lights": [{"name": "lamp", "kind": "point", "intensity": 50000}], "expect": expect}


def graded(oracle, cuts):
    """The same scene with its rectangles cut along both edges at fractions, for light that
    changes fast in places. cuts: {pattern of names: fractions}, the first that fits counts."""
    faces = []
    for face in oracle["faces"]:
        a, b, _, d = np.array(face["verts"], float)
        at = lambda u, v: (a + u * (b - a) + v * (d - a)).tolist()
        fractions = next(cuts[p] for p in cuts if fnmatch.fnmatchcase(face["name"], p))
        spans = list(zip(fractions, fractions[1:]))
        faces += [{**face, "name": f"{face['name']} {u},{v}",
                   "verts": [at(u, v), at(x, v), at(x, y), at(u, y)]}
                  for u, x in spans for v, y in spans]
    expect = [{**e, "face": e["face"] + "*"} for e in oracle["expect"]]
    return {**oracle, "faces": faces, "expect": expect}


def coefficients(side):
    """The extras of one side of an oracle's material."""
    keys = {k: side.get(k, 0) for k in KEYS}
    n = side.get("n")
    if n is not None:
        keys["alpha"] = keys["beta"] = n
    return keys


def material(scene, name, front, back):
    extras = coefficients(front)
    if front.get("E"):
        extras["emission_front"] = front["E"] / math.pi
    dark = not any(back.get(k) for k in KEYS) and not back.get("E")
    if dark and not front.get("tau_d") and not front.get("tau_s"):
        return scene.material(name, extras, colour=(.5, .5, .5))
    extras["back"] = coefficients(back)
    if back.get("E"):
        extras["emission_back"] = back["E"] / math.pi
    return scene.material(name, extras, colour=(.5, .5, .5), double_sided=True)


def is_rectangle(corners):
    if len(corners) != 4:
        return False
    a, b, c, d = [np.array(p, float) for p in corners]
    size = np.abs(b - a).max() + np.abs(d - a).max()
    u, v = b - a, d - a
    return (np.abs(a + c - b - d).max() < 1e-12 * size and
            abs(u @ v) < 1e-12 * np.linalg.norm(u) * np.linalg.norm(v))


def scene_of(name, materials, faces, cameras=(), lights=()):
    """materials: {name: {"front": {E, rho_d, …, n}, "back": {…}}}, what is missing 0; faces: name, verts,
    mat; cameras: (name, eye, target, yfov); lights: arguments of Scene.light."""
    s = Scene(name)
    known = {m: material(s, m, sides["front"], sides["back"])
             for m, sides in materials.items()}
    for face in faces:
        if is_rectangle(face["verts"]):
            s.rectangle(face["name"], face["verts"], known[face["mat"]])
        else:
            s.shape(face["name"], Shape().polygon(*face["verts"]), known[face["mat"]])
    for view, eye, target, yfov in cameras:
        s.camera(view, eye, target, yfov, 1, (0, 0, 1))
    for light in lights:
        s.light(**light)
    return s


# Seen from within the unit cube, for expectations on every pixel.
INSIDE = [("corner", (.1, .15, .2), (.9, .8, .7), 80), ("floor", (.5, .45, .9), (.52, .5, 0), 60),
          ("mirror", (.3, .6, .3), (.5, .4, 1), 70), ("wall", (.8, .5, .5), (0, .4, .45), 75)]


def convert(oracle, path):
    views = INSIDE if any(e.get("stat") == "every_pixel" for e in oracle["expect"]) else ()
    scene_of(oracle["id"], oracle["materials"], oracle["faces"], views,
             oracle.get("lights", ())).write(path)


def main():
    known = oracles()
    if sys.argv[1:] == ["--list"]:
        print("\n".join(known))
        return
    if len(sys.argv) != 3 or sys.argv[1] not in known:
        sys.exit("usage: oracle2gltf.py ID OUT.gltf, or --list")
    convert(known[sys.argv[1]], sys.argv[2])


if __name__ == "__main__":
    main()
