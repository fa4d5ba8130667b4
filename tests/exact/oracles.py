#!/usr/bin/python3
"""Compares the chain with the exact answers of tests/exact/data/global_illumination.json and
the Cornell box of tests/exact/data/cornell_box.json at three wavelengths.

oracles.py --named    the eight scenes to start with, hemicube and rays, as TAP
oracles.py --all      every scene, all methods, as a table
oracles.py ID...      these scenes, as a table
    --jobs N          so many scenes at a time, each on a processor of its own
    --method M        only hemicube, rays, best or reference (irradiance by particles)
    --reference       with --all or ID...: `reference --irradiance` instead of the chain

What counts as agreement (every value, no exceptions):
  hemicube   |got - expected| <= rel_tol_hemicube |expected|
  best       |got - expected| <= rel_tol |expected|, by settings chosen for that
  others     |got - expected| <= rel_tol |expected| + z SE
z is the two-sided 99 % point for the whole family of values compared by this run
(Bonferroni; each element of an every_point expectation is a value). SE is the
standard error the tools themselves state for each element (of `best`, whose values are
means of independent runs where it samples, it is that of their spread). For a mean or a
fitted point value the elements' errors are combined as if they were independent;
a particle meets many elements, so means of particles are judged by the spread of
independent runs.
A point value is the mean of a tiny element there, if the scene was cut so, else the
local quadratic whose element means fit the computed ones best. E/pi is
rounded in the scene, hence the floor of 4e-15 under every relative tolerance; an
expected 0 must be exactly 0."""
import argparse
import copy
import fnmatch
import json
import math
import os
import resource
import statistics
import sys
import tempfile

import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "independent"))
from chain import Failed, Tap, container, form_factors, picture, run, table
from jobs import workers
from oracle2gltf import INSIDE, convert, graded, oracles
from oracle_settings import settings_of

SPOT = .01  # of a face, what is small enough to stand for a point
# Particles of the yardstick: fewer where each one is reflected a thousand times, more where
# small elements see few of them.
PARTICLES = {"*rho0.999": 40000, "facing_mirrors_*": 400000, "sphere_two_materials": 32000000,
             "*": 4000000}
RUNS = 4  # of the settings of BEST, whose mean is judged
# Independent runs of the yardstick, and what widens their spread so that normal quantiles
# up to 4 are at least Student's of so many runs.
SEEDS, STUDENT = 32, 1.2
VIEW = ["-d", "mesh", "-s", "64x64", "--samples", "1", "--cutoff", "1e-5", "--depth", "256",
        "--compression", "none"]

REFLECTED = 2  # row_kind of lobes about the mirror direction, ff(5)

NAMED = ["furnace_hetero_diffuse", "furnace_partition_diffuse",
         "infinite_plates_directional_partition_n1", "infinite_plates_directional_partition_n10",
         "infinite_plates_directional_partition_ninf", "mirror_virtual_image_rs1.0",
         "open_lobe_normaliser", "box_in_box_isolated"]


class Value:
    """One number to judge. `count` numbers of an every_point expectation are judged
    together: worst() picks the one that is furthest outside."""

    def __init__(self, scene, method, expect, got, error, what):
        self.scene, self.method, self.what = scene, method, what
        self.expected = expect["value"]
        self.got = np.atleast_1d(np.asarray(got, float))
        self.error = np.broadcast_to(np.atleast_1d(np.asarray(error, float)), self.got.shape)
        hemicube = method == "hemicube"
        self.tol = max(expect["rel_tol_hemicube" if hemicube else "rel_tol"], 4e-15) \
            if self.expected else 0.0
        self.sampled = method in ("rays", "reference")

    def count(self):
        return len(self.got)

    def worst(self, z):
        """Index of the value worst off, its tolerance, and its deviation in parts of that."""
        allowed = self.tol * abs(self.expected) + self.sampled * z * self.error
        off = np.abs(self.got - self.expected)
        off[~np.isfinite(off)] = np.inf
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(off == 0, 0, off / allowed)
        i = int(np.argmax(ratio))
        return i, allowed[i], float(ratio[i])

    def noise(self):
        """Two standard errors, the largest, in parts of the tolerance that the scene states;
        None where there are none or the tolerance is 0."""
        if not self.expected or self.method == "hemicube":
            return None
        return 2 * float(self.error.max()) / (self.tol * abs(self.expected))


