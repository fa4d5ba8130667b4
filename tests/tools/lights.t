#!/bin/sh
# Punctual lights from glTF to pictures.
. "$(dirname "$0")/tap.sh"

M="-p 25% -e 25%" F="-n 256" V="-s 32x24 --samples 1"

$PYTHON - "$T" "$scenes" <<'END'
import sys
sys.path.insert(0, sys.argv[2])
from gltf_writer import Scene

s = Scene("lights")
floor = s.material("floor", {"rho_d": .2, "rho_s": .5, "alpha": 30})
s.rectangle("floor", [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], floor)
s.light("bulb", "point", (-.3, .2, .5), intensity=2, colour=(1, .5, .25))
s.light("beam", "spot", (.6, 0, .8), (-.5, 0, -1), 3, cones=(10, 25), scale=7)
s.light("sun", "directional", direction=(1, 1, -2), intensity=.5)
s.camera("eye", (.2, -1.2, 1), (0, 0, 0), 60, 4 / 3, (0, 0, 1))
s.write(sys.argv[1] + "/a.gltf")
END

solve() {
	mesh "$T/$1.gltf" -o "$T/$1.mesh" $M && ffcalc "$T/$1.mesh" -o "$T/$1.ff" $F &&
	shoot "$T/$1.mesh" "$T/$1.ff" -o "$T/$1.rad"
}

prepare solve a
check "mesh counts them" grep -q '1 surface, 3 lights' - <<END
$(mesh "$T/a.gltf" -o "$T/b.mesh" $M)
END
check "inspect lists them" sh -c "inspect '$T/a.mesh' | grep -q 'lights *3: .\"bulb\",\"beam\",\"sun\"'"
check "inspect names the row of one" sh -c \
	"inspect --row \$(inspect --json '$T/a.ff' | $PYTHON -c '
