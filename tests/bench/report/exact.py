"""What other scripts of tests/ find: exact answers, hard cases, form factors."""
import os
import re

from chain import TOP
from measure import script
from page import Bar, Listing, Table, Title, Words

TESTS = os.path.join(TOP, "tests")
ORACLES = os.path.join(TESTS, "oracles.py")
HARD_CASES = os.path.join(TESTS, "hard_cases.py")
FORM_FACTORS = os.path.join(TESTS, "bench", "form_factors.py")
SECONDS = 60  # a scene
VIEW3D = [  # on one core of such a machine, measured before
    ["cube16", "1536", ".34", "3.4e-7 at most, 2.2e-4 relative, row sums 1.3e-6"],
    ["cube24", "3456", ".75 – .8", "1e-4"],
    ["room", "480", "7 – 11", "row sums 1.3e-6"],
    ["city100", "100", ".5", "row sums 6e-2, tuned 9.5e-4"],
    ["city370", "369", "7", "row sums 5e-2, tuned 2.3e-3"],
    ["city2100", "2105", "–", "row sums .28"]]


def oracles(run):
    """Expected, got and tolerance of every scene with a known answer."""
    run.tell("exact answers")
    printed, progress = script(ORACLES, *run.plan.oracles)
    counts = re.search(r"^(\d+) lines, (\d+) FAIL", printed, re.MULTILINE)
    took = {}
    for scene, time in re.findall(r"^oracles: \S+ (\S+) .*?([\d.]+) s$", progress, re.MULTILINE):
        took[scene] = max(took.get(scene, 0), float(time))
    slowest = max(took, key=took.get, default=None)
    good = counts and counts.group(2) == "0" and (not slowest or took[slowest] <= SECONDS)
    run.bars.append(Bar("every exact answer within its tolerance", f"all, ≤ {SECONDS} s a scene",
                        f"{counts.group(2)} of {counts.group(1)} lines fail" +
                        (f"; slowest {slowest}, {took[slowest]:.0f} s" if slowest else "")
                        if counts else "", bool(good) if "--all" in run.plan.oracles else None))
    yield Title("Exact answers")
    yield Words("""`tests/oracles.py` on the scenes of `tests/data/global_illumination.json` and
        the Cornell box by wavelength; what each is run with is in its tables `CLASSES` and `BEST`.""" +
                f" Here: `oracles.py {' '.join(run.plan.oracles)}`.")
    yield Listing(printed)


def hard_cases(run):
    """Scenes that are numerically hard."""
    if not run.plan.hard:
        return
    run.tell("hard cases")
    printed, _ = script(HARD_CASES)
    good = re.findall(r"^ok \d+ - (?!.*# TODO)", printed, re.MULTILINE)
    bad = re.findall(r"^(?:not ok \d+ - .*|ok \d+ - .*# TODO.*)$", printed, re.MULTILINE)
    run.bars.append(Bar("hard cases behave as stated", "all", f"{len(good)} of {len(good) + len(bad)}",
                        not bad))
    yield Title("Hard cases")
    yield Words(f"""`tests/hard_cases.py`: {len(good)} of {len(good) + len(bad)} statements on
        the scenes of `tests/data/hard_cases.json` hold{', all but these:' if bad else '.'}""")
    if bad:
        yield Listing("\n".join(bad))


def markdown(text):
    """Head and rows of the table in a text, and what is around it."""
    rows = [[cell.strip() for cell in line.strip().strip("|").split("|")]
            for line in text.splitlines() if line.startswith("|")]
    rest = "\n".join(line for line in text.splitlines() if not line.startswith("|")).strip()
    return (rows[0], rows[2:], rest) if len(rows) > 2 else ([], [], rest)


def form_factors(run):
    run.tell("form factors")
    plan = run.plan
    words = [w for scene in plan.ff_scenes for w in ("--scene", scene)]
    printed, _ = script(FORM_FACTORS, "--tuned", "--fresh", "--repeat", plan.repeat,
                        "--rays", plan.ff_rays, *words)
    head, rows, rest = markdown(printed)
    yield Title("Form factors between patches, beside View3D")
    yield Words("""`tests/bench/form_factors.py` on one core: *of bare* is the time over that of
        a bare Embree loop over 4 million rays; *row sums* the largest error of a row's sum
        before scaling; *max*, *rms* errors of factors, *worst* their largest relative error.""")
    yield Table("`ffcalc`, in this run", head, rows, left=3)
    yield Table("View3D 4.0, measured before", ["scene", "patches", "seconds", "errors"],
                [r for r in VIEW3D if r[0] in plan.ff_scenes], left=1)
    if rest:
        yield Words(rest)
