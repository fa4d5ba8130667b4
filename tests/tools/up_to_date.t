#!/bin/sh
# A program that finds its output already made says `up to date`: repainting keeps
# the form factors, moving a camera keeps the solution and the other views.
. "$(dirname "$0")/tap.sh"

M="-p 25% -e 25%" F="-m rays -n 256" V="-s 32x32 --samples 1"

# says YES|NO NAME COMMAND…: whether the command says `up to date`.
says() {
	want=$1 says_name=$2
	shift 2
	"$@" >"$T/says.out" 2>"$T/says.err"
	status=$?
	grep -q 'up to date' "$T/says.err" && got=yes || got=no
	[ $status -eq 0 ] && [ $got = "$want" ]
	result $? "$says_name"
	[ $got = "$want" ] || sed 's/^/# /' "$T/says.err"
}

solve() {
	mesh "$1" -o "$T/a.mesh" $M &&
	ffcalc "$T/a.mesh" -o "$T/a.ff" $F &&
	shoot "$T/a.mesh" "$T/a.ff" -o "$T/a.rad" &&
	trace "$T/a.rad" -c classic -o "$T/classic.exr" $V &&
	trace "$T/a.rad" -c corner -o "$T/corner.exr" $V
}

# same A B ARRAY…: these arrays are equal in two files.
same() {
	$PYTHON -c '
import sys, chain
a, b = (chain.container(p)[1] for p in sys.argv[1:3])
sys.exit(not all((a[n] == b[n]).all() for n in sys.argv[3:]))' "$@"
}
field="irradiance_direct irradiance_caustic irradiance_indirect"

cp "$scenes/cornell.gltf" "$T/a.gltf"
prepare solve "$T/a.gltf"
touch -d '2001-01-01' "$T/a.mesh" "$T/a.ff" "$T/a.rad" "$T/classic.exr"
cp "$T/a.ff" "$T/first.ff"
cp "$T/a.rad" "$T/first.rad"
cp "$T/classic.exr" "$T/first.exr"

says yes "ffcalc: the same again" ffcalc "$T/a.mesh" -o "$T/a.ff" $F
says yes "shoot: the same again" shoot "$T/a.mesh" "$T/a.ff" -o "$T/a.rad"
says yes "trace: the same again" trace "$T/a.rad" -c classic -o "$T/classic.exr" $V
for file in a.ff a.rad classic.exr; do
	[ -n "$(find "$T/$file" -newermt '2002-01-01')" ]
	result $? "$file: touched"
done
check "the bytes are the same" sh -c \
	"cmp '$T/a.ff' '$T/first.ff' && cmp '$T/a.rad' '$T/first.rad' && cmp '$T/classic.exr' '$T/first.exr'"

# stated PROGRAM OPTIONS: numbers that --help states to be defaults, as options, but for some.
stated() {
	"$1" --help | sed -nE 's/^ +(-., )?(--[a-z-]+) .*\(default:? ([0-9.][^ ;,)]*).*/\2=\3/p' |
		grep -vE "^--($2)="
}
[ "$(for p in mesh ffcalc shoot trace; do stated $p none; done | wc -l)" -ge 20 ]
result $? "--help states defaults"
says yes "mesh: they are its defaults" mesh "$T/a.gltf" -o "$T/a.mesh" $M \
	$(stated mesh 'bands|patch-size|element-size|refine.*')
says yes "ffcalc: they are its defaults" ffcalc "$T/a.mesh" -o "$T/a.ff" $F $(stated ffcalc samples)
says yes "shoot: they are its defaults" shoot "$T/a.mesh" "$T/a.ff" -o "$T/a.rad" $(stated shoot none)
says yes "trace: they are its defaults" trace "$T/a.rad" -c classic -o "$T/classic.exr" $V \
	$(stated trace 'size|up|fov|samples')

says no "ffcalc: other options" ffcalc "$T/a.mesh" -o "$T/a.ff" -m rays -n 512
says no "shoot: other form factors" shoot "$T/a.mesh" "$T/a.ff" -o "$T/a.rad"
says no "trace: another size" trace "$T/a.rad" -c classic -o "$T/classic.exr" -s 16x16 --samples 1
prepare solve "$T/a.gltf"
flip "$T/a.ff" "$T/a.ff" header
says no "ffcalc: a damaged output is made anew" ffcalc "$T/a.mesh" -o "$T/a.ff" $F
check "ffcalc: and is whole again" cmp "$T/a.ff" "$T/first.ff"

