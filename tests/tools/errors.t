#!/bin/sh
# tier: slow
# Bad input: one clear line, exit 1, no output file.
. "$(dirname "$0")/tap.sh"

prepare mesh "$scenes/furnace.gltf" -o "$T/a.mesh" -p .5 -e .5
prepare mesh "$scenes/furnace.gltf" -o "$T/b.mesh" -p .25 -e .25
prepare mesh "$scenes/plates.gltf" -o "$T/p.mesh" -p .5 -e .5
prepare ffcalc "$T/a.mesh" -o "$T/a.ff" -n 256 -m rays
prepare ffcalc "$T/b.mesh" -o "$T/b.ff" -n 256 -m rays
prepare ffcalc "$T/p.mesh" -o "$T/p.ff" -n 256 -m rays
prepare ffcalc "$T/a.mesh" -o "$T/a1.ff" -n 256 -m rays --part 1/3
prepare ffcalc "$T/a.mesh" -o "$T/a2.ff" -n 256 -m rays --part 2/3
prepare ffcalc "$T/a.mesh" -o "$T/a3.ff" -n 256 -m rays --part 3/3
prepare ffcalc "$T/a.mesh" -o "$T/a12.ff" -n 256 -m rays --part 1/2
prepare shoot "$T/a.mesh" "$T/a.ff" -o "$T/a.rad"
prepare shoot "$T/p.mesh" "$T/p.ff" -o "$T/p.rad"
prepare trace "$T/a.rad" -c inside -o "$T/a.exr" -s 16x12 --samples 1

# Missing files and files of another kind.
while read -r command; do
	refuses 1 "no-such-file.*[Nn]o such file" "${command%% *}: missing file" \
		sh -c "cd '$T' && exec $command"
done <<'END'
mesh no-such-file.gltf -o out
ffcalc no-such-file.mesh -o out
shoot no-such-file.mesh a.ff -o out
shoot a.mesh no-such-file.ff -o out
trace no-such-file.rad -c inside -o out
reference no-such-file.mesh -c inside -o out
inspect no-such-file.ff
exrcmp no-such-file.exr a.exr
exrcmp a.exr no-such-file.exr
tone no-such-file.exr -o out
END
while read -r file kind command; do
	refuses 1 "$file: .*$kind" "${command%% *}: $file is not $kind" \
		sh -c "cd '$T' && exec $command"
done <<'END'
a.ff twopass.mesh ffcalc a.ff -o out
a.rad twopass.mesh shoot a.rad a.ff -o out
a.mesh twopass.ff shoot a.mesh a.mesh -o out
a.mesh twopass.rad trace a.mesh -c inside -o out
a.ff twopass.mesh reference a.ff -c inside -o out
END
echo 'This is text.' >"$T/text"
: >"$T/empty"
for file in text empty a.gltf; do
	[ $file != a.gltf ] || cp "$scenes/furnace.gltf" "$T/a.gltf"
	refuses 1 "$file: " "ffcalc: $file is no cache" ffcalc "$T/$file" -o "$T/out"
	refuses 1 "$file: " "shoot: $file is no cache" shoot "$T/a.mesh" "$T/$file" -o "$T/out"
	refuses 1 "$file: " "trace: $file is no cache" trace "$T/$file" -c inside -o "$T/out"
	refuses 1 "$file: " "inspect: $file is no cache" inspect "$T/$file"
	refuses 1 "$file: " "tone: $file is no picture" tone "$T/$file" -o "$T/out"
	refuses 1 "$file: " "exrcmp: $file is no picture" exrcmp "$T/$file" "$T/a.exr"
done
for file in text empty a.mesh; do
	refuses 1 "$file: " "mesh: $file is not glTF" mesh "$T/$file" -o "$T/out"
done
refuses 1 "$T" "mesh: a directory" mesh "$T" -o "$T/out"

# Files that ended early.
for kind in mesh ff rad; do
	size=$(wc -c <"$T/a.$kind")
	for bytes in 4 8 100 $((size / 2)) $((size - 1)); do
		head -c $bytes "$T/a.$kind" >"$T/short.$kind"
		case $kind in
		mesh) set -- ffcalc "$T/short.mesh" -o "$T/out" ;;
		ff) set -- shoot "$T/a.mesh" "$T/short.ff" -o "$T/out" ;;
		rad) set -- trace "$T/short.rad" -c inside -o "$T/out" ;;
		esac
		refuses 1 "short.$kind: " ".$kind of $bytes bytes of $size" "$@"
	done
done
size=$(wc -c <"$T/a.exr")
head -c $((size / 2)) "$T/a.exr" >"$T/short.exr"
refuses 1 "short.exr: " "tone: half a picture" tone "$T/short.exr" -o "$T/out"

# One flipped bit, in the header and in every array.
flip_all() {
	kind=$1
	shift
	for array in header $(arrays "$T/a.$kind"); do
		flip "$T/a.$kind" "$T/bad.$kind" "$array"
		named=$array
		[ $array = header ] && named=
		refuses 1 "bad.$kind: .*$named" ".$kind: flipped bit, $array" "$@"
	done
}
flip_all mesh ffcalc "$T/bad.mesh" -o "$T/out"
flip_all ff shoot "$T/a.mesh" "$T/bad.ff" -o "$T/out"
flip_all rad trace "$T/bad.rad" -c inside -o "$T/out"
refuses 1 "bad.ff: " "inspect --verify: flipped bit" inspect --verify "$T/bad.ff"
check "inspect --verify: good files" sh -c \
	"inspect --verify '$T/a.mesh' && inspect --verify '$T/a.ff' && inspect --verify '$T/a.rad'"

