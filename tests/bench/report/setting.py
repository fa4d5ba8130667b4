"""A setting of the chain, run on a scene: what each stage took, what it states about its
own errors, and what these are."""
import os
import shutil
import statistics

from chain import run
from measure import fresh, ran
from yardstick import irradiance

STATED = {  # what the programs say of their own errors
    "sampling": r"^sampling .*; ([\d.e+-]+) rms",
    "elements": r"^elements +([\d.e+-]+) relative",
    "residual": r"^residual +([\d.e+-]+)"}
STATED_PICTURE = r"estimated relative rmse[ :]+([\d.e+-]+)"


class Solution:
    """Options of mesh, ffcalc and shoot. refined: how often the mesh is refined (with
    options of --refine) by a solution with form factors of other options, `earlier`."""

    def __init__(self, name, mesh=(), ffcalc=(), refined=0, refine=(), earlier=None, method=""):
        self.name, self.method, self.refined, self.refine = name, method, refined, list(refine)
        self.mesh, self.ffcalc = list(mesh), list(ffcalc)
        self.earlier = list(ffcalc if earlier is None else earlier)

    def of_default_mesh(self):
        return not self.mesh and not self.refined


class Solved:
    """A solution in scene.path("rad"), everything made anew `repeat` times: median
    processor seconds of mesh, ffcalc and shoot, and what the last runs said."""

    def __init__(self, scene, solution, repeat=1, threads=None):
        self.scene, self.solution, self.stated = scene, solution, {}
        runs = [self.once(threads) for _ in range(repeat)]
        self.cpu = [statistics.median(r[i].cpu for r in runs) for i in range(3)]
        self.elapsed = statistics.median(sum(stage.elapsed for stage in r) for r in runs)
        self.stages = runs[-1]
        self.memory = max(stage.memory() or 0 for stage in self.stages)
        for name, pattern in STATED.items():
            self.stated[name] = self.stages[2].said(pattern)
        self.elements = self.stages[0].said(r"^elements +(\d+)")
        self.irradiance = None
        if solution.of_default_mesh():
            field = irradiance(run("inspect", scene.path("rad"), "--csv").stdout)
            self.irradiance = scene.irradiance_error(field)

    def once(self, threads):
        scene, o = self.scene, self.solution
        mesh, ff, rad = (scene.path(e) for e in ("mesh", "ff", "rad"))
        total = None
        for round_ in range(o.refined + 1):
            refine = ["--refine", rad, *o.refine] if round_ else []
            ffcalc = o.earlier if round_ < o.refined else o.ffcalc
            made = scene.path("refined.mesh")
            stages = [ran("mesh", *o.mesh, *refine, scene.gltf, "-o", fresh(made), threads=threads)]
            os.replace(made, mesh)
            stages += [ran("ffcalc", *ffcalc, mesh, "-o", fresh(ff), threads=threads),
                       ran("shoot", mesh, ff, "-o", fresh(rad), threads=threads)]
            for before, stage in zip(total or (), stages):
                stage.cpu += before.cpu
                stage.elapsed += before.elapsed
            total = stages
        return total

    def seconds(self):
        return sum(self.cpu)


class View:
    """The scene's first view by some options of trace, from what is solved."""

    def __init__(self, solved, name, options, repeat=1, threads=None, further=False):
        self.solved, self.name, self.options, scene = solved, name, options, solved.scene
        runs = [self.draw(scene.camera, "first", threads) for _ in range(repeat)]
        self.cpu = statistics.median(r.cpu for r in runs)
        self.stated = runs[-1].said(STATED_PICTURE)
        self.errors = scene.picture_errors(os.path.join(scene.work, "first", scene.camera + ".exr"))
        self.further = None
        if further and scene.views > 1:
            all_views = self.draw("all", "all", threads)
            self.further = max(0, all_views.cpu - self.cpu) / (scene.views - 1)

    def draw(self, camera, where, threads):
        """A camera, or all, anew into a directory."""
        scene = self.solved.scene
        directory = os.path.join(scene.work, where)
        shutil.rmtree(directory, ignore_errors=True)
        os.makedirs(directory)
        return ran("trace", scene.path("rad"), "-c", camera, "-s", scene.size(), *self.options,
                   "--compression", "none", "-o", directory + "/%s.exr", threads=threads)

    def seconds(self):
        """Of the first view with everything before it."""
        return self.solved.seconds() + self.cpu
