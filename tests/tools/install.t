#!/bin/sh
# make install and uninstall: what is put where, and whether what was put there works:
# programs, pipeline.mk, and the library in C and C++.
. "$(dirname "$0")/tap.sh"

root=$T/root
sanitized=$(nm "$bin/libcommon.a" 2>/dev/null | grep -q __asan && echo 1)
# in_tree TARGET ARGUMENT…: make with nothing but what is said here.
in_tree() { MAKEFLAGS= make --no-print-directory -C "$top" BUILD="$bin" SAN=$sanitized "$@"; }
files() { (cd "$root" && find . -type f | sed 's/^\.//' | LC_ALL=C sort); }

# ---- what is put where ----

check "the build is up to date" in_tree -q all
check "install" in_tree install DESTDIR="$root" PREFIX=/opt/two
{
	for program in exrcmp ffcalc inspect mesh reference shoot tone trace; do
		echo /opt/two/bin/$program
	done
	printf '/opt/two/%s\n' include/twopass.h lib/libcommon.a lib/pkgconfig/libcommon.pc \
		share/twopass/pipeline.mk
	(cd "$top/man" && for page in *.[1-9]; do echo /opt/two/share/man/man${page##*.}/$page; done)
} | LC_ALL=C sort >"$T/wanted"
files >"$T/installed"
check "the files are those, no others" diff "$T/wanted" "$T/installed"
for program in $(sed -n 's|^/opt/two/bin/||p' "$T/installed"); do
	check "$program runs" "$root/opt/two/bin/$program" --version
done
printf 'include %s\nall: corner.rad\n' "$root/opt/two/share/twopass/pipeline.mk" >"$T/Makefile"
cp "$scenes/corner.gltf" "$T"
check "pipeline.mk works" env MAKEFLAGS= PATH="$root/opt/two/bin:$PATH" make -C "$T"
check "and makes a solution" test -s "$T/corner.rad"

# ---- the library ----

PKG_CONFIG_PATH=$root/opt/two/lib/pkgconfig
PKG_CONFIG_SYSROOT_DIR=$root
export PKG_CONFIG_PATH PKG_CONFIG_SYSROOT_DIR
flags=$(pkg-config --cflags --libs libcommon)
version=$(sed -n 's/^VERSION := //p' "$top/Makefile")

# compiled NAME COMPILER… : a program of tests/install, without a warning.
compiled() {
	program=$1
	shift
	"$@" -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Werror "$top/tests/install/$program.c" \
		-x none $flags -lm -o "$T/$program"
}
# The example from programs: mean irradiance of each side of each patch.
by_programs() {
	inspect --patch-matrix "$T/$1.ff" | sed -n '1s/^from,\(.*\),escape$/\1/p' | tr , '\n' | grep -v -x unmodelled >"$T/names"
	inspect --csv "$T/$1.rad" | $PYTHON -c '
import csv, sys
flux, area = {}, {}
for r in csv.DictReader(sys.stdin):
    at, a = (int(r["patch"]), r["side"] == "b"), float(r["area"])
    flux[at] = flux.get(at, 0) + a * float(r["H_0"])
    area[at] = area.get(at, 0) + a
names = open(sys.argv[1]).read().split("\n")[:-1]
assert len(names) == len(flux)
for name, at in zip(names, sorted(flux)):
    print(name, flux[at] / area[at], sep=",")' "$T/names"
}
# same FILE FILE: equal names and numbers.
same() {
	$PYTHON -c '
import sys
a, b = ([line.rsplit(",", 1) for line in open(f)] for f in sys.argv[1:])
sys.exit(not a or [n for n, x in a] != [n for n, x in b] or
         any(abs(float(x) - float(y)) > 1e-12 * abs(float(y)) for (n, x), (m, y) in zip(a, b)))' "$@"
}

check "libcommon.pc: the version" test "$(pkg-config --modversion libcommon)" = "$version"
check "libcommon.a shows twopass_* only" sh -c \
	"nm -g --defined-only '$root/opt/two/lib/libcommon.a' >'$T/shown' &&
	 grep -q ' T twopass_mesh\$' '$T/shown' && ! grep '^[0-9a-f]' '$T/shown' | grep -v ' T twopass_'"
grep '^[^ *].*(' "$top/formats/api/twopass.h" | grep -o 'twopass_[a-z_]*(' | tr -d '(' |
	LC_ALL=C sort >"$T/declared"
sed -n 's/.* T \(twopass_.*\)/\1/p' "$T/shown" | LC_ALL=C sort >"$T/defined"
check "which are the functions of the header" diff "$T/declared" "$T/defined"
for scene in corner cornell; do
	prepare mesh "$scenes/$scene.gltf" -o "$T/$scene.mesh"
	prepare ffcalc "$T/$scene.mesh" -o "$T/$scene.ff"
	prepare shoot "$T/$scene.mesh" "$T/$scene.ff" -o "$T/$scene.rad"
	by_programs $scene >"$T/$scene.csv"
done
for language in "gcc -std=c11" "g++ -x c++"; do
	rm -f "$T/example"
	check "$language: the example compiles" compiled example $language
	for scene in corner cornell; do
		"$T/example" "$scenes/$scene.gltf" >"$T/said"
		check "$language: $scene as by the programs" same "$T/said" "$T/$scene.csv"
	done
done
refuses 1 '^example: .*no-such.gltf.*No such file' "the example says what is wrong" \
	"$T/example" "$T/no-such.gltf"
check "a program of all calls compiles" compiled calls gcc -std=c11
check "all calls do as they say" env TMPDIR="$T" "$T/calls" "$scenes/furnace.gltf" "$T"
check "and leave no temporary file" sh -c "! ls '$T'/twopass.*"
check "twopass(3) has all names of the header" $PYTHON -c '
import re, sys
header, page = (open(f).read() for f in sys.argv[1:])
names = set(re.findall(r"\b(?:twopass|TWOPASS)_[A-Za-z_]*[a-zA-Z]\b", header)) - {"TWOPASS_H"}
for line in re.findall(r"^\t[\w ]+[ *]((?:\w+, )*\w+)(?:\[\w+\])?;", header, re.M):
    names |= set(line.split(", "))
missing = names - set(re.findall(r"\w+", page))
sys.exit("missing: " + " ".join(sorted(missing)) if missing else 0)' \
	"$top/formats/api/twopass.h" "$top/man/twopass.3"
check "the program in twopass(3) is the example" sh -c "
	mandoc -T utf8 '$top/man/twopass.3' | sed 's/.\x08//g' | sed -n '/^ *#include <stdio.h>/,/^     }/p' |
	sed 's/^     //' >'$T/page' &&
	sed -n '/^#include <stdio.h>/,\$p' '$top/tests/install/example.c' | expand -t 8 | diff - '$T/page'"

# ---- and away ----

check "uninstall" in_tree uninstall DESTDIR="$root" PREFIX=/opt/two
check "uninstall leaves nothing" test -z "$(files)"
check "uninstall of what is not there" in_tree uninstall DESTDIR="$root" PREFIX=/opt/two
done_testing