class Note:
    """A scene that did not get as far as values."""

    def __init__(self, scene, method, text, failed):
        self.scene, self.method, self.text, self.failed = scene, method, text, failed


class Field:
    """What a run computed on every modelled element-side: rows of a CSV and the
    standard error of H, and the corners of the elements."""

    def __init__(self, rows, error, corners):
        self.name = [r["name"] for r in rows]
        self.side = np.array([side_of(r) for r in rows])
        self.element = np.array([int(r["element"]) for r in rows])
        self.patch = np.array([int(r.get("patch", 0)) for r in rows])
        self.area = np.array([r["area"] for r in rows])
        self.h = np.array([r["H_0"] for r in rows])
        self.b = np.array([r.get("M_0", math.nan) + r.get("E_0", math.nan) for r in rows])
        self.error = error
        self.corners = corners
        self.receiver = self.element
        self.runs = None  # fields of independent runs, whose mean this is

    def of(self, quantity):
        return {"H": self.h, "B": self.b}[quantity]

    @classmethod
    def mean(cls, fields):
        """Of independent runs; an element's error is that of their spread."""
        mean = copy.copy(fields[0])
        mean.runs = fields
        mean.h, mean.b = (np.mean([f.of(q) for f in fields], 0) for q in "HB")
        mean.error = np.std([f.h for f in fields], 0, ddof=1) / math.sqrt(len(fields))
        return mean

    def spread(self, quantity, rows, weights):
        """Standard error of a weighted sum, from that of independent runs."""
        sums = [weights @ f.of(quantity)[rows] for f in self.runs]
        return np.std(sums, ddof=1) / math.sqrt(len(sums))

    def faces(self, pattern, side):
        wanted = {"front": 0, "back": 1}[side]
        return np.array([i for i, n in enumerate(self.name)
                         if self.side[i] == wanted and fnmatch.fnmatchcase(n, pattern)], int)


def side_of(row):
    s = row["side"]
    return {"front": 0, "back": 1, "f": 0, "b": 1, "0": 0, "1": 1}[s]


