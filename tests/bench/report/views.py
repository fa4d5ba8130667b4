"""The first and each further view of the Cornell box, by what `trace -d` offers."""
import json

import numpy as np

from chain import Failed
from measure import ran
from page import Bar, Table, Title, Words
from plot import Curve, Panel, draw
from setting import Solution, Solved, View
from speed import CENTRES, percent, seconds
from yardstick import QUANTILES

MESH, DIRECT, GATHER = "-d mesh", "-d direct", "-d gather"
DEFAULT = Solution("defaults")


def refined(size, error, rounds, rays):
    """A mesh of patches and elements of these sizes, refined by solutions with few rays."""
    name = f"`mesh {size}`, refined {('once', 'twice')[rounds - 1]} to {error}, `ffcalc -n {rays}`"
    return Solution(name, size.split(), ["-n", rays], rounds, ["--refine-error", error], ["-n", 1024])


TRACED = [  # solutions and options of trace, from fast to fine
    (Solution("`mesh -e 8%`, `ffcalc -n 256`", ["-e", "8%"], ["-n", 256]), [DIRECT]),
    (Solution("`mesh -p 10% -e 5.65%`, `ffcalc -n 1024`", ["-p", "10%", "-e", "5.65%"],
              ["-n", 1024]), [MESH, DIRECT]),
    (refined("-p 10% -e 5.65%", .02, 1, 1024), [MESH, DIRECT]),
    (DEFAULT, [MESH, DIRECT, "-d gather --gather-rays 256", GATHER, "-d gather --gather-rays 2048"]),
    (Solution("`mesh -e 2%`", ["-e", "2%"]), [MESH, DIRECT]),
    (refined("-p 7% -e 4%", .02, 1, 2048), [MESH, DIRECT]),
    (refined("-p 7% -e 4%", .01, 2, 8192), [MESH, DIRECT]),
    (refined("-p 7% -e 4%", .01, 2, 16384), [DIRECT, GATHER, "-d gather --gather-rays 2048"]),
    (refined("-e 4%", .005, 2, 16384), [MESH, DIRECT])]
FIRST = [(.045, .5), (.02, 1), (.01, 2.5), (.005, 10)]           # error, processor seconds
FURTHER = [("mesh", .02, .05), ("direct", .01, .4), ("gather", .005, 3)]
RADIANCE = [(3, .045), (5, .035), (17, .022), (52, .015)]        # rpict, measured before


class Refused:
    """Options that a program refused, and why."""

    def __init__(self, name, why):
        self.name, self.words = name, f"{name}: {why}"


def views_of(scene, plan):
    for solution, traced in TRACED[:plan.solutions]:
        try:
            solved = Solved(scene, solution, plan.repeat_views, threads=1)
        except Failed as e:
            yield Refused(solution.name, str(e))
            continue
        for options in traced:
            try:
                yield View(solved, options, [*options.split(), *CENTRES], plan.repeat_views, 1)
            except Failed as e:
                yield Refused(f"`trace {options}`", str(e))


HEAD = ["solution", "trace", "elements", "view 1", "view 2 …", "error", "bias", "95 %", "99 %",
        "stated", "reference, as view 1", "as view 2 …"]
SHORT = slice(0, 9)  # columns of RESULTS.md


def cells(view, ladder):
    e = view.errors
    return [view.solved.solution.name, f"`{view.name}`", f"{view.solved.elements:.0f}",
            seconds(view.seconds()), seconds(view.cpu),
            percent(e.rmse, 2), f"{100 * e.bias:+.2f} %", *(percent(e.tail[q]) for q in QUANTILES),
            percent(view.stated, 2),
            percent(ladder.at(view.seconds())), percent(ladder.at(view.cpu))]


def method(view):
    words = view.name.split()
    return words[words.index("-d") + 1] if "-d" in words else "mesh"


def chosen(views, error, limit, cost):
    """The best view within the limit of cost; if that is not good enough, the cheapest that
    is, else the best."""
    rmse = lambda v: v.errors.rmse
    within = min((v for v in views if cost(v) <= limit), key=rmse, default=None)
    if within and rmse(within) <= error:
        return within
    best = min(views, key=rmse, default=None)
    return min((v for v in views if rmse(v) <= error), key=cost, default=best)


def bar_of(what, views, error, limit, cost):
    v = chosen(views, error, limit, cost)
    bar = f"{100 * error:g} % in ≤ {limit:g} s"
    if not v:
        return Bar(what, bar, "", None), None
    return Bar(what, bar, f"{percent(v.errors.rmse, 2)} in {cost(v):.2f} s: "
               f"{v.solved.solution.name}, `trace {v.name}`",
               v.errors.rmse <= error and cost(v) <= limit), v


