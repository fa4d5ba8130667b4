#!/usr/bin/python3
"""Speed against error: runs cornell and two-pass through the chain, with each method of
ffcalc at four settings and with other settings of mesh and trace, and prints a markdown
table of what each stage took and how far picture and irradiance are from unbiased ones.

  picture     relative rmse of the first view, without the pixels that see a lamp and
              without the yardstick's noise
  bias        of its mean, likewise
  irradiance  relative rmse over element-sides, weighted by area, without that noise

The yardsticks, pictures and particles of `reference`, are two independent runs b, b' each:
the mean of (a - b) (a - b') has none of their variance in it, whatever that is. With
--work DIR they are kept there for the next run; remove DIR when scenes or `reference`
changed. --plot DIR writes form-factors.svg, .png and .dat: the processor seconds of mesh,
ffcalc and shoot against both errors, a curve for each method (gnuplot).
BUILD says where the programs are (default build)."""
import argparse
import json
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from chain import TOP, Failed, picture, run, table

SCENES = {"cornell": ("classic", "256x256"), "two-pass": ("overview", "320x240")}
SMOOTH = ["--samples", 16, "--lobe-samples", 4]
METHODS = {  # options of ffcalc, from fast to fine
    "hemicube": ["-n 16 -p 4", "-n 32 -p 4", "-n 32 -p 16", "-n 64 -p 16"],
    "rays": ["-n 256", "-n 1024", "-n 4096", "-n 16384"],
    "analytic": ["-n 256 -t 1e-2", "-n 1024 -t 1e-3", "-n 4096 -t 1e-4", "-n 16384 -t 1e-5"],
    "auto": ["-n 256 -t 1e-3", "-n 1024 -t 1e-3", "-n 4096 -t 1e-4", "-n 16384 -t 1e-5"]}
OTHERS = [  # name, options of mesh, ffcalc and trace
    ("all defaults", [], [], []),
    ("`mesh -e 2%`", ["-e", "2%"], [], SMOOTH),
    ("`mesh -e 2%`, `ffcalc -n 16384`", ["-e", "2%"], ["-n", 16384], SMOOTH)]
STAGES = ("mesh", "ffcalc", "shoot", "first view", "further view")


