#!/bin/sh
# A user's Makefile with pipeline.mk: pictures of two cameras, and what is done again
# after a change.
. "$(dirname "$0")/tap.sh"

cd "$T" || exit 1
export LC_ALL=C
cp "$scenes/cornell.gltf" .
cat >Makefile <<END
include $top/tools/pipeline.mk
TWOPASS = $bin/
all: cornell.classic.png cornell.corner.png
END
flags="MESHFLAGS='-p 20% -e 20%' FFCALCFLAGS='-n 64' TRACEFLAGS='-s 32x32'"

# made: what make says in the log; 1 if it fails.
made() {
	eval "MAKEFLAGS= make $flags $*" >log 2>&1 || { sed 's/^/# /' log; return 1; }
}

# did LINE: make printed a line that matches.
did() { grep -q -e "$1" log; }
did_not() { ! grep -q -e "$1" log; }

# A file system may keep times too coarsely to tell a change from what it changes.
later() {
	sleep 1
	edit "$1" cornell.gltf "$2"
}

made all
result $? "all: succeeds"
for file in cornell.mesh cornell.ff cornell.rad; do
	check "$file is kept" test -s $file
done
for camera in classic corner; do
	check "cornell.$camera.exr is 32 wide" $PYTHON -c '
import struct, sys
data = open(sys.argv[1], "rb").read()
at = data.index(b"dataWindow\0box2i\0") + 21
x0, y0, x1, y1 = struct.unpack_from("<4i", data, at)
sys.exit((x1 - x0 + 1, y1 - y0 + 1) != (32, 32))' cornell.$camera.exr
	check "cornell.$camera.png is a PNG" sh -c \
		"[ \"\$(head -c 4 cornell.$camera.png | tail -c 3)\" = PNG ]"
done
check "the two views differ" sh -c \
	'test -s cornell.corner.png && ! cmp -s cornell.classic.png cornell.corner.png'

made all
result $? "again: succeeds"
check "again: nothing is done" did 'Nothing to be done'

cp cornell.classic.exr classic.before
cp cornell.corner.exr corner.before
cp cornell.rad rad.before
later "$scenes/cornell.gltf" 'g["materials"][1]["extras"]["twopass"]["rho_d"] = [.1, .1, .6]'
made all
result $? "a wall repainted: succeeds"
check "a wall repainted: mesh runs" did '^elements  '
check "a wall repainted: the form factors stay" did '^ffcalc: .*up to date'
check "a wall repainted: shoot solves" did '^shots  '
check "a wall repainted: both views are new" sh -c \
	'! cmp -s cornell.classic.exr classic.before && ! cmp -s cornell.corner.exr corner.before'

later "$scenes/cornell.gltf" pass
made all
result $? "the old paint: succeeds"
check "the old paint: the old solution" cmp cornell.rad rad.before
check "the old paint: the old pictures" sh -c \
	'cmp cornell.classic.exr classic.before && cmp cornell.corner.exr corner.before'

later "$scenes/cornell.gltf" \
	'[n for n in g["nodes"] if n["name"] == "corner"][0]["matrix"][12] = .1'
made all
result $? "a camera moved: succeeds"
check "a camera moved: the form factors stay" did '^ffcalc: .*up to date'
check "a camera moved: nothing is solved" did_not '^shots  '
check "a camera moved: its place is" did '^shoot: .*cameras replaced'
check "a camera moved: the other view stays" did '^trace: .*classic.*up to date'
check "a camera moved: byte for byte" cmp cornell.classic.exr classic.before
check "a camera moved: its view is drawn" did 'corner.exr: corner,'
check "a camera moved: and differs" sh -c '! cmp -s cornell.corner.exr corner.before'

made -B all
result $? "make -B: succeeds"
check "make -B: all programs run" sh -c '[ "$(grep -c "up to date" log)" -ge 4 ]'
check "make -B: and find nothing to do" did_not '^shots  '
flags="$flags TONEFLAGS='-e 1'"
cp cornell.classic.png png.before
made -B cornell.classic.png
result $? "other flags and make -B: succeeds"
check "other flags and make -B: the picture is brighter" sh -c \
	'! cmp -s cornell.classic.png png.before'

mkdir sub
cp "$scenes/cornell.gltf" sub/room.gltf
made sub/room.corner.png
result $? "a scene in a directory"
check "a scene in a directory: the same picture" exrcmp -m 0 sub/room.corner.exr corner.before
check "a camera that there is not: fails" sh -c \
	"! MAKEFLAGS= make $(echo "$flags" | tr "'" '"') cornell.nobody.exr >log 2>&1"
check "a camera that there is not: says so" did 'nobody'
check "a camera that there is not: leaves nothing" test ! -e cornell.nobody.exr

done_testing
