#!/usr/bin/python3
"""Errors that shoot states of form factors from one hemicube a patch-side, against solutions by many
rays on the same mesh: a family of random scenes without lobes, whose ratios true/stated are printed."""
import os
import sys
import tempfile

import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from chain import Failed, Tap, container, run
from paper import Scene, scene, write

METHODS = {"-m hemicube -p 1": (["-m", "hemicube", "-n", 32, "-p", 1], []),
           "--paper=closed": (["-n", 32, "--paper=closed"], ["--paper"])}
SCENES = range(300, 316)
MATERIALS = [{"rho_d": .5}, {"emission_front": 1.}, {"rho_d": .6}, {"rho_d": .3, "tau_d": .3}]


def solution(folder, ff, solve):
    """Irradiance of element-sides, and its stated error."""
    for kind in ("ff", "rad"):
        if os.path.exists(f"{folder}/t.{kind}"):
            os.remove(f"{folder}/t.{kind}")
    run("ffcalc", "-q", *ff, f"{folder}/s.mesh", "-o", f"{folder}/t.ff")
    run("shoot", "-q", *solve, f"{folder}/s.mesh", f"{folder}/t.ff", "-o", f"{folder}/t.rad")
    _, a = container(f"{folder}/t.rad")
    parts = [np.array(a[name]).ravel() for name in ("irradiance_direct", "irradiance_indirect")]
    return sum(parts), np.array(a["irradiance_error"]).ravel()


def ratios(seed, folder):
    """{method: true over stated, root mean squares over the area}."""
    _, quads = scene(np.random.default_rng(seed))
    write(f"{folder}/s.gltf", MATERIALS, quads)
    run("mesh", "-q", "-p", "25%", "-e", "8%", f"{folder}/s.gltf", "-o", f"{folder}/s.mesh")
    true, _ = solution(folder, ["-n", 16384], [])
    area = np.repeat(Scene(f"{folder}/s.mesh", f"{folder}/t.ff").area, 2)
    found = {}
    for name, (ff, solve) in METHODS.items():
        h, stated = solution(folder, ff, solve)
        found[name] = float(np.sqrt((area * (h - true)**2).sum() / (area * stated**2).sum()))
    return found


def main():
    tap = Tap()
    found = {name: [] for name in METHODS}
    with tempfile.TemporaryDirectory() as folder:
        try:
            for seed in SCENES:
                for name, ratio in ratios(seed, folder).items():
                    found[name].append(ratio)
        except Failed as failure:
            tap.ok(False, "scenes", str(failure))
    for name, all_of_them in found.items():
        rms = float(np.sqrt(np.mean(np.square(all_of_them))))
        tap.ok(.7 <= rms <= 1.4 and max(all_of_them) <= 2, f"{name}: stated errors",
               f"rms {rms:.2f}", f"all {np.round(sorted(all_of_them), 2)}")
        print(f"# {name}: rms of true/stated {rms:.2f}, from {min(all_of_them):.2f} to {max(all_of_them):.2f}")
    tap.finish()


if __name__ == "__main__":
    main()
