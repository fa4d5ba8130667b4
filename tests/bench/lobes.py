#!/usr/bin/python3
"""Directional light by several schemes of form factors against particles:
lobes.py [-n EXPONENT,...] [SCENE...]

For each scene, exponent and scheme a line: rms error of the irradiance of what only
directional light reaches, element by element, relative to its mean; error of its
flux; what noise of the yardstick is in the rms; seconds of processor time of ffcalc
and shoot."""
import argparse
import os
import resource
import sys
import tempfile

import numpy as np

sys.dont_write_bytecode = True
sys.path[:0] = [os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", folder)
                for folder in ("exact", "independent")]
from chain import run, table
from oracle2gltf import scene_of
from oracles import chain_field

SCHEMES = {
    "paper": ["--paper"],
    "paper closed": ["--paper=closed"],
    "hemicube": ["-m", "hemicube", "--links", "centroid"],
    "centroid": ["--links", "centroid"],
    "one lobe": ["--lobe-depth", "0"],
    "default": [],
    "fine": ["-n", "65536", "--lobe-rays", "65536"],
}


def mat(front=None, back=None, **coefficients):
    return {"front": front or coefficients, "back": back or {}}


def lobe(n, **more):
    return mat(rho_s=.9, n=n, **more)


def face(name, material, *verts):
    return {"name": name, "mat": material, "verts": [list(map(float, v)) for v in verts]}


def flat(name, material, x0, x1, y0, y1, z, up=True):
    corners = [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]
    return face(name, material, *(corners if up else corners[::-1]))


def wall(name, material, x, y0, y1, z0, z1, right=True):
    """At x, its front towards +x (right) or -x."""
    corners = [(x, y0, z0), (x, y1, z0), (x, y1, z1), (x, y0, z1)]
    return face(name, material, *(corners if right else corners[::-1]))


E = mat(E=1)
K = mat()


def near_source(n):
    """A panel as large as the glossy floor that it stands on; a ceiling beyond."""
    return {"e": E, "m": lobe(n), "k": K}, [
        wall("panel", "e", 0, 0, 1, 0, 1), flat("gloss", "m", 0, 1, 0, 1, 0),
        wall("receiver", "k", 2, 0, 1, 0, 1, False)]


def two_sources(n):
    """A glossy floor with a lamp on either side."""
    behind = face("behind", "e", (.2, 1.3, .3), (.8, 1.3, .3), (.8, 1.3, .9), (.2, 1.3, .9))
    return {"e": E, "m": lobe(n), "k": K}, [
        wall("left", "e", -.2, .2, .8, .2, .8), behind,
        flat("gloss", "m", 0, 1, 0, 1, 0),
        wall("receiver", "k", 1.4, 0, 1, 0, 1, False), flat("receiver above", "k", 0, 1, 0, 1, 1.5, False)]


def twice(n):
    """Lamp, lobe, lobe, receiver."""
    return {"e": E, "m": lobe(n), "k": K}, [
        flat("lamp", "e", -.4, -.2, .4, .6, 1, False), flat("first", "m", 0, 1, 0, 1, 0),
        flat("second", "m", .5, 2, 0, 1, 1, False), flat("receiver", "k", 1.1, 3, 0, 1, 0)]


def thrice(n):
    """Lamp, three lobes, receiver."""
    return {"e": E, "m": lobe(n), "k": K}, [
        flat("lamp", "e", -.4, -.2, .4, .6, 1, False), flat("first", "m", 0, 1, 0, 1, 0),
        flat("second", "m", .5, 1.8, 0, 1, 1, False), flat("third", "m", 1.1, 2.2, 0, 1, 0),
        flat("receiver", "k", 1.9, 3.5, 0, 1, 1, False)]


def corner(n):
    """Two glossy plates at right angles send light back and forth."""
    return {"e": E, "m": lobe(n), "k": K}, [
        flat("lamp", "e", .7, 1, .4, .6, 1, False), flat("floor", "m", 0, 1, 0, 1, 0),
        wall("side", "m", 0, 0, 1, 0, 1), flat("receiver", "k", -.5, .65, 0, 1, 1.2, False)]


def pane(n):
    """Through a frosted pane, then another."""
    sheet = mat({"tau_s": .9, "n": n}, {"tau_s": .9, "n": n})
    return {"e": E, "m": sheet, "k": K}, [
        flat("lamp", "e", .4, .6, .4, .6, 2, False), flat("upper", "m", 0, 1, 0, 1, 1.4),
        flat("lower", "m", 0, 1, 0, 1, .7), flat("receiver", "k", 0, 1, 0, 1, 0)]


def mirror_lobe(n):
    """Lamp, mirror, lobe, receiver."""
    return {"e": E, "s": mat(rho_s=.8, n="inf"), "m": lobe(n), "k": K}, [
        flat("lamp", "e", -.4, -.2, .4, .6, 1, False), flat("mirror", "s", 0, 1, 0, 1, 0),
        flat("gloss", "m", .5, 2, 0, 1, 1, False), flat("receiver", "k", 1.1, 3, 0, 1, 0)]


