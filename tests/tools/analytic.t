#!/bin/sh
# tier: slow
# ffcalc -m analytic --to patches: threads, shards, reciprocity, what it leaves to rays.
. "$(dirname "$0")/tap.sh"

patches="-m analytic --to patches --precision f64"
matrix() { inspect --patch-matrix "$1" >"$2"; }

prepare mesh "$scenes/cornell.gltf" -o "$T/a.mesh" -p 25% -e 25%
prepare ffcalc $patches -j 1 "$T/a.mesh" -o "$T/one.ff"
prepare ffcalc $patches -j 2 "$T/a.mesh" -o "$T/two.ff"
check "-j 1 as -j 2" cmp "$T/one.ff" "$T/two.ff"

prepare matrix "$T/one.ff" "$T/0.csv"
for part in 1 2 3; do
	prepare ffcalc $patches --part $part/3 "$T/a.mesh" -o "$T/$part.ff"
	prepare matrix "$T/$part.ff" "$T/$part.csv"
done

cat >"$T/join.py" <<'END'
import csv, os, sys
def rows(number):
    # A matrix has a column `unmodelled` only where something is.
    with open(os.path.join(sys.argv[1], f"{number}.csv")) as f:
        return [{"unmodelled": "0", **row} for row in csv.DictReader(f)]
assert rows(0) == rows(1) + rows(2) + rows(3)
END
check "three shards have the rows of the whole" "$PYTHON" "$T/join.py" "$T"

# Rows are scaled to sum to 1: what is stored is not.
cat >"$T/reciprocal.py" <<'END'
import csv, sys
from collections import defaultdict
from chain import container, run, table
area = defaultdict(float)
for r in table(run("inspect", "--csv", sys.argv[1]).stdout):
    area[int(r["patch"]), r["side"]] += r["area"]
area = [area[key] for key in sorted(area)]
_, arrays = container(sys.argv[2])
with open(sys.argv[3]) as text:
    _, *lines = csv.reader(text)
scale = arrays["row_scale"]
f = [[float(x) / s for x in line[1:len(area) + 1]] for line, s in zip(lines, scale)]
assert len(f) == len(area), (len(f), len(area))
n = range(len(area))
worst = max(abs(area[i] * f[i][j] / (area[j] * f[j][i]) - 1) for i in n for j in n if f[i][j])
assert worst <= 4e-15, f"reciprocity is off by {worst}"
END
check "reciprocal to rounding" "$PYTHON" "$T/reciprocal.py" "$T/a.mesh" "$T/one.ff" "$T/0.csv"

# What a factor costs in the file: 4 bytes are its value.
cat >"$T/bytes.py" <<'END'
import os, sys
from chain import container
cost = os.path.getsize(sys.argv[1]) / container(sys.argv[1])[1]["value"].size
print(f"{cost:.3f} bytes a factor")
assert cost <= float(sys.argv[2])
END
costs() {
	prepare "$PYTHON" "$top/tests/bench/ff_scenes.py" "$1" "$T/c.gltf"
	prepare mesh -p inf -e inf "$T/c.gltf" -o "$T/c.mesh"
	prepare ffcalc --to patches -t "$3" "$T/c.mesh" -o "$T/c.ff"
	check "$1: at most $2 bytes a factor" "$PYTHON" "$T/bytes.py" "$T/c.ff" "$2"
	check "$1: rows close, factors are reciprocal" inspect --verify "$T/c.ff"
}
costs cube12 4.2 1e-6
costs city100 8 1e-4

# Each factor's own error; a row that misses by more than it states is refused.
prepare ffcalc --to patches -t 1e-4 --pair-errors "$T/c.mesh" -o "$T/e.ff"
cat >"$T/errors.py" <<'END'
import sys
from chain import container
import numpy as np
_, a = container(sys.argv[1])
start = a["block_start"].astype(int)
sums = np.array([a["value_error"][i:j].sum(dtype=float) for i, j in zip(start, start[1:])])
# Factors of 0 have an error, too, but no entry.
assert (sums <= (1 + 1e-5) * a["row_error"]).all() and sums.sum() > .5 * a["row_error"].sum()
END
check "errors of factors are those of rows" "$PYTHON" "$T/errors.py" "$T/e.ff"
check "inspect --row shows them" sh -c "inspect --row 0 '$T/e.ff' | grep -q '^chain,to,element,value,error$'"

# A row of spans that others share, as inspect and the program in ff(5) read it.
prepare "$PYTHON" "$top/tests/bench/ff_scenes.py" cube6 "$T/c.gltf"
prepare mesh -p inf -e inf "$T/c.gltf" -o "$T/c.mesh"
prepare ffcalc --to patches "$T/c.mesh" -o "$T/c.ff"
for row in 0 100 215; do
	check "row $row: what the reader of ff(5) prints" sh -c "
	inspect --npy patch-matrix '$T/c.ff' >'$T/c.npy'
	$PYTHON '$top/tests/independent/read_row.py' '$T/c.ff' $row >'$T/read' && $PYTHON -c '
import sys, numpy as np
lines = [line.split() for line in open(sys.argv[1])]
row = np.zeros(216)
row[[int(line[1]) for line in lines]] = [float(line[3]) for line in lines]
assert len(lines) == 180 and (row == np.load(sys.argv[2])[$row, :216]).all()' '$T/read' '$T/c.npy'"
done

# A curved patch among plane ones: pairs of these stay reciprocal to rounding, and all is
# as rays of another run say, at 4.5 standard errors for each receiver.
prepare "$PYTHON" "$top/tests/bench/ff_scenes.py" ball "$T/ball.gltf"
prepare mesh -p inf -e inf --normal-cone 40 "$T/ball.gltf" -o "$T/ball.mesh"
ffcalc --to patches --precision f64 -t 1e-4 "$T/ball.mesh" -o "$T/ball.ff" >"$T/said" 2>&1
check "says that pairs with a curved patch are by rays" \
	grep -q '^by rays  *pairs with 1 of 55 patch-sides: they are curved$' "$T/said"