def fitted_weights(corners, receiver, point):
    """Weights of the means of elements in the value at a point of their plane: that of the
    receiver there if it is tiny, else of the quadratic that fits the nearest receivers' best.
    corners: [n][3][3]; receiver: [n], what an element got its value as a part of. Returns
    indices and weights."""
    _, of = np.unique(receiver, return_inverse=True)
    edges = corners[:, 1:] - corners[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    share = area / np.bincount(of, area)[of]
    sums = lambda values: np.stack([np.bincount(of, share * v) for v in values], 1)
    distance = np.linalg.norm(sums(corners.mean(1).T) - np.asarray(point, float), axis=1)
    at, extent = corners[of == distance.argmin()], np.ptp(corners, (0, 1)).max()
    if np.ptp(at, (0, 1)).max() < SPOT * extent and distance.min() < SPOT * extent:
        alone = np.flatnonzero(of == distance.argmin())
        return alone, share[alone]
    nearest = np.argsort(distance, kind="stable")[:48 if len(distance) == len(of) else 25]
    u = corners[0, 1] - corners[0, 0]
    u /= np.linalg.norm(u)
    n = np.cross(u, corners[0, 2] - corners[0, 0])
    v = np.cross(n / np.linalg.norm(n), u)
    size = distance[nearest].max()
    x, y = (corners - point) @ u / size, (corners - point) @ v / size
    mean = lambda a, b: (a.sum(1) * b.sum(1) + (a * b).sum(1)) / 12
    basis = sums([np.ones(len(of)), x.mean(1), y.mean(1), mean(x, x), mean(x, y), mean(y, y)])[nearest]
    weight = np.zeros(len(distance))
    weight[nearest] = np.linalg.pinv(basis)[0]
    near = np.flatnonzero(np.isin(of, nearest))
    return near, weight[of[near]] * share[near]


def error_of_b(field, rows, oracle):
    """SE of B = E + rho H(this side) + tau(other) H(other side)."""
    at = {(field.element[i], field.side[i]): i for i in range(len(field.name))}
    mats = {f["name"]: oracle["materials"][f["mat"]] for f in oracle["faces"]}
    out = []
    for i in rows:
        sides = ["front", "back"][::1 if field.side[i] == 0 else -1]
        m = mats[field.name[i]]
        other = at.get((field.element[i], 1 - field.side[i]))
        transmitted = m[sides[1]].get("tau_d", 0) * field.error[other] if other is not None else 0.0
        out.append(math.hypot(m[sides[0]].get("rho_d", 0) * field.error[i], transmitted))
    return np.array(out)


def surface_value(oracle, method, e, field):
    """The Value of an expectation on H or B."""
    rows = field.faces(e["face"], e["side"])
    what = f"{e['stat']} {e['quantity']} {e['face']} {e['side']}"
    if not len(rows):
        return Value(oracle["id"], method, e, math.nan, 0, what + " (no such face)")
    got = field.of(e["quantity"])[rows]
    error = field.error[rows] if e["quantity"] == "H" else error_of_b(field, rows, oracle)
    if e["stat"] == "mean":
        w = field.area[rows] / field.area[rows].sum()
    elif e["stat"] == "point":
        near, w = fitted_weights(field.corners[rows], field.receiver[rows], e["point"])
        got, error, rows = got[near], error[near], rows[near]
        what += " " + e.get("label", ",".join(f"{c:g}" for c in e["point"]))
    else:
        return Value(oracle["id"], method, e, got, error, what)
    spread = math.sqrt(((w * error) ** 2).sum())
    if field.runs and (e["stat"] == "mean" or method == "best"):
        spread = field.spread(e["quantity"], rows, w) * (1 if method == "best" else STUDENT)
    return Value(oracle["id"], method, e, w @ got, spread, what)


def reflected_fraction(oracle, method, e, field, ff):
    """Flux on the receiver over flux reflected by the lobe; the receiver sees no
    emitter directly. The error is that of the lobe's own samples: how much light comes
    to the lobe cancels. (Rows with fewer samples are of directions that no light has.)"""
    mirror, receiver = field.faces("mirror", "front"), field.faces(e["face"], "front")
    rho = oracle["materials"]["m"]["front"]["rho_s"]
    flux = lambda f, rows: (f.h[rows] * f.area[rows]).sum()
    share = lambda f: flux(f, receiver) / (rho * flux(f, mirror)) if flux(f, mirror) else math.nan
    ratio = share(field)
    if method == "best" and field.runs:
        error = np.std([share(f) for f in field.runs], ddof=1) / math.sqrt(len(field.runs))
    elif ff:
        _, arrays = form_factors(ff)
        samples = arrays["row_samples"][arrays["row_kind"] == REFLECTED].max(initial=1)
        error = math.sqrt(ratio * (1 - ratio) / samples)
    else:
        spread = np.linalg.norm(field.error[receiver] * field.area[receiver])
        error = spread / (rho * flux(field, mirror)) if flux(field, mirror) else math.nan
    return Value(oracle["id"], method, e, ratio, error, f"flux fraction {e['face']}")


def escaped(oracle, method, e, field, ledger):
    """Escaped flux: from the solver's ledger; its error from what the faces absorb."""
    if ledger is None:
        return Note(oracle["id"], method, "escaped_flux: particles do not state it", False)
    absorbed = [field.area[i] * field.error[i] for i in range(len(field.name))]
    return Value(oracle["id"], method, e, ledger["escaped"][0],
                 math.sqrt(sum(a * a for a in absorbed)), "escaped flux")


def pixels(oracle, method, e, field, rads, folder):
    """All pixels of all cameras, means of the runs. A pixel is a sum of w_k B_k / pi along its
    mirror path with sum w_k (1 - rho_s,k) = 1, so its error is at most the largest of
    error(B) / (pi (1 - rho_s))."""
    rho = {f["name"]: oracle["materials"][f["mat"]]["front"]["rho_s"] for f in oracle["faces"]}
    rows = np.array([i for i, n in enumerate(field.name) if rho[n] < 1])
    error = error_of_b(field, rows, oracle) / (1 - np.array([rho[field.name[i]] for i in rows]))
    for view, *_ in INSIDE:
        path, got = os.path.join(folder, view + ".exr"), 0
        for rad in rads:
            run("trace", rad, "-c", view, "-o", path, *VIEW)
            planes = picture(path)
            got = got + np.concatenate([planes[c].ravel() for c in "RGB"]) / len(rads)
        yield Value(oracle["id"], method, e, got, error.max() / math.pi,
                    f"every pixel of camera {view}")


def chain_field(rad):
    meta, arrays = container(rad)
    rows = table(run("inspect", rad, "--csv").stdout)
    sides = np.array([2 * int(r["element"]) + side_of(r) for r in rows])
    error = arrays["irradiance_error"][sides, 0]
    corners = arrays["vertex"][arrays["element"][sides // 2].astype(int)]
    return Field(rows, error, corners), ledger_of(arrays)


def ledger_of(arrays):
    terms = ("emitted", "absorbed", "escaped", "lost", "cut", "uneven")
    return dict(zip(terms, arrays["ledger"].sum(1)))


def particle_field(mesh, scene):
    meta, arrays = container(mesh)
    samples = next(n for name, n in PARTICLES.items() if fnmatch.fnmatchcase(scene, name))
    runs = [table(run("reference", mesh, "--irradiance", "--seed", seed + 1,
                      "--samples", samples // SEEDS).stdout) for seed in range(SEEDS)]
    elements = np.array([int(r["element"]) for r in runs[0]])
    error = np.sqrt(sum(np.array([r["SE_0"] for r in rows]) ** 2 for rows in runs)) / SEEDS
    corners = arrays["vertex"][arrays["element"][elements].astype(int)]
    field = Field.mean([Field(rows, error, corners) for rows in runs])
    field.error = error  # which is steadier than their spread
    return field, None


def values_of(oracle, method, field, ledger, folder, ff=None, rads=()):
    for e in oracle["expect"]:
        if e["quantity"] in ("H", "B"):
            if e["quantity"] == "B" and np.isnan(field.b).all():
                yield Note(oracle["id"], method, f"B {e['face']}: particles state H only", False)
            else:
                yield surface_value(oracle, method, e, field)
        elif e["quantity"] == "escaped_flux":
            yield escaped(oracle, method, e, field, ledger)
        elif e["quantity"] == "fraction_of_mirror_reflected_flux":
            yield reflected_fraction(oracle, method, e, field, ff)
        elif e["quantity"] == "pixel_radiance" and rads:
            yield from pixels(oracle, method, e, field, rads, folder)
        else:
            yield Note(oracle["id"], method, f"{e['quantity']}: particles do not state it", False)


def solved(path, method, options, stop):
    """ffcalc and shoot on a mesh: field, ledger, names of the solutions. `best` is the mean of
    RUNS of them with seeds of their own where there is anything sampled."""
    fields, ledgers, rads = [], [], []
    for seed in range(1, RUNS + 1 if method == "best" else 2):
        rads.append(path(f".{seed}.rad"))
        run("ffcalc", path(".mesh"), "-o", path(".ff"), *options, "--seed", seed)
        run("shoot", path(".mesh"), path(".ff"), "-o", rads[-1], *stop)
        field, ledger = chain_field(rads[-1])
        fields.append(field)
        ledgers.append(ledger)
        if not field.error.any() or (len(fields) == 2 and np.allclose(*(f.h for f in fields), 1e-6, 0)):
            break
    if len(fields) == 1:
        return fields[0], ledgers[0], rads
    ledger = {term: np.mean([l[term] for l in ledgers], 0) for term in ledgers[0]}
    return Field.mean(fields), ledger, rads


def evaluate(oracle, method, folder):
    """Runs one scene by one method: a list of Values and Notes."""
    patch, element, *options, stop = settings_of(oracle, method)
    if isinstance(patch, dict):
        oracle, patch = graded(oracle, patch), math.inf
    longest = max(np.linalg.norm(np.subtract(f["verts"][0], f["verts"][i]))
                  for f in oracle["faces"] for i in (1, -1))
    path = lambda suffix: os.path.join(folder, oracle["id"] + suffix)
    try:
        convert(oracle, path(".gltf"))
        run("mesh", path(".gltf"), "-o", path(".mesh"), "-p", patch * longest, "-e", element * longest,
            "--lobe", "reciprocal" if oracle.get("lobe") == "reciprocal" else "paper")
        if method == "reference":
            field, ledger = particle_field(path(".mesh"), oracle["id"])
            return list(values_of(oracle, method, field, ledger, folder))
        if method != "best":
            options = ["-m", method, *options[method == "rays"]]
        else:
            options = options[0]
        field, ledger, rads = solved(path, method, options, stop)
        if "--to" in options:
            for one in [field, *(field.runs or ())]:
                one.receiver = one.patch
        return list(values_of(oracle, method, field, ledger, folder, path(".ff"), rads))
    except Failed as problem:
        return [Note(oracle["id"], method, str(problem), True)]


def cpu_seconds():
    """What the programs run so far took of one core."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def timed(name, method):
    """Results of a scene by one method, and processor seconds."""
    begun = cpu_seconds()
    with tempfile.TemporaryDirectory() as folder:
        results = evaluate(oracles()[name], method, folder)
    return results, cpu_seconds() - begun


def evaluate_all(ids, methods, jobs):
    results, pairs = [], [(name, method) for name in ids for method in methods]
    with workers(jobs) as pool:
        for (name, method), (found, seconds) in zip(pairs, pool.map(timed, *zip(*pairs))):
            results += found
            if sys.stderr.isatty() or os.environ.get("VERBOSE"):
                print(f"oracles: {name} {method} {seconds:.1f} s, {summary(found)}", file=sys.stderr,
                      flush=True)
    return results


def summary(results):
    values = [r for r in results if isinstance(r, Value)]
    said = [r.text for r in results if r not in values and r.failed]
    if values:
        said.append(f"at most {max(r.worst(0)[2] for r in values):.2f} of a tolerance, "
                    f"2 standard errors {max(r.noise() or 0 for r in values):.2f}")
    return "; ".join(said)


def family_z(results):
    """The normal quantile that all values together exceed with probability .01."""
    family = sum(r.count() for r in results if isinstance(r, Value) and r.sampled)
    return statistics.NormalDist().inv_cdf(1 - .01 / (2 * max(family, 1))), family


HEAD = ("scene", "method", "quantity", "expected", "got", "deviation", "tolerance", "of it",
        "2 std errors of it", "")
FAILED, NOT_RUN = "FAIL", "not run"


def rows_of(results):
    """Cells of the table under HEAD."""
    z, _ = family_z(results)
    for r in results:
        if isinstance(r, Note):
            yield [r.scene, r.method, r.text, *[""] * 6, FAILED if r.failed else NOT_RUN]
            continue
        i, allowed, ratio = r.worst(z)
        noise = r.noise()
        yield [r.scene, r.method, r.what, f"{r.expected:.7g}", f"{r.got[i]:.7g}",
               f"{r.got[i] - r.expected:+.1e}", f"{allowed:.1e}", f"{ratio:.2f}",
               "" if noise is None else f"{noise:.2f}", "ok" if ratio <= 1 else FAILED]


def print_table(results):
    z, family = family_z(results)
    rows = [HEAD, *rows_of(results)]
    wide = [max(len(row[c]) for row in rows if c != 2 or row[3]) for c in range(len(HEAD))]
    for row in rows:
        print("  ".join(cell.ljust(w) for cell, w in zip(row, wide)).rstrip())
    bad = sum(row[-1] == FAILED for row in rows)
    print(f"\n{len(rows) - 1} lines, {bad} {FAILED}; z = {z:.2f} for 99 % over {family} values of rays "
          "and particles; errors of means and points combined as if independent between elements")
    return bad


def print_tap(results):
    z, _ = family_z(results)
    tap = Tap()
    for r in results:
        name = f"{r.scene}, {r.method}: "
        if isinstance(r, Note):
            (tap.ok(False, name + r.text) if r.failed else tap.skip(name, r.text))
            continue
        i, allowed, ratio = r.worst(z)
        tap.ok(ratio <= 1, name + r.what, f"expected {r.expected:.9g}, got {r.got[i]:.9g}, "
               f"tolerance {allowed:.2g}, standard error {r.error[i]:.2g}")
    return tap.finish()


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("--named", action="store_true")
    p.add_argument("--all", action="store_true")
    p.add_argument("--reference", action="store_true")
    p.add_argument("-j", "--jobs", type=int, default=1)
    p.add_argument("--method", choices=["hemicube", "rays", "best", "reference"])
    p.add_argument("ids", nargs="*")
    a = p.parse_args()
    methods = ["reference"] if a.reference else [a.method] if a.method else \
        ["hemicube", "rays"] + ["best"] * (not a.named)
    known = oracles()
    unknown = [i for i in a.ids if i not in known]
    if unknown or not (a.named or a.all or a.ids):
        p.error(f"no scene {unknown[0]}" if unknown else "--named, --all or scenes are needed")
    results = evaluate_all(NAMED if a.named else list(known) if a.all else a.ids, methods, a.jobs)
    sys.exit(print_tap(results) if a.named else 1 if print_table(results) else 0)


if __name__ == "__main__":
    main()