def timed(tool, *arguments):
    """Elapsed and processor seconds of a run."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    run(tool, *arguments, seconds=3600)
    elapsed, after = time.monotonic() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    return np.array([elapsed, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime])


class Scene:
    """A scene in a directory of its own, with its yardsticks."""

    def __init__(self, name, work, samples, particles):
        self.name, self.work = name, os.path.join(work, name)
        self.camera, self.size = SCENES[name]
        os.makedirs(self.work, exist_ok=True)
        self.gltf = shutil.copy(os.path.join(TOP, "scenes", name + ".gltf"), self.work)
        with open(self.gltf) as f:
            self.views = sum("camera" in node for node in json.load(f)["nodes"])
        run("mesh", self.gltf, "-o", self.path("mesh"))
        view = ("-c", self.camera, "-s", self.size, "--compression", "none")
        self.exact = [self.yardstick(f"{samples}.{seed}.exr", seed, samples // 2, *view)
                      for seed in (1, 2)]
        self.lit = [self.yardstick(f"{particles}.{seed}.csv", seed, particles // 2, "--irradiance")
                    for seed in (1, 2)]

    def path(self, extension):
        return os.path.join(self.work, f"{self.name}.{extension}")

    def yardstick(self, extension, seed, samples, *what):
        """A file made by `reference`, if it is not there yet."""
        path = self.path("reference." + extension)
        if not os.path.exists(path):
            run("reference", self.path("mesh"), *what, "--seed", seed, "--samples", samples,
                "-o", path, seconds=3600)
        return path

    def render(self, where, camera, options):
        """A camera, or all, anew into directory `where`."""
        directory = os.path.join(self.work, where)
        shutil.rmtree(directory, ignore_errors=True)
        os.makedirs(directory)
        return timed("trace", self.path("rad"), "-c", camera, "-s", self.size, *options,
                     "--compression", "none", "-o", directory + "/%s.exr")

    def chain(self, mesh, ffcalc, trace):
        """Elapsed and processor seconds of each stage, everything made anew."""
        for extension in ("mesh", "ff", "rad"):
            if os.path.exists(self.path(extension)):
                os.remove(self.path(extension))
        spent = [timed("mesh", *mesh, self.gltf, "-o", self.path("mesh")),
                 timed("ffcalc", *ffcalc, self.path("mesh"), "-o", self.path("ff")),
                 timed("shoot", self.path("mesh"), self.path("ff"), "-o", self.path("rad")),
                 self.render("first", self.camera, trace)]
        further = self.render("all", "all", trace) - spent[-1]
        return spent + [further / (self.views - 1)]

    def sees_lamp(self):
        """The pixels that an emitter touches."""
        self.render("lamp", self.camera, ("--samples", 64, "--layers", "emission"))
        lamp = picture(os.path.join(self.work, "lamp", self.camera + ".exr"))
        return sum(lamp["emission." + c] for c in "RGB") > 0

    def picture_errors(self):
        """Relative rmse and bias of the first view."""
        view = os.path.join(self.work, "first", self.camera + ".exr")
        keep = ~self.sees_lamp()
        a, *b = (np.array([p[c][keep] for c in "RGB"])
                 for p in map(picture, (view, *self.exact)))
        return off(a, *b), np.mean(a) / np.mean(b) - 1

    def irradiance_error(self):
        """Of element-sides; of the default mesh only."""
        tables = [table(run("inspect", self.path("rad"), "--csv").stdout)]
        for path in self.lit:
            with open(path) as f:
                tables.append(table(f.read()))
        area, places = np.array([r["area"] for r in tables[0]]), [
            [(r["element"], r["side"][0]) for r in t] for t in tables]
        if places[0] != places[1] or places[0] != places[2]:
            raise Failed("the yardstick is of another mesh: remove --work's directory")
        return off(*(np.array([[r[f"H_{k}"] for r in t] for k in range(3)]) for t in tables), area)


def off(a, b, c, weight=None):
    """Relative rmse of a against b and c, without their noise."""
    weight = np.ones(a.shape[1]) if weight is None else weight
    square, mean = ((x * weight).mean() / weight.mean() for x in ((a - b) * (a - c), (b + c) / 2))
    return np.sqrt(max(0, square)) / mean


def seconds(pair):
    return " / ".join(f"{max(0, s):.2f}" if s < 10 else f"{s:.0f}" for s in pair)


class Row:
    """A setting: median times [stage][elapsed, processor] and errors."""

    def __init__(self, scene, name, mesh, ffcalc, trace, repeat, method=""):
        runs = [scene.chain(mesh, ffcalc, trace) for _ in range(repeat)]
        self.scene, self.name, self.method = scene.name, name, method
        self.spent = [[statistics.median(r[i][k] for r in runs) for k in (0, 1)]
                      for i in range(len(STAGES))]
        self.picture, self.bias = scene.picture_errors()
        self.irradiance = None if mesh else scene.irradiance_error()

    def solution(self):
        """Processor seconds up to the solution."""
        return sum(spent[1] for spent in self.spent[:3])

    def cells(self):
        lit = "" if self.irradiance is None else f"{100 * self.irradiance:.1f} %"
        return [self.scene, self.name, *map(seconds, self.spent), f"{100 * self.picture:.1f} %",
                f"{100 * self.bias:+.2f} %", lit]


def rows_of(scene, o):
    """Of the methods chosen, and the other settings unless there is a choice."""
    for method, settings in METHODS.items():
        for options in settings if method in o.method else ():
            words = ["-m", method, *options.split()]
            yield Row(scene, f"`-m {method} {options}`", [], words, SMOOTH, o.repeat, method)
    for name, *stages in OTHERS if o.others else ():
        yield Row(scene, name, *stages, o.repeat)


# ---- the plot ----

PLOT = """
set logscale xy
set grid xtics ytics mytics lc rgb '#bbbbbb', lc rgb '#e4e4e4'
set key inside right top samplen 2 opaque
set multiplot layout {scenes},2
set xlabel 'processor seconds of mesh, ffcalc and shoot'
set format y '%g'
{panels}
unset multiplot
"""
KINDS = {"svg": "svg size 1000,{high} font 'Helvetica,13' background 'white'",
         "png": "pngcairo size 1000,{high} font 'Helvetica,10'"}


def plot(rows, directory):
    """A panel for each scene and kind of error, a curve for each method."""
    os.makedirs(directory, exist_ok=True)
    data, panels = [], []
    curves = sorted({(r.scene, r.method) for r in rows if r.method},
                    key=lambda c: (list(SCENES).index(c[0]), list(METHODS).index(c[1])))
    for scene, method in curves:
        data.append(f"# {scene} {method}: seconds, picture %, irradiance %\n" + "".join(
            f"{r.solution():.3f} {100 * r.picture:.3f} {100 * r.irradiance:.3f}\n"
            for r in rows if (r.scene, r.method) == (scene, method)))
    scenes = list(dict.fromkeys(scene for scene, _ in curves))
    for scene in scenes:
        for column, what in ((2, "picture"), (3, "irradiance of elements")):
            panels.append(f"set title '{scene}: {what}, error in %'\nplot " + ", ".join(
                f"'form-factors.dat' index {i} using 1:{column} with linespoints pt 7 ps .7 lw 2 "
                f"lc {list(METHODS).index(method) + 1} title '{method}'"
                for i, (s, method) in enumerate(curves) if s == scene))
    with open(os.path.join(directory, "form-factors.dat"), "w") as f:
        f.write("\n\n".join(data))
    for kind, terminal in KINDS.items():
        words = (f"set terminal {terminal.format(high=300 * len(scenes))}\n"
                 f"set output 'form-factors.{kind}'\n" +
                 PLOT.format(scenes=len(scenes), panels="\n".join(panels)))
        if subprocess.run(["gnuplot"], input=words, text=True, check=False, cwd=directory).returncode:
            raise Failed(f"gnuplot could not draw {directory}/form-factors.{kind}")


# ---- the table ----

def machine():
    model = "unknown processor"
    with open("/proc/cpuinfo") as f:
        for words in f:
            if words.startswith("model name"):
                model = words.split(":")[1].strip()
                break
    return f"{model}, {len(os.sched_getaffinity(0))} processors"


def line(cells):
    print("| " + " | ".join(cells) + " |", flush=True)


def arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("--samples", type=int, default=1024,
                   help="paths a pixel of the yardstick, in two halves")
    p.add_argument("--particles", type=int, default=64_000_000, help="likewise for irradiance")
    p.add_argument("--repeat", type=int, default=3, help="runs whose median is printed (3)")
    p.add_argument("--method", action="append", choices=list(METHODS),
                   help="this method, may be repeated (default: all, and other settings)")
    p.add_argument("--work", help="keep all files here (default: a temporary directory)")
    p.add_argument("--plot", metavar="DIR", help="plot into this directory")
    p.add_argument("scene", nargs="*", help="cornell, two-pass (default: both)")
    o = p.parse_args()
    o.others, o.method = not o.method, o.method or list(METHODS)
    return o


def main():
    o = arguments()
    work = o.work or tempfile.mkdtemp(prefix="twopass-report.")
    rows, names = [], o.scene or list(SCENES)
    line(["scene", "setting", *STAGES, "picture", "bias", "irradiance"])
    line(["---"] * 2 + ["---:"] * (len(STAGES) + 3))
    try:
        for name in names:
            for row in rows_of(Scene(name, work, o.samples, o.particles), o):
                rows.append(row)
                line(row.cells())
        if o.plot:
            plot(rows, o.plot)
    except Failed as e:
        sys.exit(f"report: {e}")
    finally:
        if not o.work:
            shutil.rmtree(work)
    print(f"\nSeconds are elapsed / processor time, medians of {o.repeat}.\n"
          f"Views by `trace {' '.join(map(str, SMOOTH))}`, but for all defaults.\n"
          f"Yardsticks: {o.samples} paths a pixel, {o.particles} particles; "
          + "; ".join(f"{name} {' '.join(SCENES[name])}" for name in names) +
          f".\nMachine: {machine()}, load at the end {os.getloadavg()[0]:.1f}.")


main()
