#!/bin/sh
# Light groups: their sum is the solution without them, and a mix is what solving for
# lamps of that brightness gives.
. "$(dirname "$0")/tap.sh"

prepare mesh "$scenes/two-pass.gltf" -o "$T/a.mesh" -p 25% -e 25%
prepare ffcalc "$T/a.mesh" -o "$T/a.ff" -n 64 --lobe-rays 256
prepare shoot "$T/a.mesh" "$T/a.ff" -o "$T/one.rad" -e 1e-9
prepare shoot "$T/a.mesh" "$T/a.ff" -o "$T/groups.rad" -e 1e-9 --light-groups

check "inspect lists the groups" sh -c \
	"inspect '$T/groups.rad' | grep -A3 light_groups | grep -q 'ceiling lamp'"
check "the sum of groups" $PYTHON -c '
import sys, chain, numpy as np
one, groups = (chain.container(p)[1] for p in sys.argv[1:])
for part in ("direct", "caustic", "indirect"):
    a, b = one["irradiance_" + part], groups["irradiance_" + part]
    assert a.shape[0] == 1 and b.shape[0] == 2, (a.shape, b.shape)
    print(part, np.abs(a.sum(0) - b.sum(0)).max() / a.max())
    assert np.abs(a.sum(0) - b.sum(0)).max() <= 1e-7 * a.max()
a, b = one["irradiance_error"], groups["irradiance_error"]
assert np.abs(a - b).max() <= 1e-6 * a.max()' "$T/one.rad" "$T/groups.rad"
check "inspect --csv sums them" sh -c "
	inspect --csv '$T/one.rad' | cut -d, -f13-15 >'$T/one.csv'
	inspect --csv '$T/groups.rad' | cut -d, -f13-15 >'$T/groups.csv'
	$PYTHON -c 'import sys, numpy as np
a, b = (np.loadtxt(p, delimiter=\",\", skiprows=1) for p in sys.argv[1:])
sys.exit(not np.abs(a - b).max() <= 1e-6 * a.max())' '$T/one.csv' '$T/groups.csv'"
check "inspect --verify" inspect --verify "$T/groups.rad"

# The lamps of the scene by other brightness: the lantern twice, the ceiling lamp half and
# without blue's other half.
prepare $PYTHON -c '
import json, sys
scene = json.load(open(sys.argv[1]))
for m in scene["materials"]:
    factor = {"ceiling lamp": [.5, .5, .25], "lantern": [2, 2, 2]}.get(m["name"])
    if factor:
        m["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] *= 2
        m["emissiveFactor"] = [f / 2 * x for f, x in zip(factor, m["emissiveFactor"])]
json.dump(scene, open(sys.argv[2], "w"))' "$scenes/two-pass.gltf" "$T/mixed.gltf"
prepare mesh "$T/mixed.gltf" -o "$T/mixed.mesh" -p 25% -e 25%
prepare shoot "$T/mixed.mesh" "$T/a.ff" -o "$T/mixed.rad" -e 1e-9
check "irradiance of a mix is that of other lamps" $PYTHON -c '
import sys, chain, numpy as np
mixed, groups = (chain.container(p)[1] for p in sys.argv[1:])
factor = np.array([[.5, .5, .25], [2, 2, 2]])[:, None, :]
for part in ("direct", "caustic", "indirect"):
    a, b = mixed["irradiance_" + part][0], groups["irradiance_" + part]
    assert np.abs(a - (factor * b).sum(0)).max() <= 1e-7 * a.max()' "$T/mixed.rad" "$T/groups.rad"
mix="ceiling lamp=.5:.5:.25,lantern=2"
# As many samples of lobes in both: how many it takes depends on the errors that are stated.
look() { trace "$1" -c overview -s 80x60 -o "$2" --samples 4 --lobe-samples 4 $3 "$4"; }
check "a picture of a mix" look "$T/groups.rad" "$T/groups.exr" --mix "$mix"
prepare look "$T/mixed.rad" "$T/mixed.exr" --depth 32
# But for how interpolation weighs the errors that are stated.
check "is one of other lamps" exrcmp --max-rel 1e-2 "$T/groups.exr" "$T/mixed.exr"
check "the same mix again: up to date" sh -c \
	"trace '$T/groups.rad' -c overview -s 80x60 -o '$T/groups.exr' --samples 4 --lobe-samples 4 --mix '$mix' 2>&1 | grep -q 'up to date'"
check "one group of all: twice as bright" sh -c "
	trace -q '$T/one.rad' -c overview -s 40x30 -o '$T/1.exr' --compression none &&
	trace -q '$T/one.rad' -c overview -s 40x30 -o '$T/2.exr' --compression none --mix all=2 &&
	$PYTHON -c 'import sys, chain, numpy as np
a, b = (np.array(chain.picture(p)[\"G\"]) for p in sys.argv[1:])
sys.exit(not np.abs(2 * a - b).max() <= 1e-5 * b.max())' '$T/1.exr' '$T/2.exr'"

refuses 1 "no light group 'lamp'; there are: ceiling lamp, lantern" "an unknown group" \
	trace "$T/groups.rad" -c overview -o "$T/out" --mix lamp=2
refuses 1 "'lantern' is not NAME=X" "no factor" \
	trace "$T/groups.rad" -c overview -o "$T/out" --mix lantern
refuses 1 "beyond the range of 32-bit floats" "a factor that no picture holds" \
	trace "$T/groups.rad" -c overview -s 8x6 -o "$T/out" --mix lantern=1e300
prepare trace -q "$T/groups.rad" -c overview -s 8x6 -o "$T/1.exr" --mix lantern=0,"ceiling lamp=2"
prepare trace -q "$T/groups.rad" -c overview -s 8x6 -o "$T/2.exr" --mix lantern=0 --mix "ceiling lamp=2"
check "--mix twice" exrcmp --max-rel 0 "$T/1.exr" "$T/2.exr"
refuses 1 "solve with shoot --light-groups" "a group of a solution without" \
	trace "$T/one.rad" -c overview -o "$T/out" --mix lantern=2
for wrong in "lantern=-1" "lantern=x" "lantern=1:2" "lantern=1:2:3:4" "lantern=1;all=2"; do
	refuses 1 "factor" "wrong factors: $wrong" \
		trace "$T/groups.rad" -c overview -o "$T/out" --mix "$wrong"
done
refuses 1 "other light groups" "resuming with other groups" \
	shoot --resume "$T/a.mesh" "$T/a.ff" -o "$T/groups.rad" -e 1e-10

done_testing
