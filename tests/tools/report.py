#!/usr/bin/python3
# tier: slow
"""The parts of `make report`: which pixels are compared, errors without the yardstick's
noise, fits, a page of tiny samples, and the tables in RESULTS.md and README.md."""
import json
import os
import shutil
import subprocess
import sys
import tempfile
from types import SimpleNamespace as Some

import numpy as np

sys.dont_write_bytecode = True
TESTS = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
REPORT = os.path.join(TESTS, "bench", "report")
sys.path[:0] = [REPORT, os.path.join(TESTS, "exact"), os.path.join(TESTS, "independent"),
                os.path.join(os.path.dirname(TESTS), "scenes")]
from chain import BUILD, TOP, Tap, picture, run
from growth import Fit
from page import replace_tables
from views import DEFAULT
from yardstick import Errors, Ladder, Lattice, off
import summary


def lattice_depths(folder, width, height):
    """Depths at the lattice's pixels: of the whole picture, and of its own."""
    lattice, depths = Lattice(width, height), []
    with open(os.path.join(TOP, "scenes", "furnace.gltf")) as f:
        root = json.load(f)
    for which, size in (("whole", f"{width}x{height}"), ("lattice", lattice.size)):
        path = lambda extension: os.path.join(folder, f"{which}.{extension}")
        if which == "lattice":
            for camera in root["cameras"]:
                camera["perspective"]["yfov"] = lattice.narrowed(camera["perspective"]["yfov"])
        with open(path("gltf"), "w") as f:
            json.dump(root, f)
        run("mesh", "-p", "inf", "-e", "inf", path("gltf"), "-o", path("mesh"))
        run("ffcalc", "-n", 16, path("mesh"), "-o", path("ff"))
        run("shoot", path("mesh"), path("ff"), "-o", path("rad"))
        run("trace", path("rad"), "-c", "inside", "-s", size, "--samples", 1, "--layers", "Z",
            "--compression", "none", "-o", path("exr"))
        depths.append(picture(path("exr"))["Z"])
    return lattice.pick(depths[0]), depths[1]


def places(tap, folder):
    for width, height in ((32, 24), (33, 22), (31, 31)):
        whole, own = lattice_depths(folder, width, height)
        tap.ok(whole.shape == own.shape and np.allclose(whole, own, rtol=1e-5),
               f"every third pixel of {width}x{height} is the same by itself")


def errors(tap):
    rng = np.random.default_rng(1)
    true, n = np.full((3, 100000), 2.0), (3, 100000)
    a = true + rng.normal(0, .02, n)
    b, c = (true + rng.normal(0, .2, n) for _ in range(2))
    e = Errors(a, true + (b - true) / 20, true + (c - true) / 20)
    exact = np.percentile(np.sqrt(((a - true) ** 2).sum(0) / 12), 99)
    tap.ok(abs(e.tail[99] / exact - 1) < .02 and e.noise[99] > .3 * exact,
           "the 99th percentile of pixels under a yardstick a third as noisy",
           f"got {e.tail[99]}, not {exact}")
    tap.ok(abs(off(a, b, c) - .01) < .001, "an error of a tenth of the yardstick's noise",
           f"got {off(a, b, c)}")


def curves(tap):
    ladder = Ladder()
    for cpu in (1, 4, 16):
        ladder.add(cpu, .8 / cpu ** .5)
    tap.ok(all(abs(ladder.at(t) * t ** .5 / .8 - 1) < 1e-9 for t in (.1, 1, 2, 9, 100)),
           "errors in equal time follow the square root, also beyond what was measured")
    x = np.array([100, 200, 300, 500, 1000.0])
    fit = Fit(x, 3e-4 * x ** 1.7, .01)
    tap.ok(abs(fit.exponent - 1.7) < 1e-9 and fit.error < 1e-6, "a power law's exponent is found")
    tap.ok(Fit(x, 1e-9 * x, .01).exponent is None, "no exponent from times that are too short")


