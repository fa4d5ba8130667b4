#!/bin/sh
# tier: slow
# mesh --refine: a second mesh from a first solution, its errors, and a Makefile's loop.
. "$(dirname "$0")/tap.sh"

cd "$T" || exit 1
export LC_ALL=C
cp "$scenes/cornell.gltf" .
coarse="-p 20% -e 10%"

# solve NAME
solve() { ffcalc -q -n 1024 -o "$1.ff" "$1.mesh" && shoot -q -o "$1.rad" "$1.mesh" "$1.ff"; }

# report FILE.mesh KEY: of the refinement.
report() {
	$PYTHON -c '
import json, sys, chain
print(json.loads(chain.container(sys.argv[1])[0]["report"])["refined"][sys.argv[2]])' "$@"
}

# shrinks FILE FILE…: the stated error of what each was made from is less than before, until
# it is what is asked for.
shrinks() {
	last=1
	for file; do
		now=$(report "$file" error) || return 1
		echo "$file: $now"
		$PYTHON -c "import sys; sys.exit(not ($now < $last or $now <= .02))" || return 1
		last=$now
	done
}

prepare mesh -q $coarse -o 0.mesh cornell.gltf
prepare solve 0
check "a solution is refined" mesh -q $coarse --refine 0.rad -o 1.mesh cornell.gltf
prepare solve 1
check "and once more" mesh -q $coarse --refine 1.rad -o 2.mesh cornell.gltf
prepare solve 2
check "and again" mesh -q $coarse --refine 2.rad -o 3.mesh cornell.gltf
check "the error shrinks to what was asked for" shrinks 1.mesh 2.mesh 3.mesh
check "the same again is up to date" sh -c \
	"mesh $coarse --refine 0.rad -o 1.mesh cornell.gltf 2>&1 | grep 'up to date'"
check "nothing to refine: the same elements" sh -c "
	mesh -q $coarse --refine-error 9 --refine 0.rad -o same.mesh cornell.gltf &&
	inspect --npy element 0.mesh >a.npy && inspect --npy element same.mesh >b.npy &&
	cmp a.npy b.npy"
check "its form factors are those of the first mesh" sh -c \
	'shoot -q -o same.rad same.mesh 0.ff'
check "no more elements than asked for" sh -c "
	mesh $coarse --refine-elements 2500 --refine-error 0 --refine 0.rad -o few.mesh cornell.gltf |
	awk '/^elements/ { sub(\",\", \"\"); exit !(\$2 > 1500 && \$2 < 3000) }'"

edit cornell.gltf red.gltf 'g["materials"][1]["extras"]["twopass"]["rho_d"] = [.6, .1, .1]'
check "a repainted scene can be refined" mesh -q $coarse --refine 0.rad -o red.mesh red.gltf
edit cornell.gltf moved.gltf 'data[0:4] = struct.pack("<f", .3)'
refuses 1 'moved.gltf: .*without --refine' "a changed scene is refused" \
	mesh $coarse --refine 0.rad -o out moved.gltf
refuses 1 'without --refine' "so are other elements" \
	mesh -p 20% -e 5% --refine 0.rad -o out cornell.gltf
refuses 1 '0.mesh' "a mesh is no solution" mesh $coarse --refine 0.mesh -o out cornell.gltf
refuses 2 'refine' "a bound without a solution is wrong usage" \
	mesh --refine-error .1 -o out cornell.gltf

# A lobe mirrors a wall of which a lamp lights a part; an ideal mirror does.
for exponent in 20 inf; do
	prepare $PYTHON -c '
import sys
sys.path.insert(0, sys.argv[1])
import lobes
n = sys.argv[2]
spot = lobes.lit_spot(n if n == "inf" else float(n))
lobes.scene_of("spot", *spot).write(n + ".gltf")
' "$top/tests/bench" $exponent
	prepare mesh -q -p .25 -e .25 -o $exponent.0.mesh $exponent.gltf
	for step in 0 1 2; do
		prepare solve $exponent.$step
		prepare mesh -q -p .25 -e .25 --refine $exponent.$step.rad \
			-o $exponent.$((step + 1)).mesh $exponent.gltf
	done
done
check "a patch that a lobe mirrors is halved" \
	test "$(report 20.3.mesh patches_for_lobes)" -gt 0
check "none is for a mirror" test "$(report inf.3.mesh patches_for_lobes)" -eq 0

cat >Makefile <<END
REFINE = 2
include $top/tools/pipeline.mk
TWOPASS = $bin/
MESHFLAGS = $coarse
FFCALCFLAGS = -n 256
PASSFLAGS = -n 64
TRACEFLAGS = -s 32x32
END
check "a Makefile refines twice" make cornell.classic.exr
check "and keeps what it made" test -s cornell.pass0.rad -a -s cornell.pass1.rad
check "and does nothing more" sh -c 'make cornell.classic.exr | grep "up to date"'
done_testing
