#!/bin/sh
# make bench: what the chain reaches of what the machine can do, as ratios measured
# side by side: ffcalc's and trace's rays against a bare Embree loop over rays made
# the same way, shoot's reading of form factors (its shots and its pass over elements) against
# plain reading of memory.
# Medians of three pairs. usage: BUILD=DIR tests/bench/run.sh
set -eu
top=$(cd "$(dirname "$0")/../.." && pwd)
bin=$(cd "${BUILD:-$top/build}" && pwd)
data=$bin/bench-data
threads=$(nproc)
mkdir -p "$data"
cd "$data"
[ -f clutter.glb ] || "${PYTHON:-/usr/bin/python3}" "$top/scenes/make_clutter.py" clutter.glb
cp -p "$top/scenes/cornell.gltf" .
for scene in cornell.gltf clutter.glb; do
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
"$bin/ffcalc" -q -n 1024 -o clutter.ff clutter.mesh
pair "shoot, clutter, GB/s" \
	"rm -f clutter.rad; '$bin/shoot' -o clutter.rad clutter.mesh clutter.ff | field GB" \
	"'$bin/bench/rays' cornell.mesh 1000 $threads | sed -n 's/^read_gb_per_s //p'"
pair "trace, clutter, Mray/s" \
	"rm -f a.exr; '$bin/trace' -d mesh -c overview -s 1280x720 --samples 4 --depth 0 -o a.exr clutter.rad | field Mray" \
	"bare clutter.mesh 4000000 $threads --camera overview 1280x720"