import json, sys
print(json.load(sys.stdin)[\"metadata\"][\"report\"][\"rows\"][\"diffuse\"] + 1)') '$T/a.ff' >/dev/null &&
	 for i in \$(seq 0 500); do inspect --row \$i '$T/a.ff' 2>/dev/null | grep -q '^from *sun' && exit 0; done; exit 1"
check "form factors: good" inspect --verify "$T/a.ff"
check "solution: good" inspect --verify "$T/a.rad"
check "the matrix has no line of a light" sh -c "! inspect --patch-matrix '$T/a.ff' | grep -q sun"
check "light groups" shoot "$T/a.mesh" "$T/a.ff" -o "$T/g.rad" --light-groups
check "they are called after lights" sh -c "inspect '$T/g.rad' | grep -q 'light_groups *3: .\"bulb\",\"beam\",\"sun\"'"

# Nothing is reflected twice here: the picture is direct light and highlights, exactly.
prepare trace "$T/a.rad" -c eye -d direct -o "$T/direct.exr" $V
prepare reference "$T/a.mesh" -c eye -o "$T/true.exr" -s 32x24 --samples 1 --centre
trace "$T/a.rad" -c eye -d direct -o "$T/one.exr" $V -j 1 -q
check "highlights and direct light as in the reference" \
	exrcmp --max-rel 1e-5 "$T/direct.exr" "$T/true.exr"
check "the same bytes with one thread" cmp "$T/direct.exr" "$T/one.exr"
prepare trace "$T/g.rad" -c eye -d direct -o "$T/mixed.exr" $V --mix bulb=0,beam=2,sun=0
edit "$T/a.gltf" "$T/beam.gltf" '
l = g["extensions"]["KHR_lights_punctual"]["lights"]
l[0]["intensity"] = l[2]["intensity"] = 0; l[1]["intensity"] *= 2'
prepare solve beam
prepare trace "$T/beam.rad" -c eye -d direct -o "$T/beam.exr" $V
check "mixed is as lit so" exrcmp --max-rel 1e-5 "$T/mixed.exr" "$T/beam.exr"

# Particles of a light that grazes the floor arrive: (1, .2, -.01), of 1 lx across it.
$PYTHON - "$T/low.gltf" "$scenes" <<'END'
import sys
sys.path.insert(0, sys.argv[2])
from gltf_writer import Scene

s = Scene("low")
floor = s.material("floor", {"rho_d": .5})
s.rectangle("floor", [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], floor)
s.light("sun", "directional", direction=(1, .2, -.01), intensity=1)
s.write(sys.argv[1])
END
prepare mesh "$T/low.gltf" -o "$T/low.mesh" -p inf -e inf
check "particles arrive on what they graze" sh -c "reference --irradiance -q --samples 1000 '$T/low.mesh' |
	awk -F, 'NR > 1 { h += \$5 * \$6; a += \$5 } END { x = h / a / .0098053; exit !(x > .999 && x < 1.001) }'"

# Images in two mirrors that meet in a corner: highlights alone, no noise.
$PYTHON - "$T/corner.gltf" "$scenes" <<'END'
import sys
sys.path.insert(0, sys.argv[2])
from gltf_writer import Scene

s = Scene("corner")
floor = s.material("floor", {"rho_s": .5, "alpha": 30})
mirror = s.material("mirror", {"rho_s": .9})
s.rectangle("floor", [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], floor)
s.rectangle("back", [(-1, 1, 0), (1, 1, 0), (1, 1, 1), (-1, 1, 1)], mirror)
s.rectangle("left", [(-1, -1, 0), (-1, 1, 0), (-1, 1, 1), (-1, -1, 1)], mirror)
s.light("bulb", "point", (-.3, .2, .5), intensity=2, colour=(1, .5, .25))
s.light("sun", "directional", direction=(-1, 1, -2), intensity=.5)
s.camera("eye", (.2, -1.2, 1), (0, 0, 0), 60, 4 / 3, (0, 0, 1))
s.write(sys.argv[1])
END
prepare solve corner
prepare trace "$T/corner.rad" -c eye -o "$T/corner.exr" $V --lobe-samples 0
prepare reference "$T/corner.mesh" -c eye -o "$T/mirrored.exr" -s 32x24 --samples 1 --centre
check "highlights by mirrors as in the reference" \
	exrcmp --max-rel 1e-5 "$T/corner.exr" "$T/mirrored.exr"

# What form factors depend on.
cp "$T/beam.mesh" "$T/dim.mesh"
cp "$T/a.ff" "$T/dim.ff"
check "a dimmed light keeps form factors" sh -c \
	"ffcalc '$T/dim.mesh' -o '$T/dim.ff' $F 2>&1 | grep -q 'up to date'"
edit "$T/a.gltf" "$T/moved.gltf" 'g["nodes"][1]["matrix"][12] += .1'
prepare mesh "$T/moved.gltf" -o "$T/moved.mesh" $M
check "a moved one does not" sh -c \
	"! ffcalc '$T/moved.mesh' -o '$T/dim.ff' $F 2>&1 | grep -q 'up to date'"
refuses 1 "made for another geometry" "nor do they fit" shoot "$T/moved.mesh" "$T/a.ff" -o "$T/out"

# The closed form of a scene.
prepare mesh "$scenes/lamps.gltf" -o "$T/lamps.mesh" -e 5%
prepare ffcalc "$T/lamps.mesh" -o "$T/lamps.ff"
prepare shoot "$T/lamps.mesh" "$T/lamps.ff" -o "$T/lamps.rad"
inspect "$T/lamps.rad" --csv | $PYTHON -c '
import sys, chain
flux = sum(r["area"] * r["H_0"] for r in chain.table(sys.stdin.read()))
print("#", flux)
sys.exit(abs(flux - 505.5722636) > 1e-3)'
result $? "flux of the lamps"

# Files that are wrong.
wrong() {
	edit "$T/a.gltf" "$T/wrong.gltf" "l = g['extensions']['KHR_lights_punctual']['lights']; $3"
	refuses 1 "$2" "$1" mesh "$T/wrong.gltf" -o "$T/out"
}
wrong "a kind that there is not" 'lights\[0\].type: must be one of' 'l[0]["type"] = "area"'
wrong "no kind" 'lights\[0\].type: is missing' 'del l[0]["type"]'
wrong "negative intensity" 'lights\[0\].intensity: -1 is below 0' 'l[0]["intensity"] = -1'
wrong "a colour of two" 'lights\[0\].color: has 2 numbers' 'l[0]["color"] = [1, 1]'
wrong "negative colour" 'lights\[0\].color\[1\]: -1 is below 0' 'l[0]["color"] = [1, -1, 1]'
wrong "cones the wrong way round" 'outerConeAngle 0.1 is below innerConeAngle' \
	'l[1]["spot"]["outerConeAngle"] = .1'
wrong "no cone" 'outerConeAngle 0 is not above 0' \
	'l[1]["spot"] = {"innerConeAngle": 0, "outerConeAngle": 0}'
wrong "too wide a cone" 'outerConeAngle: 2 is above' 'l[1]["spot"]["outerConeAngle"] = 2'
wrong "a light that there is not" 'light: index 3 is out of range, the file has 3 lights' \
	'g["nodes"][1]["extensions"]["KHR_lights_punctual"]["light"] = 3'
wrong "no light of a node" 'light: is missing' \
	'g["nodes"][1]["extensions"]["KHR_lights_punctual"] = {}'
edit "$T/a.gltf" "$T/range.gltf" \
	'g["extensions"]["KHR_lights_punctual"]["lights"][0]["range"] = 2'
check "range is said to be left out" sh -c \
	"mesh '$T/range.gltf' -o '$T/range.mesh' $M | grep -q 'light bulb: its range is not modelled'"
done_testing
