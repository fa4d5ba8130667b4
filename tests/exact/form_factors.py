#!/usr/bin/python3
"""Compares ffcalc with the exact form factors of tests/exact/data/form_factors.json and of
tests/exact/random_polygons.py.

form_factors.py           a table of every case
form_factors.py --tap     the same judged, with reciprocity and invariance, as TAP
    -m METHOD             analytic, rays or hemicube; may be repeated (default analytic)
    -o OPTIONS            options of ffcalc instead of those below, one word
    ID...                 these cases only

What counts as agreement (every value, no exceptions):
  analytic   1e-9 absolute and 1e-8 relative where nothing is between, else 1e-6
             absolute; reciprocity 1e-9 relative; invariance the same where nothing is
             between, else twice the target, 2e-7 absolute
  others     q times the stated error or, if that is more, the weight of one sample; q the
             two-sided 99 % point for all values of the run (Bonferroni) of Student's t with 3
             degrees of freedom: the stated error is the spread of four estimates
  rays       of all cases' errors, as many within Student's median of the stated error as
             a coin would bring in 999 of 1000 times: about half
Invariance is the change of got / exact. What is exact for moved polygons is computed from
the vertices that mesh made of them (tests/exact/contour.py), except behind occluders."""
import argparse
import csv
import io
import json
import math
import os
import sys
import tempfile
import time

import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "independent"))
from chain import DATA, Failed, Tap, container, form_factors, run
from contour import REAL, area, visible_form_factor
from polygon2gltf import Placement, polygon, write
import random_polygons

TARGET = 1e-7

OPTIONS = {"analytic": ["--to", "patches", "-t", str(TARGET)],
           "rays": ["-n", "65536"],
           "hemicube": ["-n", "64", "-p", "256"]}

ABSOLUTE, RELATIVE, OCCLUDED, SAME = 1e-9, 1e-8, 1e-6, 1e-9

# Near, far, sharing an edge at 10 and 179 degrees, needles, general, occluded.
MOVED = ["par_C11_3", "tri_general_2", "tri_edge_10deg", "tri_edge_179deg", "tri_needle",
         "quad_general", "occ_center", "occ_perp_half"]

MEDIAN = 0.76489  # of |t|, 3 degrees of freedom


class Case:
    def __init__(self, entry):
        self.id, self.exact = entry["id"], REAL(entry["F12"])
        self.curved = None
        if entry["emitter"] is None:
            self.curved = "a point" if "emitter_point" in entry else "curved"
            return
        self.emitter, self.receiver = polygon(entry["emitter"]), polygon(entry["receiver"])
        self.occluders = [polygon(p) for p in entry.get("occluders", ())]

    def moved(self, change):
        """The same with change applied to every polygon."""
        other = object.__new__(Case)
        other.__dict__.update(self.__dict__, emitter=change(self.emitter),
                              receiver=change(self.receiver),
                              occluders=[change(p) for p in self.occluders])
        return other


class Result:
    """What ffcalc makes of a case: f, stated error and the weight of a sample, each both ways
    [2], seconds, the areas, and what is exact for the vertices as mesh has them."""

    def __init__(self, case, method, options, folder, where=Placement(), flip=False):
        self.method = method
        gltf, mesh, ff = (os.path.join(folder, case.id + s) for s in (".gltf", ".mesh", ".ff"))
        self.placed = write(gltf, case.emitter, case.receiver, case.occluders, where, flip)
        run("mesh", "-p", "inf", "-e", "inf", gltf, "-o", mesh)
        begun = time.monotonic()
        run("ffcalc", "-m", method, *options, "--precision", "f64", mesh, "-o", ff)
        self.seconds = time.monotonic() - begun
        self.f, self.error, self.sample = factors(ff, "b" if flip else "f")
        outlines = outlines_of(mesh)
        if len(outlines) != 2 + len(case.occluders):
            raise Failed(f"mesh made {len(outlines)} patches of {2 + len(case.occluders)}")
        pair = [outlines[name][::-1 if flip else 1] for name in ("emitter", "receiver")]
        self.area = np.array([area(p) for p in pair])
        self.exact = case.exact if case.occluders else visible_form_factor(*pair)

    def resolved(self):
        """The stated error, at least one sample."""
        return np.maximum(self.error, self.sample)


