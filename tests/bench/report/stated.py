"""What the programs state of their own errors, beside what these are."""
from page import Bar, Table, Title, Words
from speed import percent

SOLVED = ["scene", "solution", "sampling", "irradiance", "stated / true", "between elements",
          "picture by elements", "stated / true"]
SEEN = ["scene", "solution", "trace", "stated", "picture", "stated / true"]
LEDGER, FACTOR = 1e-12, 2


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


def section(run):
    views = [r.view for r in run.rows] + run.views
    solved, seen = [of_solution(r) for r in run.rows], [of_view(v) for v in views]
    residuals = [v.solved.stated["residual"] for v in views]
    worst = max((r for r in residuals if r is not None), default=None)
    run.bars += [
        bar("stated error of pictures", [r for _, r in seen]),
        bar("stated error of irradiance, from sampling", [r for _, r in solved]),
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