prepare ffcalc --to patches -m rays -n 65536 --seed 2 "$T/ball.mesh" -o "$T/rays.ff"
for name in ball rays; do
	prepare sh -c "inspect --npy patch-matrix '$T/$name.ff' >'$T/$name.npy'"
done
cat >"$T/ball.py" <<'END'
import json, sys
import numpy as np
from chain import form_factors
f, g = (np.load(sys.argv[1] + name)[:, :-1] for name in ("/ball.npy", "/rays.npy"))
meta, a = form_factors(sys.argv[1] + "/ball.ff")
names = [json.loads(meta["surfaces"])[s] for s in a["patch_surface"]]
plane = [i for i, name in enumerate(names) if name != "ball"]
assert len(plane) == len(names) - 1
exchange = (a["patch_area"] / a["row_scale"])[:, None] * f
e = exchange[np.ix_(plane, plane)]
assert abs(e - e.T).max() <= 1e-15 * e.max(), "not reciprocal"
assert abs(f.sum(1) - 1).max() < 1e-12, "not closed"
# The variance of one receiver's share of independent rays bounds that of stratified ones.
error = np.sqrt(g * (1 - g) * (1 / 65536 + 1 / 4096)) + 1 / 4096
assert (abs(f - g) <= 4.5 * error + 1e-4).all(), abs(f - g).max()
_, r = form_factors(sys.argv[1] + "/rays.ff")
stated = np.hypot(a["row_error"], r["row_error"])
off = np.sqrt(((f - g) ** 2).sum(1)) / stated
assert np.sqrt((off ** 2).mean()) < 1.5, f"rows are off by {off.mean():.2f} stated errors"
END
check "a curved patch: plane pairs reciprocal, rows closed, as rays say" "$PYTHON" "$T/ball.py" "$T"
check "a curved patch: inspect --verify" inspect --verify "$T/ball.ff"
prepare ffcalc --to patches --precision f64 -t 1e-4 -j 1 "$T/ball.mesh" -o "$T/one.ff"
check "a curved patch: -j 1 as -j 2" cmp "$T/one.ff" "$T/ball.ff"

# To elements: rows by formula trust their own sum, also where rays miss the receiver.
cat >"$T/elements.py" <<'END'
import sys
lines = [line.split() for line in sys.stdin]
assert len(lines) == 7, lines
for case, _, expected, got, *_ in lines[1:]:
    assert abs(float(got) - float(expected)) <= 1e-8 * float(expected), (case, expected, got)
END
check "to elements: six pairs to 1e-8" sh -c "
$PYTHON '$top/tests/exact/form_factors.py' -m analytic -o '-n 1024' par_C11_1 par_C13_3 tri_vertex \
	tri_edge_179deg touching5 far3 | $PYTHON '$T/elements.py'"

# says SCENE OPTIONS PATTERN NAME: the report has a line like the pattern.
says() {
	prepare mesh "$scenes/$1.gltf" -o "$T/b.mesh" -p 25% -e 25%
	rm -f "$T/b.ff"
	ffcalc -m analytic $2 -n 64 "$T/b.mesh" -o "$T/b.ff" >"$T/said" 2>&1
	check "$4" grep -q "$3" "$T/said"
}
says two-pass "-t .1" '^by rays  *light from 1 of 262 patch-sides: they are curved$' 'says how many patch-sides are curved'
says two-pass "--to patches -t .1" '^by rays .*: there are lobes, mirrors or panes$' 'says that lobes need rays'
says mirror-image "--to patches" '^by rays .*: there are lobes, mirrors or panes$' 'says that mirrors need rays'
says cornell "" '^pairs .* sampled$' 'a few rays do as well'
refuses 2 'gather' 'no formulas without rays of the elements' \
	ffcalc -m analytic --gather 0 "$T/a.mesh" -o "$T/out"
rm -f "$T/b.ff"
ffcalc $patches "$T/a.mesh" -o "$T/b.ff" >"$T/said" 2>&1
check "says nothing where all is done by formula" sh -c "! grep -q '^by rays' '$T/said'"

# A lit box in a dark one, turned so that nothing is exact: not even rounding gets out.
$PYTHON - "$T/boxes.gltf" "$scenes" <<'END'
import sys
sys.path.insert(0, sys.argv[2])
from gltf_writer import Scene, Shape

s = Scene("boxes")
lit = s.material("lit", {"rho_d": .5, "emission_front": 1}, double_sided=True)
dark = s.material("dark", {"rho_d": .5})
for name, low, high, material in ("outer", 0, 1, dark), ("inner", .25, .75, lit):
    box = Shape().box((low,) * 3, (high,) * 3)
    box.triangles = [t[::-1] for t in box.triangles]
    turn = [.36, .48, -.8, 0, -.8, .6, 0, 0, .48, .64, .6, 0, 0, 0, 0, 1]
    s.node(name, mesh=s.mesh(name, box, material), matrix=turn)
s.write(sys.argv[1])
END
prepare mesh "$T/boxes.gltf" -o "$T/boxes.mesh" -p .5 -e .5
prepare ffcalc $patches "$T/boxes.mesh" -o "$T/boxes.ff"
prepare shoot "$T/boxes.mesh" "$T/boxes.ff" -o "$T/boxes.rad"
check "exactly dark outside" sh -c "inspect --csv '$T/boxes.rad' |
	awk -F, '\$4 == \"outer\" { n++; bad += \$13 != 0 } END { exit !(n && !bad) }'"

done_testing
