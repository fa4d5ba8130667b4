"""What the machine can do, measured in the same run, and what the programs make of it."""
import os

from chain import BUILD
from measure import fresh, ran
from page import Table, Title, Words
from setting import Solution, Solved


RAYS = 4_000_000


def bare(mesh, threads, *camera):
    """Million rays a second of an Embree loop, GB a second of memory read."""
    got = ran(os.path.join("bench", "rays"), mesh, RAYS, threads, *camera)
    return got.said(r"^mray_per_s ([\d.]+)"), got.said(r"^read_gb_per_s ([\d.]+)")


def row(name, ours, theirs, unit):
    share = f"{ours / theirs:.2f}" if ours and theirs else "–"
    number = lambda x: f"{x:.2f} {unit}" if x else "–"
    return [name, number(ours), number(theirs), share]


def scenes(run):
    return [name for name in ("cornell", "clutter") if name in run.plan.scenes]


def submit(run):
    for name in scenes(run):
        run.scene(name)


def section(run):
    threads, rows = len(os.sched_getaffinity(0)), []
    for name in run.told("rates", scenes(run)):
        scene = run.scene(name)
        solved = Solved(scene, Solution("", ffcalc=["-m", "rays", "-n", 1024]))
        rays, read = bare(scene.path("mesh"), threads)
        primary, _ = bare(scene.path("mesh"), threads, "--camera", scene.camera, scene.size())
        view = ran("trace", scene.path("rad"), "-c", scene.camera, "-s", "1280x960",
                   "-d", "mesh", "--samples", 4, "-o", fresh(scene.path("rate.exr")))
        rows += [row(f"`ffcalc -m rays`, {name}: rays",
                     solved.stages[1].said(r"\(([\d.]+) Mray/s"), rays, "Mray/s"),
                 row(f"`trace -d mesh`, {name}: rays from the camera",
                     view.said(r"\(([\d.]+) Mray/s"), primary, "Mray/s"),
                 row(f"`shoot`, {name}: reading of form factors",
                     solved.stages[2].said(r"\(([\d.]+) GB/s"), read, "GB/s")]
    yield Title("What the machine can do")
    yield Words(f"""Beside each other in this run, {threads} threads: *bare* is an Embree loop over
        {RAYS // 10**6} million stored rays of the same kind (`tests/bench/rays.c`), or the
        reading of a buffer of 512 MB. The programs' rates include all that they do with a ray
        or a factor.""")
    yield Table("", ["", "ours", "bare", "ratio"], rows)
