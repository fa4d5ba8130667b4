"""What the programs state of their own errors, beside what these are."""
import os

import uneven
from exact import markdown
from measure import ran
from page import Bar, Table, Title, Words
from setting import View
from speed import percent, seconds

SOLVED = ["scene", "solution", "sampling", "irradiance", "stated / true", "between elements",
          "picture by elements", "stated / true"]
SEEN = ["scene", "solution", "trace", "stated", "picture", "stated / true"]
LOBES_SEEN = ["scene", "solution", "trace", "seconds", "picture", "bias", "stated", "stated / true"]
ROOMS = ["rooms", "of them", "true / stated, rms", "least", "first quarter", "median", "third quarter",
         "largest", "true error, median", "worst mean of a surface, median", "largest"]
LEDGER, FACTOR = 1e-12, 2
# How lobes of finite exponent are seen: the paper's way, and others.
LOBES = ["--lobe-samples 0", "--lobe-samples 4", "--lobe-samples 16", ""]


def ratio(stated, true):
    return stated / true if stated and true else None


def shown(x):
    return "–" if x is None else f"{x:.2f}"


def of_solution(row):
    """Cells, and stated / true of the irradiance of elements."""
    solved, true = row.solved, row.solved.irradiance
    sampling, between = solved.stated["sampling"], solved.stated["elements"]
    return [row.scene, row.name, percent(sampling), percent(true), shown(ratio(sampling, true)),
            percent(between), percent(row.view.errors.rmse),
            shown(ratio(between, row.view.errors.rmse))], ratio(sampling, true)


def of_view(view):
    true = view.errors.rmse
    return [view.solved.scene.name, view.solved.solution.name, f"`{view.name}`",
            percent(view.stated, 2), percent(true, 2),
            shown(ratio(view.stated, true))], ratio(view.stated, true)


def bar(what, ratios):
    known = [r for r in ratios if r is not None]
    if not known:
        return Bar(what, "within a factor 2", "nothing stated", None)
    within = sum(1 / FACTOR <= r <= FACTOR for r in known)
    return Bar(what, "within a factor 2", f"{within} of {len(known)}; stated / true from "
               f"{min(known):.2f} to {max(known):.2f}", within == len(known))


def views_of_lobes(run):
    """Of what was solved last of each scene with lobes."""
    last = {r.solved.scene.name: r.solved for r in run.rows if r.scene != "cornell"}
    for name, solved in last.items():
        run.tell(f"lobes as the eye sees them: {name}")
        for options in LOBES:
            yield View(solved, f"-d direct {options}".strip(), ["--samples", 1, *options.split()],
                       run.plan.repeat)


def of_lobes(view):
    e = view.errors
    return [view.solved.scene.name, view.solved.solution.name, f"`{view.name}`", seconds(view.cpu),
            percent(e.rmse), f"{100 * e.bias:+.2f} %", percent(view.stated),
            shown(ratio(view.stated, e.rmse))]


def best(views):
    """Whether the default has the least error of each scene."""
    by_scene = {}
    for v in views:
        by_scene.setdefault(v.solved.scene.name, []).append(v.errors.rmse)
    found = "; ".join(f"{name} {percent(errors[-1])}, one ray {percent(errors[0])}"
                      for name, errors in by_scene.items())
    return Bar("lobes as the eye sees them", "less error than by one ray", found,
               all(e[-1] < e[0] for e in by_scene.values()) if by_scene else None)


def rooms(run):
    for i in range(run.plan.rooms):
        kind = uneven.KINDS[i % len(uneven.KINDS)]
        run.tell(f"rooms drawn at random: {i + 1} of {run.plan.rooms}")
        yield uneven.try_room(1000 + i, kind, run.plan.room_particles)


def of_rooms(what, tried):
    """The distribution of true over stated errors."""
    worst = sorted(abs(t.worst) for t in tried)
    errors = sorted(t.error for t in tried)
    return [what, len(tried), f"{uneven.rms_of(tried):.2f}",
            *(f"{x:.2f}" for x in uneven.quantiles(tried)), percent(errors[len(errors) // 2]),
            percent(worst[len(worst) // 2]), percent(worst[-1])]


def pairs(run):
    """Of form factors of polygons at random, by tests/bench/pairs.c."""
    run.tell("stated errors of random pairs")
    head, rows, _ = markdown(ran(os.path.join("bench", "pairs"), 1, run.plan.pairs).text)
    run.bars.append(Bar("stated error of form factors", "none beyond it and `-t`",
                        "; ".join(f"{row[-1]} at {row[0]}" for row in rows),
                        all(row[-1] == "0" for row in rows)))
    yield Words(f"""Form factors of {run.plan.pairs} random pairs with plates, slats or boxes between, beside
        brute force: how the ratio of true to stated error is distributed, and how many are off by
        more than they state, and than that and the error asked for.""")
    yield Table("Pairs of polygons", head, rows, left=1)


def section(run):
    tried = list(rooms(run))
    kinds = sorted({t.kind for t in tried}, key=uneven.KINDS.index)
    lobes = list(views_of_lobes(run))
    views = [r.view for r in run.rows] + run.views + lobes
    solved, seen = [of_solution(r) for r in run.rows], [of_view(v) for v in views]
    residuals = [v.solved.stated["residual"] for v in views]
    worst = max((r for r in residuals if r is not None), default=None)
    run.bars += [
        best(lobes), bar("stated error of pictures", [r for _, r in seen]),
        bar("stated error of irradiance, from sampling", [r for _, r in solved]),
        Bar("stated error of irradiance, rooms at random", "true / stated, rms .7 to 1.4, none above 2",
            f"rms {uneven.rms_of(tried):.2f}, largest {uneven.quantiles(tried)[-1]:.2f}",
            .7 <= uneven.rms_of(tried) <= 1.4 and uneven.quantiles(tried)[-1] <= 2),
        Bar("ledger, after every shot", f"≤ {LEDGER:g}",
            "" if worst is None else f"{worst:.1e} at most",
            None if worst is None else worst <= LEDGER)]
    yield Title("Stated and true errors")
    yield Words("""`shoot` states the standard error of the irradiance of elements that follows
        from the samples in form factors (from above), and how far interpolation *between
        elements* is off; `trace` the
        relative rmse of its picture. Beside them the true errors, as above; interpolation is
        part of the error of a picture by elements (`trace -d mesh`), which has more.""")
    yield Table("Solutions", SOLVED, [cells for cells, _ in solved], left=2)
    yield Table("Pictures", SEEN, [cells for cells, _ in seen], left=3)
    yield Words("""Rooms drawn at random, with lamps close to walls and in coves, turned at random: the
        irradiance of elements against particles (`tests/bench/uneven.py`). A kind says what stands
        in the room beside boxes. Errors are over the mean irradiance, those of surfaces over
        their own.""")
    yield Table("Stated against true", ROOMS,
                [of_rooms(k, [t for t in tried if t.kind == k]) for k in kinds] +
                [of_rooms("all", tried)], left=1)
    yield from pairs(run)
    if lobes:
        yield Words("""Lobes of finite exponent in pictures, from what was solved last: by one ray
            about the axis (the paper's way), by samples, and by as many as their noise asks for (the
            default). What is stated of one ray comes from lobes that are sampled beside.""")
        yield Table("Lobes as the eye sees them", LOBES_SEEN, [of_lobes(v) for v in lobes], left=3)
