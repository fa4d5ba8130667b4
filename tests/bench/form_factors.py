#!/usr/bin/python3
"""Form factors between patches, speed against error: runs ffcalc on the scenes of
ff_scenes.py on one core and prints a markdown table.

form_factors.py [--scene NAME]... [--run OPTIONS]...

  user, elapsed   seconds of the whole process, medians
  of bare         user, over the processor seconds that a bare Embree loop (build/bench/rays)
                  takes for 4 M rays of the same mesh, run beside each; median of the ratios
  memory          peak, MB
  bytes           of the file for each factor that is not 0
  row sums        largest |1 - sum| before scaling
  max, rms        error of a factor
  worst           relative error of a factor
  yardstick       what the errors are against, and its own largest and rms error

The yardstick of a cube is the exact factor. Else it is two independent runs, of rays for
`-m analytic` and `-m auto`, of analytic for the rest: max is against their mean (its own error
is half their difference, and max cannot be told from that), rms is that of both together, (a -
b) (a - b'), and has none of the yardstick's noise in it. There worst is not known. Over 6000
patches only time and size are measured. Yardsticks are kept in BUILD/form-factors and made
anew when the scene changes or with --fresh: use that when ffcalc changed."""
import argparse
import hashlib
import os
import statistics
import subprocess
import sys

import numpy as np

sys.dont_write_bytecode = True
HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "..", "exact"), os.path.join(HERE, "..", "independent")]
from chain import BUILD, Failed, container, form_factors, run
from cube_factors import cube_factors
from ff_scenes import make

SCENES = ["cube16", "cube24", "room", "room-turned", "city100", "city370", "city2100"]
LARGE = "cube58"  # one run in minutes
RUNS = ["-m analytic --to patches", "-m analytic --to patches -t 1e-6", "-m auto --to patches",
        "-m rays -n 4096", "-m rays -n 65536", "-m hemicube -n 64 -p 16"]
TUNED = {"room": "2e-8", "room-turned": "2e-8", "city100": "2e-5", "city370": "8e-6",
         "city2100": "6e-5"}
EXACT, RAYS, ANALYTIC = "exact", "-m rays -n {rays} --seed {seed}", "-m analytic --to patches -t 1e-8"
BARE_RAYS, MOST = 4_000_000, 6000
HEAD = ["scene", "patches", "ffcalc", "user", "elapsed", "of bare", "memory", "bytes", "row sums",
        "max", "rms", "worst", "yardstick"]


# A process counts the memory of the one that started it as its own peak, so a small one
# does, without numpy. Its last line: user seconds, elapsed seconds, bytes.
LAUNCHER = """
import os, sys, time
begun = time.monotonic()
pid = os.posix_spawnp(sys.argv[1], sys.argv[1:], os.environ)
_, status, used = os.wait4(pid, 0)
print(f"\\n{used.ru_utime} {time.monotonic() - begun} {used.ru_maxrss * 1024}", end="")
sys.exit(os.waitstatus_to_exitcode(status))
"""


class Measured:
    """A program run on processor 0: user and elapsed seconds, peak bytes, output."""

    def __init__(self, *words):
        done = subprocess.run([sys.executable, "-IS", "-c", LAUNCHER, "taskset", "-c", "0",
                               *map(str, words)], capture_output=True, text=True, check=False)
        self.text, _, used = done.stdout.rpartition("\n")
        said = [line for line in done.stderr.splitlines() if not line.startswith("Try ")]
        if done.returncode:
            raise Failed(said[-1] if said else f"{words[0]} exited {done.returncode}")
        self.user, self.elapsed, self.peak = map(float, used.split())


class Scene:
    def __init__(self, name, work, fresh, rays):
        self.name, self.work, self.fresh, self.rays = name, work, fresh, rays
        os.makedirs(work, exist_ok=True)
        self.mesh = os.path.join(work, name + ".mesh")
        gltf = os.path.join(work, name + ".gltf")
        self.patches = make(name).write(gltf)
        with open(gltf, "rb") as f:
            self.digest = hashlib.sha256(f.read()).hexdigest()[:8]
        run("mesh", "-p", "inf", "-e", "inf", gltf, "-o", self.mesh)
        self.known = {}

    def bare(self):
        """Processor seconds for BARE_RAYS: those elapsed, by the share that others left."""
        ran = Measured(os.path.join(BUILD, "bench", "rays"), self.mesh, BARE_RAYS, 1)
        rate = dict(words.split() for words in ran.text.splitlines() if words)["mray_per_s"]
        return BARE_RAYS / 1e6 / float(rate) * min(1, ran.user / ran.elapsed)

    def exact(self):
        _, a = container(self.mesh)
        corner = a["vertex"][a["loop_index"].reshape(-1, 4)]
        return [cube_factors(int(self.name[4:]), corner)]

    def converged(self, options):
        """The matrix of a long run with all processors, from the cache if it is there."""
        key = hashlib.sha256(options.encode()).hexdigest()[:8]
        path = os.path.join(self.work, f"{self.name}-{self.digest}-{key}.npy")
        if self.fresh or not os.path.exists(path):
            ff = path[:-4] + ".ff"
            run("ffcalc", *options.split(), "--precision", "f64", self.mesh, "-o", ff, seconds=7200)
            os.rename(matrix_file(ff), path)
            os.remove(ff)
        return np.load(path)[:, :self.patches]

    def yardstick(self, options):
        """Its name and one matrix or two."""
        name = EXACT if self.name.startswith("cube") else \
            RAYS if {"analytic", "auto"} & set(options.split()) else ANALYTIC
        if name not in self.known:
            if name == EXACT:
                self.known[name] = self.exact()
            elif name == RAYS:
                self.known[name] = [self.converged(RAYS.format(rays=self.rays, seed=seed))
                                    for seed in (101, 102)]
            else:
                self.known[name] = [self.converged(ANALYTIC)]
        return name.format(rays=self.rays, seed="…"), self.known[name]


