#!/bin/sh
# inspect on the caches of one small scene: every view, against what numpy reads.
. "$(dirname "$0")/tap.sh"

prepare mesh "$scenes/plates.gltf" -o "$T/a.mesh" -p inf -e 20%
prepare ffcalc "$T/a.mesh" -o "$T/a.ff" -n 4096
prepare shoot "$T/a.mesh" "$T/a.ff" -o "$T/a.rad"

for kind in mesh ff rad; do
	check ".$kind and its page agree" $PYTHON "$top/tests/independent/check_formats.py" "$top/man" "$T/a.$kind"
	check ".$kind: overview" sh -c "inspect '$T/a.$kind' | grep -q '^format *twopass.$kind'"
	check ".$kind: --verify" inspect --verify "$T/a.$kind"
	check ".$kind: the reader of mesh(5)" sh -c \
		"$PYTHON '$top/tests/independent/read_cache.py' '$T/a.$kind' > '$T/read'"
done

# --json: the same arrays with the same smallest and largest values.
check "--json has every array" sh -c "inspect --json --verify '$T/a.ff' | $PYTHON -c '
import json, sys, chain
said = json.load(sys.stdin)
_, arrays = chain.container(sys.argv[1])
assert {a[\"name\"] for a in said[\"arrays\"]} == set(arrays)
for a in said[\"arrays\"]:
    if arrays[a[\"name\"]].size:
        assert a[\"min\"] == arrays[a[\"name\"]].min() and a[\"max\"] == arrays[a[\"name\"]].max()
assert all(v[\"good\"] for v in said[\"verify\"])
assert said[\"metadata\"][\"options\"][\"samples\"] == 4096' '$T/a.ff'"

check "--npy" sh -c "inspect --npy vertex '$T/a.mesh' -o '$T/v.npy' && $PYTHON -c '
import sys, chain, numpy as np
assert (np.load(sys.argv[1]) == chain.container(sys.argv[2])[1][\"vertex\"]).all()' '$T/v.npy' '$T/a.mesh'"

check "--csv: irradiance is the sum of its parts" sh -c "inspect --csv '$T/a.rad' | $PYTHON -c '
import sys, chain
_, a = chain.container(sys.argv[1])
h = (a[\"irradiance_direct\"] + a[\"irradiance_caustic\"] + a[\"irradiance_indirect\"])[0]
rows = chain.table(sys.stdin.read())
assert rows
for r in rows:
    assert r[\"H_0\"] == h[2 * int(r[\"element\"]) + \"fb\".index(r[\"side\"]), 0]' '$T/a.rad'"

check "--patch-matrix: lines sum to 1, .npy has the same numbers" sh -c "
inspect --patch-matrix '$T/a.ff' > '$T/m.csv' && inspect --npy patch-matrix '$T/a.ff' > '$T/m.npy' &&
$PYTHON -c '
import csv, sys, numpy as np
lines = list(csv.reader(open(sys.argv[1])))
a = np.array([[float(x) for x in line[1:]] for line in lines[1:]])
b = np.load(sys.argv[2])
assert abs(a.sum(1) - 1).max() < 1e-12 and lines[0][-1] == \"escape\"
assert (a == b[~np.isnan(b[:, -1])]).all()' '$T/m.csv' '$T/m.npy'"

check "--row: the row of a .ff sums to 1 by its first chain" sh -c "inspect --row 0 '$T/a.ff' |
	$PYTHON -c '
import sys
lines = [l.split(\",\") for l in sys.stdin if l.startswith(\"0,\")]
assert abs(sum(float(l[-1]) for l in lines) - 1) < 1e-12'"
check "--row: what the reader of ff(5) prints" sh -c "
inspect --row 0 '$T/a.ff' | grep '^[0-9]*,.*,.*,' | grep -v ',,' |
	sed 's/,.*:\([fb]\),\([0-9]*\),/ \2 \1 /' > '$T/said' &&
$PYTHON '$top/tests/independent/read_row.py' '$T/a.ff' 0 > '$T/read' && [ -s '$T/read' ] && $PYTHON -c '
import sys
a, b = ([l.split() for l in open(p)] for p in sys.argv[1:])
assert len(a) == len(b)
for x, y in zip(a, b):
    assert x[:3] == y[:3] and float(x[3]) == float(y[3])' '$T/said' '$T/read'"
check "--row: an element-side" sh -c "inspect --row 0 '$T/a.rad' > '$T/row' &&
	inspect --csv '$T/a.rad' | head -n 2 | cmp - '$T/row'"

refuses 1 "there is no array nothing" "--npy of an unknown array" inspect --npy nothing "$T/a.ff"
refuses 1 "there is no row 4000000000" "--row beyond the end" inspect --row 4000000000 "$T/a.ff"
refuses 1 "this is a twopass.ff file; --csv needs" "--csv of form factors" inspect --csv "$T/a.ff"
refuses 1 "this is a twopass.mesh file; --patch-matrix needs" "--patch-matrix of a mesh" \
	inspect --patch-matrix "$T/a.mesh"
refuses 2 "ask for one" "two outputs at once" inspect --csv --patch-matrix "$T/a.ff"
refuses 1 "/dev/full" "full device" inspect --npy vertex "$T/a.mesh" -o /dev/full

# Without bounds a plane face of two triangles is one patch with an outline, named after
# its node.
prepare mesh "$scenes/furnace-two-sided.gltf" -o "$T/b.mesh" -p inf -e inf
prepare ffcalc "$T/b.mesh" -o "$T/b.ff" -n 64
check "a patch a face: names" sh -c "inspect --patch-matrix '$T/b.ff' | head -n 1 |
	tr , '\\n' | sort | tr '\\n' ' ' |
	grep -q '^ceiling:f escape floor:f from sheet:b sheet:f xmax:f xmin:f ymax:f ymin:f $'"
check "a patch a face: outlines of four corners" $PYTHON -c '
import sys, chain, numpy as np
_, a = chain.container(sys.argv[1])
assert len(a["patch_surface"]) == 7 and len(a["triangle"]) == 14
assert (np.diff(a["patch_loop"]) == 1).all() and (np.diff(a["loop_start"]) == 4).all()' "$T/b.mesh"

done_testing