KEPT = "<!-- kept: a command -->\n| old | figures |\n<!-- end -->\n"


def page(tap, folder):
    results = os.path.join(folder, "RESULTS.md")
    with open(results, "w", encoding="utf-8") as f:
        f.write(f"Before.\n\n<!-- views -->\n| stale |\n<!-- end -->\n\n{KEPT}\nAfter.\n")
    done = subprocess.run([sys.executable, REPORT, "--quick", "--only", "views", "--only", "exact",
                           "--out", folder, "--into", results],
                          capture_output=True, text=True, check=False,
                          env={**os.environ, "BUILD": BUILD})
    tap.ok(done.returncode == 0, "a page of tiny samples", *done.stderr.splitlines()[-3:])
    text = {name: "" for name in ("index.html", "report.txt", "views.svg")}
    for name in text:
        if os.path.exists(os.path.join(folder, name)):
            with open(os.path.join(folder, name), encoding="utf-8") as f:
                text[name] = f.read()
    tap.ok("<svg" in text["views.svg"], "a plot is beside it")
    tap.ok(all("view 1, everything included" in text[n] and "`" not in text["index.html"]
               for n in ("index.html", "report.txt")), "page and text have the table of bars")
    tap.ok(all("furnace_hetero_diffuse" in text[n] for n in ("index.html", "report.txt")),
           "and exact answers, which were found side by side")
    words = contents(results)
    tap.ok(words.startswith("Before.") and words.endswith(KEPT + "\nAfter.\n") and "| view 1 |" in words
           and "stale" not in words, "a table is put in its place, and the rest is kept", words)


def contents(path):
    with open(path, encoding="utf-8") as f:
        return f.read()


def view(scene, solution, options, error):
    return Some(solved=Some(scene=Some(name=scene), solution=solution), name=options, cpu=.06,
                seconds=lambda: .64, errors=Some(rmse=error))


def documents(tap, folder):
    """What a whole report puts in README.md and RESULTS.md, as they are."""
    lamps, factors = view("lamps", None, "", .02), {"patches": "6", "ffcalc": "`-m x`", "user": "0.10",
                                                    "row sums": "1e-8", "max": "2e-9", "worst": "3e-7"}
    run = Some(views=[view("cornell", DEFAULT, "-d direct", .01), view("cornell", DEFAULT, "-d mesh", .03),
                      view("cornell", None, "-d gather", .04)],
               rows=[Some(scene="cornell", by_default=lamps), Some(scene="lamps", by_default=None),
                     Some(scene="lamps", by_default=lamps)],
               factors=[{"scene": "cube16", **factors}, {"scene": "cube24", **factors}])
    table = summary.table(run)
    tap.ok([row[0].split("`")[1] for row in table.rows] == ["cornell", "lamps", "cube16"]
           and table.rows[0][1:4] == ["0.64", "0.06", "1.00 %"] and "3e-7 relative" in table.rows[2][3]
           and "Radiance" in table.rows[0][4] and "View3D" in table.rows[2][4],
           "the defaults of each scene and form factors, beside other programs", *map(str, table.rows))
    for name, places in (("README.md", ["summary"]),
                         ("tests/bench/RESULTS.md", ["machine", "speed", "speed-long", "views"])):
        path = os.path.join(folder, "document.md")
        shutil.copy(os.path.join(TOP, name), path)
        before = contents(path)
        kept = [part for part in before.split("<!-- ") if part.startswith("kept: ")]
        replace_tables(path, {place: table for place in places})
        after = contents(path)
        tap.ok(after.count(table.compact()) == len(places) and all(part in after for part in kept),
               f"{name} has a place for {', '.join(places)}")


def main():
    tap = Tap()
    folder = tempfile.mkdtemp(prefix="twopass-report-test.")
    try:
        places(tap, folder)
        errors(tap)
        curves(tap)
        page(tap, folder)
        documents(tap, folder)
    finally:
        shutil.rmtree(folder)
    sys.exit(tap.finish())


main()
