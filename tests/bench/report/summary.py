"""The table of README.md: what the defaults take and how far they are off, beside other programs."""
from exact import VIEW3D
from page import Table
from speed import percent, seconds
from views import DEFAULT, DIRECT, GATHER, RADIANCE

HEAD = ["", "seconds", "each further view", "error", "other programs, measured before"]
PATCHES = ("cube16", "room", "city100")


def default_views(run):
    """Of the Cornell box as a section of its own has them, of other scenes with their solutions."""
    yield from (v for v in run.views if v.solved.solution is DEFAULT and v.name in (DIRECT, GATHER))
    yield from (r.by_default for r in run.rows if r.by_default and r.scene != "cornell")


def of_view(view):
    name = view.solved.scene.name
    other = "; ".join(f"{percent(error)} in {time:g} s" for time, error in (RADIANCE[0], RADIANCE[-1]))
    options = f", `trace {view.name}`" if view.name == GATHER else ""
    return [f"picture of `{name}`{options}", seconds(view.seconds()), seconds(view.cpu),
            percent(view.errors.rmse, 2), f"Radiance: {other}" if view.name == DIRECT else ""]


def errors(cells):
    """Of form factors, as VIEW3D states them; the factors of few scenes are known."""
    known = f"{cells['max']} at most, {cells['worst']} relative, " if cells["worst"] else ""
    return f"{known}row sums {cells['row sums']}"


def of_factors(cells):
    time, other = next(row[2:] for row in VIEW3D if row[0] == cells["scene"])
    return [f"form factors of `{cells['scene']}`, {cells['patches']} patches, {cells['ffcalc']}",
            cells["user"], "", errors(cells), f"View3D: {time} s, {other}"]


def table(run):
    return Table("", HEAD, [*map(of_view, default_views(run)),
                            *(of_factors(cells) for cells in run.factors if cells["scene"] in PATCHES)])
