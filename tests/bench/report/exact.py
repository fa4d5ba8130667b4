"""What other scripts of tests/ find: exact answers, hard cases, form factors."""
import os

import hard_cases as cases
import oracles as answers
from chain import TOP
from measure import script
from page import Bar, Listing, Table, Title, Words
from speed import seconds

FORM_FACTORS = os.path.join(TOP, "tests", "bench", "form_factors.py")
SECONDS = 60                # a scene
LONG = ("khodulev_cube", "furnace_mirror_mix", "emitter_diffuser_receiver")  # begin first
MARGIN, NOISE = .6, .5      # of a tolerance: what leaves room, and for two standard errors
VIEW3D = [  # on one core of such a machine, measured before
    ["cube16", "1536", ".34", "3.4e-7 at most, 2.2e-4 relative, row sums 1.3e-6"],
    ["cube24", "3456", ".75 – .8", "1e-4"],
    ["room", "480", "7 – 11", "row sums 1.3e-6"],
    ["city100", "100", ".5", "row sums 6e-2, tuned 9.5e-4"],
    ["city370", "369", "7", "row sums 5e-2, tuned 2.3e-3"],
    ["city2100", "2105", "–", "row sums .28"]]


# ---- exact answers ----

def submit_oracles(run):
    names = run.plan.oracles or sorted(answers.oracles(), key=lambda name: name not in LONG)
    run.submit("exact answers", {(name, method): (answers.timed, name, method)
                                 for name in names for method in run.plan.oracle_methods})


def settings(oracle):
    """What a scene is run with, in words."""
    patch, element, ffcalc, shoot = answers.settings_of(oracle, "best")
    size = lambda x: f"{x:.4g}" if isinstance(x, (int, float)) else "graded"
    return f"{size(patch)}, {size(element)}; `ffcalc {' '.join(ffcalc)}`; `shoot {' '.join(shoot)}`"


def oracle_rows(run, names):
    """Cells of the table, of each value, in the order of names; processor seconds of each
    scene and method."""
    got = {key: result for key, (result, _) in run.collected("exact answers").items()}
    keys = sorted(got, key=lambda key: names.index(key[0]))
    rows = list(answers.rows_of([value for key in keys for value in got[key][0]]))
    return rows, {key: got[key][1] for key in keys}


def oracle_bars(rows, took):
    """rows, took: of the settings chosen for the tolerances."""
    bad = sum(row[-1] == answers.FAILED for row in rows)
    slowest = max(took, key=took.get)
    yield Bar("every exact answer within its tolerance", f"all, ≤ {SECONDS} s a scene",
              f"{bad} of {len(rows)} lines fail; slowest {slowest[0]}, {took[slowest]:.0f} s",
              not bad and took[slowest] <= SECONDS)
    parts = [[float(row[i]) for row in rows if row[i]] for i in (7, 8)]
    for what, limit, found in (
            ("exact answers: deviations in parts of their tolerances", MARGIN, parts[0]),
            ("exact answers: two standard errors likewise", NOISE, parts[1])):
        within = sum(x <= limit for x in found)
        yield Bar(what, f"≤ {limit:g}", f"{within} of {len(found)}, at most {max(found):.2f}",
                  within == len(found))


def oracles(run):
    """Expected, got and tolerance of every scene with a known answer."""
    known = answers.oracles()
    rows, took = oracle_rows(run, list(known))
    best = [row for row in rows if row[1] == "best"], {k: t for k, t in took.items() if k[1] == "best"}
    if not run.plan.oracles:  # but all
        run.bars += oracle_bars(*best)
    yield Title("Exact answers")
    yield Words("""`tests/exact/oracles.py` on the scenes and tables of
        `tests/exact/data/global_illumination.json` and the Cornell box by wavelength, by settings
        chosen for their tolerances (`best`, table `BEST` of `tests/exact/oracle_settings.py`; other
        methods by its table `CLASSES`). *Of it* is the deviation in parts of the tolerance, and
        so are two standard errors: from the spread of independent runs, whose mean `best` is
        where it samples.""")
    marks = {i: "missed" for i, row in enumerate(rows) if row[-1] == answers.FAILED}
    yield Table("Values", list(answers.HEAD), rows, left=3).marked(marks)
    yield Table("Settings: sizes of patches and elements as parts of the longest edge",
                ["scene", "settings", "processor seconds"],
                [[name, settings(known[name]), seconds(spent)] for (name, method), spent in took.items()
                 if method == "best"], left=2)


# ---- hard cases ----

def submit_hard_cases(run):
    if run.plan.hard:
        run.submit("hard cases", {case: (cases.tried, case[0]) for case in cases.listed()})


def hard_cases(run):
    """Scenes that are numerically hard."""
    if not run.plan.hard:
        return
    tried = {case: notes for case, (notes, _) in run.collected("hard cases").items()}
    bad = {case: notes for case, notes in tried.items() if notes}
    run.bars.append(Bar("hard cases behave as stated", "all",
                        f"{len(tried) - len(bad)} of {len(tried)}", not bad))
    yield Title("Hard cases")
    yield Words(f"""`tests/exact/hard_cases.py`: {len(tried) - len(bad)} of {len(tried)} statements on
        the scenes of `tests/exact/data/hard_cases.json` hold{', all but these:' if bad else '.'}""")
    if bad:
        yield Listing("\n".join(f"{name}: {check}: {'; '.join(notes)}"
                                for (name, check), notes in bad.items()))


# ---- form factors ----

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
    run.factors = [dict(zip(head, row)) for row in rows]
    yield Title("Form factors between patches, beside View3D")
    yield Words("""`tests/bench/form_factors.py` on one core: *of bare* is the time over that of
        a bare Embree loop over 4 million rays; *row sums* the largest error of a row's sum
        before scaling; *max*, *rms* errors of factors, *worst* their largest relative error.""")
    yield Table("`ffcalc`, in this run", head, rows, left=3)
    yield Table("View3D 4.0, measured before", ["scene", "patches", "seconds", "errors"],
                [r for r in VIEW3D if r[0] in plan.ff_scenes], left=1)
    if rest:
        yield Words(rest)
