"""Directional light: the paper's form factors and others, and lobes that become a mirror."""
import exponents
import lobes
from page import Bar, Table, Title, Words
from plot import Curve, Panel, draw
from speed import percent, seconds

SLOPE, AROUND = -1.4, .4       # of (H / mirror - 1) n, and what is near enough
SLOPED, SMALL = (30, 1000), 1e-3
NEAR = 1.05                    # both are judged by the same particles, whose noise is common


def compared(*arguments):
    """Of lobes.compare, at once."""
    return dict(lobes.compare(*arguments))


def submit_schemes(run):
    plan = run.plan
    how = plan.lobe_schemes, plan.lobe_samples, plan.lobe_size
    run.submit("lobes", {(scene, n): (compared, scene, n, *how)
                         for scene in plan.lobe_scenes or lobes.SCENES for n in plan.lobe_exponents})


def schemes(run):
    """The scheme of the paper beside those continued by rays."""
    names, rows, wins, count = run.plan.lobe_schemes, [], 0, 0
    for (scene, n), (got, _) in run.collected("lobes").items():
        count += 1
        wins += got["default"].rms <= NEAR * got["paper"].rms
        noise, stated = got["default"].noise, got["default"].stated
        rows.append([scene, f"{n:g}", *(percent(got[s].rms) for s in names), percent(noise),
                     percent(stated),
                     *(f"{100 * got[s].flux:+.1f} %" for s in names),
                     *(seconds(got[s].seconds) for s in names)])
    run.bars.append(Bar("directional form factors: the default beside the paper's",
                        "no worse anywhere", f"in {wins} of {count} scenes", wins == count))
    options = "; ".join(f"*{s}*: `ffcalc {' '.join(o)}`" if o else f"*{s}*: what `ffcalc` does"
                        for s, o in lobes.SCHEMES.items() if s in names)
    yield Title("Directional form factors: the paper's scheme and others")
    yield Words(f"""Irradiance that only directional light brings, element by element, against
        {run.plan.lobe_samples:g} particles (`tests/bench/lobes.py`, which describes the scenes;
        patches of {run.plan.lobe_size:g}): rms error relative to the mean, its part that is noise
        of the particles, the standard error that `shoot` states for the default; error of the
        flux; seconds of `ffcalc` and `shoot`. {options}.""")
    yield Table("", ["scene", "exponent", *(f"{s}: rms" for s in names), "noise", "stated",
                     *(f"{s}: flux" for s in names), *(f"{s}: seconds" for s in names)], rows)


def submit_exponents(run):
    folder = run.directory("exponents")
    run.submit("exponents", {n: (exponents.measure, n, folder) for n in (*run.plan.exponents, "inf")})


def exponent(run):
    """Lobes of growing exponent beside the mirror."""
    known, mirror = exponents.series()
    got = {n: result for n, (result, _) in run.collected("exponents").items()}
    finite, seen = [float(n) for n in run.plan.exponents], got["inf"][1]
    off = {float(n): (h / mirror - 1, l / seen - 1) for n, (h, l) in got.items() if n != "inf"}
    sloped = [n * off[n][0] for n in finite if SLOPED[0] <= n <= SLOPED[1]]
    ends = [abs(off[n][0]) for n in finite if n >= 1e4]
    rising = all(off[a][0] < off[b][0] + SMALL for a, b in zip(finite, finite[1:]))
    if sloped and ends:
        near = max(abs(s - SLOPE) for s in sloped) <= AROUND and max(ends) <= SMALL
        run.bars.append(Bar("exponents 1 … 1e6 and ∞", "smooth, to the mirror as −1.4/n",
                            f"{min(sloped):.2f}/n to {max(sloped):.2f}/n for n = {SLOPED[0]} … "
                            f"{SLOPED[1]}; {max(ends):.1e} at most from 1e4 on", rising and near))
    rows = []
    for n in run.plan.exponents:
        truth, error = known.get(float(n), (None, None))
        h, light = off[float(n)]
        rows.append([f"{n:g}", f"{got[n][0]:.7f}", f"{truth:.7f} ± {error:.7f}" if truth else "–",
                     f"{100 * h:.4f} %", f"{n * h:.2f}", f"{got[n][1]:.6f}", f"{100 * light:.3f} %",
                     f"{n * light:.2f}"])
    rows.append(["∞", f"{got['inf'][0]:.7f}", f"{mirror:.7f} (exact)", "", "", f"{seen:.6f}", "", ""])
    yield Title("A lobe becoming a mirror")
    yield Words("""`tests/bench/exponents.py`: irradiance that a lobe of this exponent brings to a
        receiver (pass 1), the same by particles, mean radiance of a view of the lobe (pass 2), and how
        far both are from the ideal mirror.""")
    yield draw(run.out, "exponents", "distance from the mirror against the exponent", [
        Panel("distance from the mirror", "exponent n", "relative", [
            Curve("irradiance", [(n, abs(off[n][0])) for n in finite]),
            Curve("particles", [(n, abs(h / mirror - 1)) for n, (h, _) in sorted(known.items())
                                if n in off], dashed=True),
            Curve("radiance", [(n, abs(off[n][1])) for n in finite]),
            Curve("1.4 / n", [(n, -SLOPE / n) for n in finite], dashed=True)])], across=1, wide=700)
    yield Table("", ["exponent", "H", "particles", "H / mirror − 1", "times n", "radiance",
                     "L / mirror − 1", "times n"], rows)