# Another paint.
edit "$scenes/cornell.gltf" "$T/painted.gltf" \
	'g["materials"][1]["extras"]["twopass"]["rho_d"] = [.1, .1, .6]'
prepare mesh "$T/painted.gltf" -o "$T/a.mesh" $M
says yes "ffcalc: a wall repainted" ffcalc "$T/a.mesh" -o "$T/a.ff" $F
says no "shoot: a wall repainted" shoot "$T/a.mesh" "$T/a.ff" -o "$T/a.rad"
says no "trace: a wall repainted" trace "$T/a.rad" -c classic -o "$T/classic.exr" $V

# Another lamp.
edit "$scenes/cornell.gltf" "$T/lamp.gltf" 'g["materials"][3]["emissiveFactor"] = [.1, .2, .3]'
prepare mesh "$T/lamp.gltf" -o "$T/a.mesh" $M
says yes "ffcalc: a lamp dimmed" ffcalc "$T/a.mesh" -o "$T/a.ff" $F
says no "shoot: a lamp dimmed" shoot "$T/a.mesh" "$T/a.ff" -o "$T/a.rad"

# Another place to look from.
prepare solve "$T/a.gltf"
edit "$scenes/cornell.gltf" "$T/moved.gltf" \
	'[n for n in g["nodes"] if n["name"] == "corner"][0]["matrix"][12] = .1'
prepare mesh "$T/moved.gltf" -o "$T/a.mesh" $M
says yes "ffcalc: a camera moved" ffcalc "$T/a.mesh" -o "$T/a.ff" $F
says no "shoot: a camera moved" shoot "$T/a.mesh" "$T/a.ff" -o "$T/a.rad"
check "shoot: a camera moved, nothing solved" grep -q -i camera "$T/says.err"
check "shoot: a camera moved, the same solution" same "$T/a.rad" "$T/first.rad" $field
says yes "trace: the camera that stayed" trace "$T/a.rad" -c classic -o "$T/classic.exr" $V
says no "trace: the camera that moved" trace "$T/a.rad" -c corner -o "$T/corner.exr" $V

# Another name for a wall.
prepare solve "$T/a.gltf"
edit "$scenes/cornell.gltf" "$T/named.gltf" '
for n in g["nodes"]:
    if n["name"] == "floor":
        n["name"] = "ground"'
prepare mesh "$T/named.gltf" -o "$T/a.mesh" $M
says no "ffcalc: a wall renamed" ffcalc "$T/a.mesh" -o "$T/a.ff" $F
check "ffcalc: a wall renamed, nothing computed" grep -q 'names replaced, form factors kept' "$T/says.err"
check "ffcalc: a wall renamed, the same form factors" same "$T/a.ff" "$T/first.ff" column value row_scale
check "ffcalc: a whole file with the new name" sh -c \
	"inspect --verify '$T/a.ff' && inspect --patch-matrix '$T/a.ff' | head -n 1 | grep -q ground"
says yes "ffcalc: the same name again" ffcalc "$T/a.mesh" -o "$T/a.ff" $F

# Shards in another order.
prepare sh -c "ffcalc --part 1/2 '$T/a.mesh' -o '$T/1.ff' $F && ffcalc --part 2/2 '$T/a.mesh' -o '$T/2.ff' $F"
prepare shoot "$T/a.mesh" "$T/1.ff" "$T/2.ff" -o "$T/a.rad"
cp "$T/a.rad" "$T/first.rad"
says yes "shoot: shards in another order" shoot "$T/a.mesh" "$T/2.ff" "$T/1.ff" -o "$T/a.rad"
rm "$T/a.rad"
prepare shoot "$T/a.mesh" "$T/2.ff" "$T/1.ff" -o "$T/a.rad"
check "shoot: and the same solution" same "$T/a.rad" "$T/first.rad" $field

# A lamp that is switched on where there was none shoots from other patches.
edit "$scenes/cornell.gltf" "$T/glow.gltf" \
	'g["materials"][1]["extras"]["twopass"]["emission_front"] = [1, 1, 1]'
prepare mesh "$T/glow.gltf" -o "$T/a.mesh" $M
says no "ffcalc: a wall that shines now" ffcalc "$T/a.mesh" -o "$T/a.ff" $F

done_testing