def lobe_mirror(n):
    """Lamp, lobe, mirror, receiver."""
    materials, faces = mirror_lobe(n)
    for f in faces:
        f["mat"] = {"s": "m", "m": "s"}.get(f["mat"], f["mat"])
    return materials, faces


def partition(n):
    """A room whose floor shines, a glossy partition across it; all walls receive."""
    r = mat(rho_d=.3)
    side = {"rho_s": .4, "tau_s": .4, "n": n}
    return {"e": mat(E=1, rho_d=.3), "r": r, "m": mat(side, side)}, [
        flat("floor", "e", 0, 1, 0, 1, 0), flat("receiver ceiling", "r", 0, 1, 0, 1, 1, False),
        wall("receiver a", "r", 0, 0, 1, 0, 1), wall("receiver b", "r", 1, 0, 1, 0, 1, False),
        face("receiver c", "r", (0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0)),
        face("receiver d", "r", (0, 1, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1)),
        flat("partition", "m", 0, 1, 0, 1, .5)]


def lit_spot(n):
    """A lobe mirrors a wall of which a lamp lights a part."""
    return {"e": E, "w": mat(rho_d=.8), "m": lobe(n), "k": K}, [
        wall("white", "w", 0, 0, 1, 0, 1), flat("lamp", "e", .02, .22, .1, .3, 1.1, False),
        flat("gloss", "m", .3, 1.5, 0, 1, 0), wall("receiver", "k", 1.8, 0, 1, 0, 1, False)]


SCENES = {f.__name__: f for f in (near_source, two_sources, twice, thrice, corner, pane, mirror_lobe,
                                  lobe_mirror, partition, lit_spot)}


def spent(call):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    result = call()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return result, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def truth(mesh, samples):
    rows = table(run("reference", mesh, "--irradiance", "--samples", samples).stdout)
    return np.array([r["H_0"] for r in rows]), np.array([r["SE_0"] for r in rows])


def solve(path, options):
    run("ffcalc", path(".mesh"), "-o", path(".ff"), *options)
    paper = ["--paper"] if any("--paper" in o for o in options) else []
    run("shoot", *paper, path(".mesh"), path(".ff"), "-o", path(".rad"), "-e", "1e-5")
    return chain_field(path(".rad"))[0]


class Result:
    """How far one scheme is off on what receives directional light, in parts of its mean."""

    def __init__(self, field, h, error, seconds):
        rows = field.faces("receiver*", "front")
        area = field.area[rows] / field.area[rows].sum()
        mean = area @ h[rows]
        self.rms = np.sqrt(area @ (field.h[rows] - h[rows]) ** 2) / mean
        self.flux = area @ (field.h[rows] - h[rows]) / mean
        self.noise = np.sqrt(area @ error[rows] ** 2) / mean
        self.stated = np.sqrt(area @ field.error[rows] ** 2) / mean
        self.seconds = seconds


def make_mesh(path, size, refine):
    """The scene's mesh, refined so many times by solutions of the default."""
    options = [path(".gltf"), "-o", path(".mesh"), "-p", size, "-e", size]
    run("mesh", *options)
    for _ in range(refine):
        solve(path, SCHEMES["default"])
        run("mesh", *options, "--refine", path(".rad"))


def compare(name, n, schemes, samples, size, refine=0):
    """A Result for each scheme, by name."""
    with tempfile.TemporaryDirectory() as folder:
        path = lambda suffix: os.path.join(folder, "scene" + suffix)
        scene_of(name, *SCENES[name](n)).write(path(".gltf"))
        make_mesh(path, size, refine)
        h, error = truth(path(".mesh"), samples)
        for scheme in schemes:
            field, seconds = spent(lambda: solve(path, SCHEMES[scheme]))
            yield scheme, Result(field, h, error, seconds)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("-n", default="20,1000", help="exponents")
    p.add_argument("-s", "--schemes", default="paper,paper closed,centroid,one lobe,default",
                   help=", ".join(SCHEMES))
    p.add_argument("--size", type=float, default=.25, help="of patches and elements")
    p.add_argument("--samples", type=int, default=4000000, help="particles of the yardstick")
    p.add_argument("--refine", type=int, default=0, help="how often the mesh is refined")
    p.add_argument("scenes", nargs="*", metavar="SCENE", help=", ".join(SCENES))
    a = p.parse_args()
    print("| scene | exponent | scheme | rms error | of flux | yardstick | stated | seconds |\n"
          "| --- | ---: | --- | ---: | ---: | ---: | ---: | ---: |")
    for name in a.scenes or SCENES:
        for n in a.n.split(","):
            for scheme, r in compare(name, float(n), a.schemes.split(","), a.samples, a.size,
                                     a.refine):
                print(f"| {name} | {n} | {scheme} | {100 * r.rms:.2f} % | {100 * r.flux:+.2f} % | "
                      f"{100 * r.noise:.2f} % | {100 * r.stated:.2f} % | {r.seconds:.2f} |", flush=True)


if __name__ == "__main__":
    main()
