"""Speed against error of all stages: each method of ffcalc at four settings, and other
settings of mesh, through the chain on cornell, two-pass and clutter."""
from chain import Failed
from page import Table, Title, Words
from plot import Curve, Panel, draw
from setting import Solution, Solved, View

METHODS = {  # options of ffcalc, from fast to fine
    "hemicube": ["-n 16 -p 4", "-n 32 -p 4", "-n 32 -p 16", "-n 64 -p 16"],
    "rays": ["-n 256", "-n 1024", "-n 4096", "-n 16384"],
    "auto": ["-n 256 -t 1e-3", "-n 1024 -t 1e-3", "-n 4096 -t 1e-4", "-n 16384 -t 1e-5"],
    "analytic": ["-n 256 -t 1e-2", "-n 1024 -t 1e-3", "-n 4096 -t 1e-4", "-n 16384 -t 1e-5"]}
DEFAULTS = ("auto", "-n 4096 -t 1e-4")
OTHERS = [Solution("`mesh -e 2%`", ["-e", "2%"]),
          Solution("`mesh -e 2%`, `ffcalc -n 16384`", ["-e", "2%"], ["-n", 16384])]
LONG = ("two-pass", "analytic")
# One position in a pixel, its centre, for the yardstick has that too.
CENTRES = ["--samples", 1]
SMOOTH = ["-d", "mesh", *CENTRES, "--lobe-samples", 16]
HEAD = ["scene", "setting", "mesh", "ffcalc", "shoot", "first view", "further view", "MB",
        "picture", "of reference", "bias", "99 %", "irradiance", "of reference"]
SHORT = (0, 1, 3, 4, 5, 8, 10, 12)  # columns of RESULTS.md


def percent(x, digits=1):
    return "–" if x is None else f"{100 * x:.{digits}f} %"


def seconds(x):
    return "–" if x is None else f"{max(0, x):.2f}" if x < 10 else f"{x:.0f}"


def tail(errors):
    """The 99th percentile, unless most of it may be the yardstick's noise."""
    return percent(errors.tail[99] if errors.noise[99] <= errors.tail[99] / 2 else None)


class Row:
    """A solution and its first view."""

    def __init__(self, scene, solution, repeat):
        self.scene, self.method, self.name = scene.name, solution.method, solution.name
        self.solved = Solved(scene, solution, repeat)
        self.view = View(self.solved, " ".join(map(str, SMOOTH)), SMOOTH, repeat, further=True)
        default = solution.ffcalc == words_of(*DEFAULTS)
        self.by_default = View(self.solved, "", CENTRES, repeat) if default else None

    def cells(self, ladders):
        solved, view, e = self.solved, self.view, self.view.errors
        return [self.scene, self.name, *map(seconds, solved.cpu), seconds(view.cpu),
                seconds(view.further), f"{solved.memory:.0f}", percent(e.rmse),
                percent(ladders[0].at(view.seconds())), f"{100 * e.bias:+.2f} %", tail(e),
                percent(solved.irradiance),
                percent(ladders[1].at(solved.seconds())) if solved.irradiance else "–"]


def words_of(method, options):
    """Of ffcalc."""
    return ["-m", method, *options.split()]


def solutions(scene, plan):
    for method in plan.methods(scene.name):
        for options in METHODS[method][:plan.settings(scene.name, method)]:
            name = f"`-m {method} {options}`"
            if (method, options) == DEFAULTS:
                name += ", the defaults"
            yield Solution(name, ffcalc=words_of(method, options), method=method)
    yield from OTHERS[:plan.settings(scene.name, None)]