def bars(views):
    used, percent_one = [], None
    for error, limit in FIRST:
        bar, v = bar_of("Cornell box, view 1, everything included", views, error, limit, View.seconds)
        used += [v]
        percent_one = v if error == .01 else percent_one
        yield bar
    for name, error, limit in FURTHER:
        mine = [v for v in views if method(v) == name]
        bar, v = bar_of(f"each further view, `{name}`", mine, error, limit, lambda v: v.cpu)
        used += [v]
        yield bar
    used = [v for v in used if v]
    worst = max((v.errors.bias for v in used), key=abs, default=None)
    yield Bar("bias of the mean radiance, of these views", "≤ .2 %",
              f"at most {100 * worst:+.2f} %" if used else "", abs(worst) <= .002 if used else None)
    yield tail_bar(percent_one.errors if percent_one else None)


def tail_bar(errors):
    """Of the view that meets 1 %."""
    what, bar = "99th percentile of relative pixel error at the 1 % setting", "≤ 5 %"
    if not errors:
        return Bar(what, bar, "", None)
    return Bar(what, bar, f"{percent(errors.tail[99])} (the yardstick's own, "
               f"{percent(errors.noise[99])}, taken off)", errors.tail[99] <= .05)


def submit(run):
    run.scene("cornell")


def section(run):
    scene = run.scene("cornell")
    every = list(run.told("views of the Cornell box", views_of(scene, run.plan)))
    views = [v for v in every if isinstance(v, View)]
    ladder = scene.picture_ladder(run.plan.ladder)
    run.views += views
    run.bars += bars(views)
    yield Title("First and further views of the Cornell box")
    yield Words(f"""`cornell`, camera `{scene.camera}`, {scene.size()}, one sample at the centre of
        each pixel; seconds of one processor (`-j 1`), medians of {run.plan.repeat_views}. *View 1*
        is everything: `mesh`, `ffcalc`, `shoot` and a view; *view 2 …* is what each further one
        costs, a run of `trace` by itself. *Error* is the rmse over the mean of all pixels that
        see neither the lamp nor nothing, *bias* that of the mean, *95 %* and *99 %* percentiles of
        the relative error of pixels, without the yardstick's noise. *Refined* is
        `mesh --refine` by solutions with `ffcalc -n 1024`, whose seconds count; *stated* is
        the error that `trace` itself prints. The last columns are the error of `reference`
        after the same processor seconds. The plot leaves out what something faster is better
        than.""")
    points = lambda name, x: [(x(v), 100 * v.errors.rmse) for v in views if method(v) == name]
    reference = Curve("reference", [(x, 100 * y) for x, y in ladder.points], dashed=True)
    names = [name for name, _, _ in FURTHER]
    first = [Curve(n, front(points(n, View.seconds))) for n in names]
    further = [Curve(n, front(points(n, lambda v: v.cpu))) for n in names]
    theirs = Curve("Radiance, before", [(x, 100 * y) for x, y in RADIANCE], dashed=True)
    yield draw(run.out, "views", "error of the Cornell box against the seconds of the first and of "
               "each further view", [
                   Panel("view 1, everything included", "seconds of one processor", "relative rmse, %",
                         first + [reference, theirs]),
                   Panel("each further view", "seconds of one processor", "relative rmse, %",
                         further + [reference])])
    rows = [cells(v, ladder) for v in views]
    run.tables["views"] = Table("", HEAD[SHORT], [row[SHORT] for row in rows], left=2)
    yield Table("", HEAD, rows, left=2)
    refused = list(dict.fromkeys(v.words for v in every if isinstance(v, Refused)))
    if refused:
        yield Words("Could not be had: " + "; ".join(refused) + ".")
    yield from resolved(run, scene)


def front(points):
    """Those that no faster one is better than."""
    best, kept = float("inf"), []
    for x, y in sorted(points):
        if y < best:
            best = y
            kept.append((x, y))
    return kept


def repaint(scene):
    """A copy of the scene whose walls all return a tenth less."""
    with open(scene.gltf) as f:
        root = json.load(f)
    for material in root["materials"]:
        model = material["extras"]["twopass"]
        model["rho_d"] = [.9 * x for x in np.broadcast_to(model["rho_d"], 3)]
    path = scene.path("repainted.gltf")
    with open(path, "w") as f:
        json.dump(root, f)
    return path


def resolved(run, scene):
    """The cost of new paint, with the form factors of the old."""
    Solved(scene, DEFAULT)
    gltf, mesh = repaint(scene), scene.path("mesh")
    made = [ran(*words, threads=1) for words in (
        ("mesh", gltf, "-o", mesh), ("ffcalc", mesh, "-o", scene.path("ff")),
        ("shoot", mesh, scene.path("ff"), "-o", scene.path("rad")))]
    cost, kept = sum(r.cpu for r in made), "up to date" in made[1].text
    run.bars.append(Bar("Cornell box repainted: form factors kept", "≤ .2 s",
                        f"{cost:.3f} s{'' if kept else ', form factors made anew'}",
                        kept and cost <= .2))
    yield Words(f"""All walls painted anew: `mesh` {made[0].cpu:.3f} s, `ffcalc`
        {made[1].cpu:.3f} s ({'up to date' if kept else 'made anew'}), `shoot` {made[2].cpu:.3f} s.""")
