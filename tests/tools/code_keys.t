#!/bin/sh
# tier: slow
# Keys follow the code: whoever changes a stage sees that stage run again, and the later ones
# as far as what they read is another; whoever changes comments and spacing sees none. The
# programs are built from a copy of the sources, with the objects that are there.
. "$(dirname "$0")/tap.sh"

programs="mesh ffcalc shoot trace reference"
copy=$T/copy
build=$(basename "$bin")
nm "$bin/mesh" | grep -q __asan_init && san=1 || san=

# rebuild: makes the copy's programs, one line a failure.
rebuild() {
	(cd "$copy" && ${MAKE:-make} BUILD="$build" SAN=$san $(printf "$build/%s " $programs)) >"$T/make.log" 2>&1 &&
		return
	grep -i error "$T/make.log" | head -n 3 | sed 's/^/# /'
	echo "Bail out! the copy does not build"
	exit 1
}

# change FOLDER FROM TO: replaces text, by basic regular expression, in the one file of the
# copy's folder that has it; and builds.
change() {
	files=$(grep -l -e "$2" "$copy/$1"/*.[ch])
	if [ "$(echo "$files" | wc -w)" -ne 1 ]; then
		echo "Bail out! '$2' is in '$files' of $1, not in one file"
		exit 1
	fi
	sed "s,$2,$3," "$files" >"$T/changed" && cat "$T/changed" >"$files"
	rebuild
}

# pipeline [OPTION]: what each program of the copy does: `kept`, `other` (kept, of another
# version), or `made`.
pipeline() {
	did=
	step mesh "$@" "$T/a.gltf" -o "$T/a.mesh" -p 25% -e 10%
	step ffcalc "$@" "$T/a.mesh" -o "$T/a.ff" -n 64
	step shoot "$@" "$T/a.mesh" "$T/a.ff" -o "$T/a.rad"
	step trace "$@" "$T/a.rad" -c classic -s 16x16 -o "$T/a.exr"
	step reference "$@" "$T/a.mesh" -c classic -s 8x8 --samples 2 -o "$T/r.exr"
}
step() {
	program=$1
	shift
	if ! "$where/$program" "$@" >"$T/out" 2>"$T/err"; then
		did="$did $program failed"
	elif grep -q 'up to date' "$T/err"; then
		did="$did $program kept"
	elif grep -q 'made by another version, kept' "$T/err"; then
		did="$did $program other"
	else
		did="$did $program made"
	fi
}

# does WHAT NAME [OPTION]: the pipeline does this.
does() {
	want=$1 does_name=$2
	shift 2
	pipeline "$@"
	[ "$did" = " $want" ]
	result $? "$does_name"
	[ "$did" = " $want" ] || echo "# wanted $want, got$did"
}

mkdir -p "$copy/$build"
(cd "$top" && tar cf - Makefile lib formats tools) | (cd "$copy" && tar xf -)
(cd "$bin" && find formats lib tools libcli.a libcommon.a -name '*.[oda]' | tar cf - -T -) |
	(cd "$copy/$build" && tar xf -)
cp "$scenes/cornell.gltf" "$T/a.gltf"

where=$bin
does "mesh made ffcalc made shoot made trace made reference made" "at first all run"
where=$copy/$build
all_kept="mesh kept ffcalc kept shoot kept trace kept reference kept"

file=$copy/lib/radiosity/shoot.c
{ echo '/* A comment more. */'; sed 's/	/    /g; s/ = /  =  /g; s,;$,; // here,' "$file"; } >"$T/changed"
cp "$T/changed" "$file"
rebuild
does "$all_kept" "comments and spacing: all is up to date"

change lib/radiosity 'DEPTH = 32' 'DEPTH = 8'
does "mesh kept ffcalc kept shoot other trace kept reference kept" \
	"a constant in lib/radiosity, --any-version: the solution is kept, and shoot says so" --any-version
does "mesh kept ffcalc kept shoot made trace made reference kept" \
	"a constant in lib/radiosity: shoot runs again, and trace"
does "$all_kept" "then all is up to date"

change lib/ff 'larger = 2.2' 'larger = 9.2'
does "mesh kept ffcalc made shoot made trace made reference kept" \
	"a constant in lib/ff: ffcalc and the later ones run again"

# The later ones see whether what they read is another.
echo 'enum { CHANGES_NOTHING = 1 };' >>"$copy/lib/ff/ff_build.c"
rebuild
does "mesh kept ffcalc made shoot kept trace kept reference kept" \
	"lib/ff makes the same: ffcalc alone runs again"

change lib/mesh 'LEAST_SINE .342' 'LEAST_SINE .42'
does "mesh made ffcalc made shoot made trace made reference made" \
	"a constant in lib/mesh: all run again"

change lib/view 'usual_error = .1' 'usual_error = .2'
does "mesh kept ffcalc kept shoot kept trace other reference kept" \
	"a constant in lib/view, --any-version: the picture is kept, and trace says so" --any-version
does "mesh kept ffcalc kept shoot kept trace made reference kept" \
	"a constant in lib/view: trace runs again"

echo 'enum { CHANGES_NOTHING = 1 };' >>"$copy/lib/base/err.c"
rebuild
does "mesh made ffcalc made shoot made trace made reference made" \
	"lib/base: all run again"

# Another option is none of another version's.
"$where/trace" --any-version "$T/a.rad" -c classic -s 16x16 --cutoff .5 -o "$T/a.exr" >"$T/out" 2>"$T/err"
[ $? -eq 0 ] && ! grep -q 'kept\|up to date' "$T/err"
result $? "--any-version: other options are not kept"

done_testing