def panels(name, rows, ladders):
    """Picture and irradiance of a scene, a curve for each method."""
    def curves(x, y):
        by_method = [Curve(m, [(x(r), y(r)) for r in rows if r.method == m]) for m in METHODS]
        return by_method + [Curve("other settings", [(x(r), y(r)) for r in rows if not r.method],
                                  joined=False)]

    def times(f):
        return lambda r: 100 * f(r) if f(r) else None

    dashed = [Curve("reference", [(x, 100 * y) for x, y in l.points], dashed=True) for l in ladders]
    picture = curves(lambda r: r.view.seconds(), times(lambda r: r.view.errors.rmse))
    lit = curves(lambda r: r.solved.seconds(), times(lambda r: r.solved.irradiance))
    return [Panel(f"{name}: picture", "processor seconds up to the first view", "relative rmse, %",
                  picture + dashed[:1]),
            Panel(f"{name}: irradiance of elements", "processor seconds of mesh, ffcalc and shoot",
                  "relative rmse, %", lit + dashed[1:])]


def submit(run):
    for name in run.plan.scenes:
        run.scene(name)


def section(run):
    """Fills run.rows and the scenes' yardsticks."""
    rows, drawn, failed = [], [], []
    for name in run.plan.scenes:
        scene = run.scene(name)
        mine = []
        for solution in run.told(f"speed against error, {name}", solutions(scene, run.plan)):
            try:
                mine.append(Row(scene, solution, run.plan.repeat))
            except Failed as e:
                failed.append(f"{name}, {solution.name}: {e}")
        ladders = (scene.picture_ladder(run.plan.ladder), scene.irradiance_ladder(run.plan.crowd))
        run.rows += mine
        rows += [r.cells(ladders) for r in mine]
        drawn += panels(name, mine, ladders)
    yield Title("Speed against error of all stages")
    yield Words(f"""Processor seconds of each stage, of all threads together; medians of
        {run.plan.repeat}. `trace` runs with `{' '.join(map(str, SMOOTH))}`, also for the
        defaults; a further view is one more camera in the same run. *MB* is the peak of memory.
        *Picture* is the relative rmse of the first view at the centres of its pixels, *bias*
        of its mean, *99 %* the 99th percentile of the relative error of pixels (lengths over
        R, G, B; without the yardstick's noise, – where that is more than half),
        all without the pixels that see a lamp or nothing. *Irradiance* is the relative rmse of
        elements, weighted by area. *Of reference* is what `reference` reaches in the same
        processor seconds, between runs of {listed(run.plan.ladder)} paths a pixel and
        {listed(run.plan.crowd)} particles, and beyond them by the square root.""")
    yield Words("Yardsticks: " + "; ".join(
        f"{s.name}, camera {s.camera} {s.size()}: {s.samples} paths in every ninth pixel, whose "
        f"99 % is {percent(noise(mine_of(run.rows, s.name)))}; {s.particles:g} particles"
        for s in run.scenes.values()) + ". " + run.plan.left_out())
    yield draw(run.out, "speed", "error against processor seconds of four methods of form factors "
               "in three scenes, picture and irradiance, beside path tracing", drawn)
    run.tables["speed"] = short(rows)
    yield Table("", HEAD, rows, left=2)
    if failed:
        yield Words("Could not be had: " + "; ".join(failed) + ".")


def short(rows):
    """The table of RESULTS.md."""
    pick = lambda row: [row[c] for c in SHORT]
    return Table("", pick(HEAD), [pick(row) for row in rows], left=2)


def submit_long(run):
    run.scene(LONG[0])


def long_section(run):
    """The settings of a scene and a method that take minutes each."""
    name, method = LONG
    scene, rows = run.scene(name), []
    for options in run.told(f"{method} on {name}", METHODS[method]):
        words = words_of(method, options)
        solution = Solution(f"`{' '.join(words)}`", ffcalc=words, method=method)
        rows.append(Row(scene, solution, run.plan.repeat))
    ladders = (scene.picture_ladder(run.plan.ladder), scene.irradiance_ladder(run.plan.crowd))
    cells = [row.cells(ladders) for row in rows]
    run.tables["speed-long"] = short(cells)
    yield Title(f"Speed against error: {method} on {name}")
    yield Table("", HEAD, cells, left=2)


def listed(numbers):
    return ", ".join(f"{n:g}" for n in numbers)


def mine_of(rows, name):
    return [r for r in rows if r.scene == name]


def noise(rows):
    """Of the yardstick, in the 99th percentile."""
    return rows[0].view.errors.noise[99] if rows else None