def matrix_file(ff):
    """Its patch matrix, as a file beside it."""
    path = ff[:-3] + ".matrix.npy"
    run("inspect", "--npy", "patch-matrix", "-o", path, ff)
    return path


def root_mean(squares):
    return float(np.sqrt(max(0, np.mean(squares, dtype=np.longdouble))))


def errors(got, name, yardstick):
    """Cells of the table: max, rms, worst, yardstick."""
    if not np.isfinite(got).all():
        return ["", "", "", "a row is missing"]
    first, last = yardstick[0], yardstick[-1]
    off = abs(got - (first + last) / 2)
    cells = [f"{float(off.max()):.1e}", f"{root_mean((got - first) * (got - last)):.1e}"]
    if name == EXACT:
        return cells + [f"{float((off[first > 0] / first[first > 0]).max()):.1e}", name]
    noise = (first - last) / 2
    return cells + ["", f"{name}: {abs(noise).max():.1e}, {root_mean(noise ** 2):.1e}"
                    if len(yardstick) > 1 else name]


def row(scene, options, repeat):
    ff = os.path.join(scene.work, scene.name + ".run.ff")
    runs, ratios = [], []
    for _ in range(repeat):
        if os.path.exists(ff):
            os.remove(ff)
        runs.append(Measured(os.path.join(BUILD, "ffcalc"), *options.split(), "-j", 1, "-q",
                             scene.mesh, "-o", ff))
        ratios.append(runs[-1].user / scene.bare())
    median = lambda what: statistics.median(getattr(r, what) for r in runs)
    _, arrays = form_factors(ff)
    factors, judged = arrays["value"].size, [""] * 4
    if scene.patches <= MOST:
        got = np.load(matrix_file(ff))[:, :scene.patches]
        factors = np.count_nonzero(got)
        try:
            judged = errors(got, *scene.yardstick(options))
        except Failed as problem:
            judged = ["", "", "", f"none: {problem}"]
    residual = abs(arrays["row_residual"][arrays["row_kind"] == 0]).max()
    return [scene.name, str(scene.patches), f"`{options}`", f"{median('user'):.2f}",
            f"{median('elapsed'):.2f}", f"{statistics.median(ratios):.2f}", f"{median('peak') / 1e6:.0f}",
            f"{os.path.getsize(ff) / factors:.1f}", f"{residual:.1e}", *judged]


def tuned(name):
    return "-m analytic --to patches" + (f" -t {TUNED[name]}" if name in TUNED else "")


def line(cells):
    print("| " + " | ".join(cells) + " |", flush=True)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("--scene", action="append", help="default: " + ", ".join(SCENES))
    p.add_argument("--run", action="append", help="options of ffcalc; default: " + ", ".join(RUNS))
    p.add_argument("--tuned", action="store_true",
                   help="one run a scene: analytic, at the target that RESULTS.md quotes")
    p.add_argument("--repeat", type=int, default=3, help="runs whose median is printed (3)")
    p.add_argument("--rays", type=int, default=409600, help="rays a patch of that yardstick")
    p.add_argument("--fresh", action="store_true", help="make yardsticks anew")
    a = p.parse_args()
    line(HEAD)
    line(["---"] * 3 + ["---:"] * 9 + ["---"])
    work = os.path.join(BUILD, "form-factors")
    for name in a.scene or SCENES + [LARGE] * a.tuned:
        if not make(name):
            p.error(f"no scene {name}")
        scene = Scene(name, work, a.fresh, a.rays)
        for options in [tuned(name)] if a.tuned else a.run or RUNS:
            try:
                line(row(scene, options, a.repeat))
            except Failed as problem:
                line([name, str(scene.patches), f"`{options}`", *[""] * 9, str(problem)])


if __name__ == "__main__":
    main()
