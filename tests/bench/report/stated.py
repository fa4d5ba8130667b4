"""What the programs state of their own errors, beside what these are."""
import math

from page import Bar, Table, Title, Words
from speed import percent

HEAD = ["scene", "solution", "view", "sampling", "discretisation", "irradiance", "stated / true", "picture, stated",
        "picture", "stated / true"]
LEDGER, FACTOR = 1e-12, 2


def ratio(stated, true):
    return stated / true if stated and true else None


def shown(x):
    return "–" if x is None else f"{x:.2f}"


class Statement:
    def __init__(self, view):
        solved = view.solved
        said = [solved.stated[k] for k in ("sampling", "discretisation")]
        self.irradiance = ratio(math.hypot(*(x or 0 for x in said)), solved.irradiance)
        self.picture = ratio(view.stated, view.errors.rmse)
        self.cells = [solved.scene.name, solved.solution.name, f"`{view.name}`" if view.name else "", *map(percent, said),
                      percent(solved.irradiance), shown(self.irradiance), percent(view.stated, 2),
                      percent(view.errors.rmse, 2), shown(self.picture)]


def bar(what, ratios):
    known = [r for r in ratios if r is not None]
    if not known:
        return Bar(what, "within a factor 2", "nothing stated", None)
    within = sum(1 / FACTOR <= r <= FACTOR for r in known)
    return Bar(what, "within a factor 2", f"{within} of {len(known)}; stated / true from "
               f"{min(known):.2f} to {max(known):.2f}", within == len(known))


def section(run):
    views = [r.view for r in run.rows] + run.views
    statements = [Statement(v) for v in views]
    worst = max((v.solved.stated["residual"] for v in views if v.solved.stated["residual"] is not None),
                default=None)
    run.bars += [
        bar("stated error of pictures", [s.picture for s in statements]),
        bar("stated error of irradiance", [s.irradiance for s in statements]),
        Bar("ledger, after every shot", f"≤ {LEDGER:g}", f"{worst:.1e} at most" if worst is not None else "",
            worst <= LEDGER if worst is not None else None)]
    yield Title("Stated and true errors")
    yield Words("""`shoot` states the standard error of sampled form factors and an estimate of what the
        division into elements costs, `trace` the relative rmse of its picture; beside them the
        true ones as above. The stated error of irradiance is the root of both squares.""")
    yield Table("", HEAD, [s.cells for s in statements], left=3)
