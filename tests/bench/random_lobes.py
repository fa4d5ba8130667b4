#!/usr/bin/python3
"""What trace states of its error, beside what that is, over rooms of lobes drawn at random:
random_lobes.py [-s SAMPLES] [SEED...]

A room has walls that are matt, glossy or a mirror, lamps of any number and size, and sheets
that scatter or let through. For each seed a line: true and stated error and bias of a picture by
defaults, relative to its mean, and true over stated error. The true error is that beside two
independent pictures by reference, whose noise cancels in the product of both differences."""
import argparse
import os
import random
import sys
import tempfile

import numpy as np

sys.dont_write_bytecode = True
TESTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
sys.path[:0] = [os.path.join(TESTS, "independent"), os.path.join(TESTS, "..", "scenes")]
from chain import picture, run
from gltf_writer import Scene, Shape

SIZE = "32x24"
WALLS = {"x-": [(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)],
         "x+": [(1, 0, 0), (1, 0, 1), (1, 1, 1), (1, 1, 0)],
         "floor": [(0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0)],
         "ceiling": [(0, 1, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1)],
         "far": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],
         "near": [(0, 0, 1), (0, 1, 1), (1, 1, 1), (1, 0, 1)]}


def colour(rng, low, high):
    return [round(rng.uniform(low, high), 3) for _ in range(3)]


def exponent(rng):
    return round(2 * 150 ** rng.random(), 2)


def surface(rng, kind):
    if kind == "mirror":
        return {"rho_s": round(rng.uniform(.6, .9), 2)}
    if kind == "glossy":
        return {"rho_d": colour(rng, 0, .3), "rho_s": colour(rng, .2, .6), "alpha": exponent(rng)}
    return {"rho_d": colour(rng, .2, .7)}


def sheet(rng):
    """Frosted, or a clear pane, glossy on both sides or on one."""
    if rng.random() < .3:
        return {"tau_s": round(rng.uniform(.6, .95), 2)}
    side = {"tau_s": colour(rng, .3, .6), "beta": exponent(rng)}
    if rng.random() < .5:
        side |= {"rho_s": colour(rng, .05, .3), "alpha": exponent(rng)}
    return side


def write(seed, path):
    """A room as glTF, with a camera `view`."""
    rng = random.Random(seed)
    s = Scene(f"room {seed}")
    kinds = ["matt", "matt", "matt", "glossy", "glossy", rng.choice(["glossy", "mirror", "matt"])]
    rng.shuffle(kinds)
    for kind, (name, corners) in zip(kinds, WALLS.items()):
        s.shape(name, Shape().polygon(*corners), s.material(name, surface(rng, kind)))
    glow = 8 / rng.choice([1, 1, 2, 4])
    for i in range(lamps := rng.choice([1, 2, 3, 9])):
        x, z, half = rng.uniform(.15, .85), rng.uniform(.15, .85), rng.uniform(.04, .12) / lamps ** .5
        y = rng.choice([.98, .9, .7])
        lamp = s.material(f"lamp {i}", {"rho_d": .3}, glow=[glow / half, glow / half, .8 * glow / half])
        s.shape(f"lamp {i}", Shape().polygon((x - half, y, z - half), (x + half, y, z - half),
                                             (x + half, y, z + half), (x - half, y, z + half)), lamp)
    for i in range(rng.choice([0, 1, 1, 2])):
        z, slant = rng.uniform(.2, .7), rng.uniform(-.1, .1)
        x0, x1, y1 = rng.uniform(.05, .4), rng.uniform(.6, .95), rng.uniform(.4, .65)
        shape = Shape().polygon((x0, .02, z - slant), (x1, .02, z - slant), (x1, y1, z + slant),
                                (x0, y1, z + slant))
        s.shape(f"sheet {i}", shape, s.material(f"sheet {i}", sheet(rng), double_sided=True))
    s.camera("view", (rng.uniform(.3, .7), rng.uniform(.4, .6), .97),
             (rng.uniform(.3, .7), rng.uniform(.2, .5), 0), 75, 4 / 3)
    s.write(path)


def colours(channels, prefix=""):
    return np.stack([channels[prefix + c] for c in "RGB"], -1)


def compare(seed, samples, folder):
    """{true, stated, bias, ratio} of the room's picture, relative to its mean."""
    at = os.path.join(folder, f"room{seed}")
    write(seed, at + ".gltf")
    lobe = ["--lobe", "reciprocal"]  # the variance of eye paths over the paper's diverges
    run("mesh", "-q", *lobe, "-e", "12%", "-p", "12%", at + ".gltf", "-o", at + ".mesh")
    run("ffcalc", "-q", "-n", 512, at + ".mesh", "-o", at + ".ff")
    run("shoot", "-q", at + ".mesh", at + ".ff", "-o", at + ".rad")
    view = ["trace", "-q", "-c", "view", "-s", SIZE, "--compression", "none", at + ".rad"]
    run(*view, "--layers", "error", "-o", at + ".exr")
    run(*view, "--layers", "emission", "-d", "mesh", "--samples", 256, "--lobe-samples", 0,
        "-o", at + "0.exr")
    for k in "12":
        run("reference", "-q", "-c", "view", "-s", SIZE, "--samples", samples, "--seed", k,
            "--compression", "none", at + ".mesh", "-o", at + k + ".exr")
    seen = picture(at + ".exr")
    a, b, c = colours(seen), colours(picture(at + "1.exr")), colours(picture(at + "2.exr"))
    keep = (colours(picture(at + "0.exr"), "emission.") == 0).all(-1)
    keep &= abs(b - c).max(-1) <= np.quantile(abs(b - c).max(-1)[keep], .98)  # no fireflies
    mean = (b + c)[keep].mean() / 2
    square, stated = ((a - b) * (a - c))[keep].mean(), (colours(seen, "error.")[keep] ** 2).mean()
    true = np.sqrt(max(square, 0))
    return {"true": true / mean, "stated": np.sqrt(stated) / mean, "ratio": true / np.sqrt(stated),
            "bias": (a - (b + c) / 2)[keep].mean() / mean}


def spread(ratios):
    """Root mean square, median and the largest."""
    return np.sqrt(np.mean(np.square(ratios))), np.median(ratios), max(ratios)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("-s", "--samples", type=int, default=1024, help="of reference, a pixel")
    parser.add_argument("seed", type=int, nargs="*", default=range(1, 31))
    given = parser.parse_args()
    ratios = []
    print("seed  true %  stated %  bias %  true / stated")
    with tempfile.TemporaryDirectory() as folder:
        for seed in given.seed:
            r = compare(seed, given.samples, folder)
            ratios.append(r["ratio"])
            print(f"{seed:4} {100 * r['true']:7.2f} {100 * r['stated']:9.2f} {100 * r['bias']:+7.2f} "
                  f"{r['ratio']:8.2f}", flush=True)
    print("rms {:.2f}, median {:.2f}, largest {:.2f}".format(*spread(ratios)))


if __name__ == "__main__":
    main()