def factors(ff, side):
    """F, stated error and what one sample weighs, emitter to receiver and back."""
    head, *lines = csv.reader(io.StringIO(run("inspect", "--patch-matrix", ff).stdout))
    _, arrays = form_factors(ff)
    diffuse = arrays["row_kind"] == 0
    error, samples = arrays["row_error"][diffuse], arrays["row_samples"][diffuse]
    if len(error) != len(lines):
        raise Failed(f"{len(lines)} lines of the patch matrix, {len(error)} diffuse rows")
    names = [f"emitter:{side}", f"receiver:{side}"]
    at = [[line[0] for line in lines].index(name) for name in names]
    return (np.array([REAL(lines[i][head.index(name)]) for i, name in zip(at, names[::-1])]),
            error[at], 1 / np.maximum(samples[at], 1))


def outlines_of(mesh):
    """The vertices of every patch's outline, by name."""
    meta, a = container(mesh)
    names = json.loads(meta["surfaces"])
    outline = {}
    for patch, surface in enumerate(a["patch_surface"]):
        first = a["loop_start"][a["patch_loop"][patch]:][:2]
        outline[names[surface]] = a["vertex"][a["loop_index"][slice(*first)]]
    return outline


def movements():
    """Name, change of the polygons, placement for a scene of a given size, flip."""
    turn = random_polygons.turn_of(np.random.default_rng(1))
    same, still = lambda p: p, lambda size: Placement()
    far = lambda size: Placement(shift=2 ** (20 + math.ceil(math.log2(size))) * np.array([1, -2, 3]))
    yield "1e-6 times the size", same, lambda size: Placement(REAL("1e-6")), False
    yield "1e6 times the size", same, lambda size: Placement(REAL("1e6")), False
    yield "far from the origin", same, far, False
    yield "turned", same, lambda size: Placement(turn=turn), False
    yield "other first vertices", lambda p: np.roll(p, -1, 0), still, False
    yield "seen from the back", same, still, True


def all_cases():
    with open(os.path.join(DATA, "form_factors.json"), encoding="utf-8") as f:
        return [Case(entry) for entry in (*json.load(f), *random_polygons.entries())]


# ---- as a table ----

def print_table(cases, methods, options):
    lines = [("case", "method", "expected", "got", "abs error", "rel error", "stated", "seconds", "")]
    for case in cases:
        if case.curved:
            lines.append((case.id, "", f"{case.exact:.12g}", *[""] * 5, case.curved))
            continue
        for method in methods:
            with tempfile.TemporaryDirectory() as folder:
                try:
                    r = Result(case, method, options or OPTIONS[method], folder)
                except Failed as problem:
                    lines.append((case.id, method, f"{case.exact:.12g}", *[""] * 5, str(problem)))
                    continue
            off = r.f[0] - r.exact
            lines.append((case.id, method, f"{r.exact:.12g}", f"{r.f[0]:.12g}", f"{off:+.1e}",
                          f"{off / r.exact:+.1e}", f"{r.error[0]:.1e}", f"{r.seconds:.2f}",
                          "" if r.placed else "vertices rounded"))
    wide = [max(len(line[c]) for line in lines) for c in range(len(lines[0]))]
    for line in lines:
        print("  ".join(cell.ljust(w) for cell, w in zip(line, wide)).rstrip())


# ---- as tests ----

class Check:
    """|got - exact| against what is allowed: `bound`, or q times a stated error."""

    def __init__(self, name, off, bound=None, error=None, note=""):
        self.name, self.off, self.note = name, abs(off), note
        self.bound, self.error = bound, error

    def within(self, q):
        return bool(self.off <= (q * self.error if self.bound is None else self.bound))

    def judge(self, tap, q):
        allowed = q * self.error if self.bound is None else self.bound
        notes = f"off by {self.off:.3g}, allowed {allowed:.3g}", self.note
        tap.ok(self.within(q), self.name, *notes)