# Form factors that do not belong.
refuses 1 "b.ff: made for another geometry; run ffcalc again" "shoot: .ff of a finer mesh" \
	shoot "$T/a.mesh" "$T/b.ff" -o "$T/out"
refuses 1 "p.ff: made for another geometry; run ffcalc again" "shoot: .ff of another scene" \
	shoot "$T/a.mesh" "$T/p.ff" -o "$T/out"
refuses 1 "missing" "shoot: missing part" shoot "$T/a.mesh" "$T/a1.ff" "$T/a3.ff" -o "$T/out"
refuses 1 "missing" "shoot: one part alone" shoot "$T/a.mesh" "$T/a2.ff" -o "$T/out"
refuses 1 "a1.ff\|a2.ff\|a12.ff" "shoot: overlapping parts" \
	shoot "$T/a.mesh" "$T/a12.ff" "$T/a2.ff" "$T/a3.ff" -o "$T/out"
refuses 1 "a1.ff" "shoot: the same part twice" \
	shoot "$T/a.mesh" "$T/a1.ff" "$T/a1.ff" "$T/a2.ff" "$T/a3.ff" -o "$T/out"
check "shoot: all parts, in any order" \
	shoot "$T/a.mesh" "$T/a3.ff" "$T/a1.ff" "$T/a2.ff" -o "$T/parts.rad"
prepare shoot "$T/a.mesh" "$T/a1.ff" "$T/a2.ff" "$T/a3.ff" -o "$T/ordered.rad"
check "shoot: parts add up to the whole" $PYTHON -c '
import sys, chain, numpy
a, b = (chain.container(p)[1] for p in sys.argv[1:])
for part in ("irradiance_direct", "irradiance_caustic", "irradiance_indirect"):
    numpy.testing.assert_allclose(a[part], b[part], rtol=1e-9, atol=1e-12)' \
	"$T/parts.rad" "$T/a.rad"

# Scenes that cannot be.
scene_refused() {
	pattern=$1 name=$2 statement=$3
	edit "$scenes/furnace.gltf" "$T/edited.gltf" "$statement"
	refuses 1 "edited.gltf: .*$pattern" "mesh: $name" mesh "$T/edited.gltf" -o "$T/out"
}
scene_refused "geometry" "no geometry" 'g["nodes"] = [{"name": "empty"}]; g["scenes"][0]["nodes"] = [0]'
scene_refused "geometry" "nothing at all" '
for key in ("nodes", "meshes", "materials", "cameras", "accessors", "bufferViews", "buffers"):
    del g[key]
g["scenes"][0].pop("nodes")'
scene_refused "xmin.*front" "albedo > 1 names material and side" \
	'g["materials"][2]["extras"]["twopass"].update(rho_d=.8, rho_s=.3)'
scene_refused "xmin.*back" "albedo > 1 on the back" '
g["materials"][2]["extras"]["twopass"]["back"] = {"rho_d": .8, "tau_d": .4}
g["materials"][2]["doubleSided"] = True'
scene_refused "ymax" "negative coefficient" 'g["materials"][5]["extras"]["twopass"]["rho_d"] = -.1'
scene_refused "ymax" "negative exponent" \
	'g["materials"][5]["extras"]["twopass"].update(rho_d=0, rho_s=.1, alpha=-1)'
scene_refused "ymax" "coefficient that is no number" \
	'g["materials"][5]["extras"]["twopass"]["rho_d"] = "red"'
scene_refused "2\|3" "coefficients of two and of three bands" '
g["materials"][5]["extras"]["twopass"]["rho_d"] = [.1, .2]
g["materials"][4]["extras"]["twopass"]["rho_d"] = [.1, .1, .2]'
scene_refused "ymax.*shiny\|shiny" "misspelt coefficient" \
	'g["materials"][5]["extras"]["twopass"]["shiny"] = .1'
scene_refused "" "NaN vertex" \
	'data[0:4] = struct.pack("<f", float("nan"))'
scene_refused "" "infinite vertex" \
	'data[12:16] = struct.pack("<f", float("inf"))'
scene_refused "" "NaN in a node matrix" 'g["nodes"][2]["matrix"][0] = float("nan")'
scene_refused "" "1e400 in a node matrix" 'g["nodes"][2]["matrix"][0] = 10**400'

# Nothing that shines, no such camera.
edit "$scenes/furnace.gltf" "$T/dark.gltf" '
for m in g["materials"]: m["extras"]["twopass"]["emission_front"] = 0'
prepare mesh "$T/dark.gltf" -o "$T/dark.mesh" -p .5 -e .5
prepare ffcalc "$T/dark.mesh" -o "$T/dark.ff" -n 256 -m rays
refuses 1 "emit" "shoot: no emitter" shoot "$T/dark.mesh" "$T/dark.ff" -o "$T/out"
refuses 1 "nowhere.*inside" "trace: unknown camera, names those there are" \
	trace "$T/a.rad" -c nowhere -o "$T/out"
refuses 1 "nowhere.*inside" "reference: unknown camera" \
	reference "$T/a.mesh" -c nowhere -o "$T/out"
refuses 1 "%s" "trace: all cameras into one file" \
	trace "$T/p.rad" -c all -o "$T/out"

done_testing
