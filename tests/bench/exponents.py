#!/usr/bin/python3
"""A lobe becoming a mirror, exponent by exponent, in both passes: exponents.py

The scene is mirror_virtual_image of tests/exact/data/global_illumination.json with a finite
exponent. Pass 1: irradiance of the receiver, and the same from particles (the
series phong_to_mirror of the same file). Pass 2: mean radiance of a view of the lobe.
Both are given as deviations from the mirror, too, and times the exponent, which is
about -1.4 in pass 1 where the lobe is narrow and sampling errors do not yet prevail."""
import copy
import json
import os
import sys
import tempfile

import numpy as np

sys.dont_write_bytecode = True
sys.path[:0] = [os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", folder)
                for folder in ("exact", "independent")]
from chain import DATA, picture, run
from oracle2gltf import oracles, scene_of
from oracles import chain_field

EXPONENTS = [1, 3, 10, 30, 100, 300, 1000, 3000, 10000, 100000, 1000000, "inf"]


def series():
    """{exponent: (H, standard error)} of particles, and H of the mirror."""
    with open(os.path.join(DATA, "global_illumination.json"), encoding="utf-8") as f:
        known = next(a for a in json.load(f)["analytic"] if a["id"] == "phong_to_mirror_series")["values"]
    return {float(n): (v["H"], v["se"]) for n, v in known["seed"].items()}, known["mirror"]


VIEW = ["--eye", "2.2,.5,.3", "--target", ".9,.5,1", "--up", ".3,.4,1", "--fov", 25, "-s", "128x128", "--samples", 1,
        "--compression", "none"]


def measure(exponent, folder, lobe_samples=64):
    """Irradiance of the receiver and mean radiance of the view."""
    oracle = copy.deepcopy(oracles()["mirror_virtual_image_rs1.0"])
    for m in oracle["materials"].values():
        if m["front"].get("rho_s"):
            m["front"]["n"] = exponent
    path = lambda suffix: os.path.join(folder, f"{exponent}{suffix}")
    scene_of("exponent", oracle["materials"], oracle["faces"]).write(path(".gltf"))
    run("mesh", path(".gltf"), "-o", path(".mesh"), "-p", .5, "-e", .5)
    run("ffcalc", path(".mesh"), "-o", path(".ff"), "-n", 65536, "--lobe-rays", 65536)
    run("shoot", path(".mesh"), path(".ff"), "-o", path(".rad"), "-e", 1e-9)
    field, _ = chain_field(path(".rad"))
    rows = field.faces("receiver", "front")
    h = np.average(field.h[rows], weights=field.area[rows])
    run("trace", path(".rad"), "-o", path(".exr"), *VIEW, "--lobe-samples", lobe_samples)
    return h, picture(path(".exr"))["G"].mean()


def main():
    known, mirror = series()
    with tempfile.TemporaryDirectory() as folder:
        got = {n: measure(n, folder) for n in EXPONENTS}
    h, seen = got["inf"]
    print(f"mirror: H {h:.7f} (exact {mirror:.7f}), radiance {seen:.6f}\n")
    print(f"{'exponent':>9} {'H':>10} {'particles':>10} {'off':>8} {'+-':>7} {'H/mirror - 1':>13} {'times n':>8} "
          f"{'radiance':>10} {'L/mirror - 1':>13} {'times n':>8}")
    for n in EXPONENTS[:-1]:
        truth, error = known.get(float(n), (float("nan"), float("nan")))
        off, view = got[n][0] / mirror - 1, got[n][1] / seen - 1
        print(f"{n:9} {got[n][0]:10.7f} {truth:10.7f} {100 * (got[n][0] / truth - 1):7.3f}% "
              f"{100 * error / truth:6.3f}% "
              f"{100 * off:12.4f}% {n * off:8.2f} {got[n][1]:10.6f} {100 * view:12.3f}% {n * view:8.2f}")


if __name__ == "__main__":
    main()
