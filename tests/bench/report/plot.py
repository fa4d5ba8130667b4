"""Log-log plots by gnuplot, in SVG and PNG."""
import os
import subprocess

from chain import Failed
from page import Plot

STEPS = [float(f"{k}e{e}") for e in range(-15, 16) for k in (1, 2, 5)]
COLOURS = ["#0060ad", "#d95319", "#2e8b57", "#7b3294", "#8c6d1f", "#c2185b", "#00838f", "#555555"]
KINDS = {"svg": "svg size {wide},{high} font 'Helvetica,13' background 'white'",
         "png": "pngcairo size {wide},{high} font 'Helvetica,10'"}
HEAD = """
set logscale xy
set grid xtics ytics lt 1 lw .7 lc rgb '#d0d0d0'
set border lc rgb '#666666'
set tics nomirror
set format '%g'
set rmargin 21
set key outside right top Left reverse samplen 1.5
set multiplot layout {down},{across}
"""


class Curve:
    """name, points (x, y); dashed: a yardstick; joined: False for points that are no row."""

    def __init__(self, name, points, dashed=False, joined=True):
        self.name, self.dashed, self.joined = name, dashed, joined
        self.points = [(x, y) for x, y in points if x and y and x > 0 and y > 0]


class Panel:
    def __init__(self, title, x, y, curves):
        self.title, self.x, self.y = title, x, y
        self.curves = [c for c in curves if c.points]

    def axis(self, name, which):
        """Range and labels: 1, 2, 5 times powers of ten around the points, in long ranges
        the powers alone."""
        values = [p[which] for c in self.curves for p in c.points]
        low = max(s for s in STEPS if s <= min(values))
        high = min(s for s in STEPS if s >= max(values))
        labels = [s for s in STEPS if low <= s <= high]
        if len(labels) > 12:
            labels = [s for s in labels if f"{s:e}".startswith("1.0")]
        return (f"set {name}range [{low:g}:{high if high > low else 2 * high:g}]\n"
                f"set {name}tics ({', '.join(f'{s:g}' for s in labels)})")

    def commands(self, first, names):
        """The blocks of data are numbered from `first`; a name has one colour everywhere."""
        data, drawn = [], []
        for i, c in enumerate(self.curves):
            points = "\n".join(f"{x:.6g} {y:.6g}" for x, y in c.points)
            data.append(f"$d{first + i} << EOD\n{points}\nEOD")
            style = f"dt {2 if c.dashed else 1} lw 2 pt {6 if c.dashed else 7} ps .6 " \
                    f"lc rgb '{COLOURS[names.index(c.name) % len(COLOURS)]}'"
            how = "linespoints" if c.joined else "points"
            drawn.append(f"$d{first + i} using 1:2 with {how} {style} title {quoted(c.name)}")
        axes = (f"set title {quoted(self.title)}\nset xlabel {quoted(self.x)}\n"
                f"set ylabel {quoted(self.y)}\n{self.axis('x', 0)}\n{self.axis('y', 1)}")
        return "\n".join(data) + f"\n{axes}\nplot " + ", \\\n  ".join(drawn)


def quoted(words):
    return "'" + words.replace("'", "''") + "'"


def draw(directory, name, about, panels, across=2, high=330, wide=1200):
    """The panels as name.svg and name.png in the directory; a Plot for the page."""
    panels = [p for p in panels if p.curves]
    if not panels:
        raise Failed(f"nothing to draw in {name}")
    os.makedirs(directory, exist_ok=True)
    names = list(dict.fromkeys(c.name for p in panels for c in p.curves))
    down, at, commands = -(-len(panels) // across), 0, []
    for p in panels:
        commands.append(p.commands(at, names))
        at += len(p.curves)
    for kind, terminal in KINDS.items():
        words = (f"set terminal {terminal.format(wide=wide, high=high * down)} noenhanced\n"
                 f"set output '{name}.{kind}'\n" + HEAD.format(down=down, across=across)
                 + "\n".join(commands) + "\nunset multiplot\n")
        done = subprocess.run(["gnuplot"], input=words, text=True, check=False, cwd=directory,
                              capture_output=True)
        if done.returncode:
            raise Failed(f"gnuplot could not draw {directory}/{name}.{kind}: "
                         f"{done.stderr.strip().splitlines()[-1]}")
    return Plot(name + ".svg", about)
