#!/usr/bin/python3
"""Speed against error: runs cornell and two-pass through the chain at a few settings
and prints markdown tables of what each stage took and how far the picture is from an
unbiased path-traced one. BUILD says where the programs are (default build)."""
import argparse
import json
import os
import resource
import shutil
import statistics
import sys
import tempfile
import time

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from chain import TOP, Failed, picture, run

SCENES = {"cornell": ("classic", "256x256"), "two-pass": ("overview", "320x240")}
FINE = ["-n", 16384]
SETTINGS = [  # name, options of mesh, ffcalc and trace
    ("default", [], [], []),
    ("`trace --samples 16 --lobe-samples 4`", [], [], ["--samples", 16, "--lobe-samples", 4]),
    ("`ffcalc -n 1024`", [], ["-n", 1024], []),
    ("`ffcalc -n 16384`", [], FINE, []),
    ("`mesh -e 2%`, `ffcalc -n 16384`", ["-e", "2%"], FINE, []),
    ("`ffcalc -m hemicube`", [], ["-m", "hemicube"], [])]
STAGES = ("mesh", "ffcalc", "shoot", "first view", "further view")


def timed(tool, *arguments):
    """Elapsed and processor seconds of a run."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    run(tool, *arguments, seconds=3600)
    elapsed, after = time.monotonic() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    return np.array([elapsed, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime])


class Scene:
    """A scene in a directory of its own, with its yardstick."""

    def __init__(self, name, work, samples):
        self.name, self.work = name, os.path.join(work, name)
        self.camera, self.size = SCENES[name]
        os.makedirs(self.work, exist_ok=True)
        self.gltf = shutil.copy(os.path.join(TOP, "scenes", name + ".gltf"), self.work)
        with open(self.gltf) as f:
            self.views = sum("camera" in node for node in json.load(f)["nodes"])
        run("mesh", self.gltf, "-o", self.path("mesh"))
        self.exact = [self.path(f"reference{seed}.exr") for seed in (1, 2)]
        for i, exact in enumerate(self.exact):
            run("reference", self.path("mesh"), "-c", self.camera, "-s", self.size, "--seed", i + 1,
                "--samples", samples // 2, "--compression", "none", "-o", exact, seconds=3600)

    def path(self, extension):
        return os.path.join(self.work, f"{self.name}.{extension}")

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

    def errors(self):
        """Relative rmse as exrcmp has it; the same without the pixels that see a lamp
        and without the yardstick's noise; relative bias there. The yardstick is two
        independent pictures b, b': the mean of (a - b) (a - b') has none of their
        variance in it, whatever that is."""
        view = os.path.join(self.work, "first", self.camera + ".exr")
        rgb = json.loads(run("exrcmp", "-q", "--json", view, self.exact[0]).stdout)["rgb"]
        keep = ~self.sees_lamp()
        a, *b = (np.array([p[c][keep] for c in "RGB"])
                 for p in map(picture, (view, *self.exact)))
        mean, square = np.mean(b), np.mean((a - b[0]) * (a - b[1]))
        return rgb["relative_rmse"], np.sqrt(max(0, square)) / mean, np.mean(a) / mean - 1


def seconds(pair):
    return " / ".join(f"{max(0, s):.2f}" if s < 10 else f"{s:.0f}" for s in pair)


def row(scene, setting, mesh, ffcalc, trace, repeat):
    runs = [scene.chain(mesh, ffcalc, trace) for _ in range(repeat)]
    spent = [[statistics.median(r[i][k] for r in runs) for k in (0, 1)] for i in range(len(STAGES))]
    whole, own, bias = scene.errors()
    return [scene.name, setting, *map(seconds, spent), f"{100 * whole:.1f} %", f"{100 * own:.1f} %",
            f"{100 * bias:+.2f} %"]


def machine():
    model = "unknown processor"
    with open("/proc/cpuinfo") as f:
        for line in f:
            if line.startswith("model name"):
                model = line.split(":")[1].strip()
                break
    return f"{model}, {len(os.sched_getaffinity(0))} processors"


def line(cells):
    print("| " + " | ".join(cells) + " |", flush=True)


def main():
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument("--samples", type=int, default=1024,
                   help="paths a pixel of the yardstick, in two halves")
    p.add_argument("--repeat", type=int, default=3, help="runs whose median is printed")
    p.add_argument("--defaults-only", action="store_true",
                   help="leave out the other settings")
    p.add_argument("--work", help="keep all files here (default: a temporary directory)")
    p.add_argument("scene", nargs="*", help="cornell, two-pass (default: both)")
    o = p.parse_args()
    work = o.work or tempfile.mkdtemp(prefix="twopass-report.")
    yardsticks = []
    line(["scene", "setting", *STAGES, "exrcmp", "own error", "bias"])
    line(["---"] * 2 + ["---:"] * (len(STAGES) + 3))
    try:
        for name in o.scene or SCENES:
            scene = Scene(name, work, o.samples)
            yardsticks.append(f"{name} {scene.camera} {scene.size}")
            for setting in SETTINGS[:1] if o.defaults_only else SETTINGS:
                line(row(scene, *setting, o.repeat))
        print("\nSeconds are elapsed / processor time, medians of "
              f"{o.repeat}.\nYardstick: {o.samples} paths a pixel; " + "; ".join(yardsticks) + ".")
        print(f"Machine: {machine()}, load at the end {os.getloadavg()[0]:.1f}.")
    except Failed as e:
        sys.exit(f"report: {e}")
    finally:
        if not o.work:
            shutil.rmtree(work)


main()
