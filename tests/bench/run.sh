#!/bin/sh
# make bench: what the chain reaches of what the machine can do, as ratios measured
# side by side: ffcalc's and trace's rays against a bare Embree loop over rays made
# the same way, shoot's reading of form factors (its shots, its bound and its pass over
# elements) against plain reading of memory.
# Medians of three pairs. usage: BUILD=DIR tests/bench/run.sh
set -eu
top=$(cd "$(dirname "$0")/../.." && pwd)
bin=$(cd "${BUILD:-$top/build}" && pwd)
data=$bin/bench-data
threads=$(nproc)
mkdir -p "$data"
cd "$data"
[ -f clutter.glb ] || "${PYTHON:-/usr/bin/python3}" "$top/scenes/make_clutter.py" clutter.glb
cp -p "$top/scenes/cornell.gltf" "$top/scenes/two-pass.gltf" .
for scene in cornell.gltf two-pass.gltf clutter.glb; do
	"$bin/mesh" -q -o "${scene%.*}.mesh" "$scene"
done

median() { sort -g | awk '{ v[NR] = $1 } END { print v[int((NR + 1) / 2)] }'; }
field() { sed -n "s/.*(\\([0-9.]*\\) $1.*/\\1/p"; }
bare() { "$bin/bench/rays" "$@" | sed -n 's/^mray_per_s //p'; }
row() { printf '%-34s %10s %10s   %.2f\n' "$1" "$2" "$3" "$(echo "$2 $3" | awk '{ print $1 / $2 }')"; }
pair() { # NAME OURS-COMMAND BARE-COMMAND
	: >ours; : >theirs
	for i in 1 2 3; do
		eval "$2" >>ours
		eval "$3" >>theirs
	done
	row "$1" "$(median <ours)" "$(median <theirs)"
}

printf '%-34s %10s %10s   %s\n' "" ours bare ratio
for scene in cornell clutter; do
	pair "ffcalc -m rays, $scene, Mray/s" \
		"rm -f a.ff; '$bin/ffcalc' -m rays -n 4096 --gather 0 --emitter-gain 1 --lobe-rays 64 -o a.ff $scene.mesh | field Mray" \
		"bare $scene.mesh 4000000 $threads"
	pair "ffcalc, gathering, $scene, Mray/s" \
		"rm -f a.ff; '$bin/ffcalc' -m rays --lobe-rays 64 -o a.ff $scene.mesh | field Mray" \
		"bare $scene.mesh 4000000 $threads"
done
for scene in cornell two-pass clutter; do
	"$bin/ffcalc" -q -n 1024 -o "$scene.ff" "$scene.mesh"
	pair "shoot, $scene, GB/s" \
		"rm -f $scene.rad; '$bin/shoot' -o $scene.rad $scene.mesh $scene.ff | field GB" \
		"'$bin/bench/rays' cornell.mesh 1000 $threads | sed -n 's/^read_gb_per_s //p'"
done
# Processor seconds: what lamps apart cost more than all as one.
seconds() { # OPTIONS
	rm -f two-pass.rad
	("$bin/shoot" -q "$@" -o two-pass.rad two-pass.mesh two-pass.ff; times) |
		awk 'NR == 2 { split($1, t, /[ms]/); print 60 * t[1] + t[2] }'
}
pair "shoot, two-pass, 2 groups or 1, s" "seconds --light-groups" seconds
pair "trace, clutter, Mray/s" \
	"rm -f a.exr; '$bin/trace' -d mesh -c overview -s 1280x720 --samples 4 --depth 0 -o a.exr clutter.rad | field Mray" \
	"bare clutter.mesh 4000000 $threads --camera overview 1280x720"