def check_value(name, case, r, sampled):
    off, note = r.f[0] - r.exact, f"got {r.f[0]:.17g}, exact {r.exact:.17g}"
    if sampled:
        return Check(name, off, error=r.resolved()[0], note=note)
    bound = OCCLUDED if case.occluders else min(ABSOLUTE, RELATIVE * r.exact)
    return Check(name, off, bound, note=note)


def check_reciprocity(name, case, r, sampled):
    flow = r.area * r.f
    off, note = flow[0] - flow[1], f"A1 F12 = {flow[0]:.17g}, A2 F21 = {flow[1]:.17g}"
    if sampled:
        return Check(name, off, error=np.hypot(*(r.area * r.resolved())), note=note)
    return Check(name, off, SAME * flow[0], note=note)


def checks_of(case, method, options, folder):
    """Yields Checks, or the text of what went wrong."""
    sampled, name = method != "analytic", f"{case.id}, {method}: "
    base = Result(case, method, options, folder)
    if not case.occluders and base.placed:
        yield Check(case.id + ": mesh has the polygons as they are", base.exact - case.exact,
                    SAME * case.exact)
    yield check_value(name + "F12", case, base, sampled)
    yield check_reciprocity(name + "reciprocity", case, base, sampled)
    if case.id not in MOVED:
        return
    size = float(abs(np.concatenate([case.emitter, case.receiver]) - case.emitter[0]).max())
    for movement, change, where, flip in movements():
        r = Result(case.moved(change), method, options, folder, where(size), flip)
        if sampled:
            yield check_value(name + movement, case, r, sampled)
            continue
        allowed = 2 * TARGET / r.exact if case.occluders else SAME
        yield Check(name + movement, r.f[0] / r.exact - base.f[0] / base.exact, allowed,
                    note=f"F12 {base.f[0]:.17g} became {r.f[0]:.17g}")


def student_quantile(p):
    """Of Student's t with 3 degrees of freedom."""
    low, high = 0.0, 1e6
    for _ in range(200):
        x = (low + high) / 2
        y = x / math.sqrt(3)
        below = .5 + (y / (1 + y * y) + math.atan(y)) / math.pi < p
        low, high = (x, high) if below else (low, x)
    return high


def print_tap(cases, methods, options):
    tap, checks = Tap(), []
    for case in cases:
        if case.curved:
            tap.skip(case.id, case.curved)
            continue
        for method in methods:
            with tempfile.TemporaryDirectory() as folder:
                try:
                    checks += checks_of(case, method, options or OPTIONS[method], folder)
                except Failed as problem:
                    tap.ok(False, f"{case.id}, {method}", str(problem))
    sampled = sum(c.bound is None for c in checks)
    q = student_quantile(1 - .01 / (2 * max(sampled, 1)))
    for check in checks:
        check.judge(tap, q)
    if "rays" in methods:
        judge_stated(tap, [c for c in checks if c.name.endswith(", rays: F12")])
    return tap.finish()


def judge_stated(tap, checks):
    """Stated errors on the whole: a sign test."""
    inside, n = sum(c.within(MEDIAN) for c in checks), len(checks)
    least = n / 2 - 3.09 * math.sqrt(n) / 2
    tap.ok(inside >= least, "rays: stated errors on the whole",
           f"{inside} of {n} within {MEDIAN} of them, at least {least:.1f} should be")


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("--tap", action="store_true")
    p.add_argument("-m", "--method", action="append", choices=list(OPTIONS))
    p.add_argument("-o", "--options")
    p.add_argument("ids", nargs="*")
    a = p.parse_args()
    cases = all_cases()
    unknown = set(a.ids) - {c.id for c in cases}
    if unknown:
        p.error(f"no case {min(unknown)}")
    cases = [c for c in cases if not a.ids or c.id in a.ids]
    methods, options = a.method or ["analytic"], a.options.split() if a.options else None
    return print_tap(cases, methods, options) if a.tap else print_table(cases, methods, options)


if __name__ == "__main__":
    sys.exit(main())
