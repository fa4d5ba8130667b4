#!/bin/sh
# Manual pages: without faults, one for each program, in agreement with the files the
# programs write; and the program printed in one of them works. Options: options.py.
. "$(dirname "$0")/tap.sh"

pages=$(cd "$top/man" && ls)
programs=$(sed -n 's/^TOOLS := //p' "$top/Makefile")

# text PAGE: as a reader sees it.
text() { mandoc -T ascii "$top/man/$1" | sed 's/.\x08//g'; }

for page in $pages; do
	check "$page: no warnings" sh -c \
		"mandoc -T lint -W warning '$top/man/$page' >'$T/lint' 2>&1 && [ ! -s '$T/lint' ]"
	sed 's/^/# /' "$T/lint"
done

for program in $programs; do
	check "$program has a page" test -s "$top/man/$program.1"
done
for page in $pages; do
	case $page in *.1) ;; *) continue ;; esac
	echo " $programs " | grep -q -F " ${page%.1} "
	result $? "$page has a program"
done

# Pages that a page refers to are there.
for page in $pages; do
	sed -n -E 's/^\.Xr ([^ ]+) ([0-9]).*/\1.\2/p' "$top/man/$page"
done | sort -u >"$T/references"
check "pages referred to are there" sh -c "
	while read -r page; do
		[ \$page = make.1 ] || [ -s '$top/man/'\$page ] || { echo \$page; exit 1; }
	done <'$T/references'"

# Files of a scene that has everything: lobes, mirrors, panes, two-sided patches.
prepare mesh -p 50% -e 50% "$scenes/two-pass.gltf" -o "$T/a.mesh"
prepare ffcalc -n 64 --lobe-rays 64 "$T/a.mesh" -o "$T/a.ff"
prepare ffcalc -n 64 --lobe-rays 64 --precision f64 --part 1/2 "$T/a.mesh" -o "$T/b.ff"
prepare ffcalc -m hemicube -n 8 -p 4 --lobe-rays 64 "$T/a.mesh" -o "$T/c.ff"
prepare shoot -e .1 "$T/a.mesh" "$T/a.ff" -o "$T/a.rad"
for file in a.mesh a.ff b.ff c.ff a.rad; do
	check "mesh.5, ff.5, rad.5: $file has the arrays of its pages" \
		$PYTHON "$top/tests/independent/check_formats.py" "$top/man" "$T/$file"
done

# The program in mesh.5, as one would copy it from a terminal.
text mesh.5 | $PYTHON -c '
import re, sys, textwrap
print(textwrap.dedent(re.search(r"^ *import json.*?(?=^SEE ALSO)", sys.stdin.read(), re.M | re.S)[0]))
' >"$T/reader.py"
reads() {
	/usr/bin/python3 "$T/reader.py" "$1" >"$T/read" && $PYTHON -c '
import sys, chain
lines = [line.split() for line in open(sys.argv[2])]
means = [[n, str(a.mean()) if a.size else "-"] for n, a in chain.container(sys.argv[1])[1].items()]
sys.exit([[words[0], words[-1]] for words in lines] != means)' "$1" "$T/read"
}
for file in a.mesh a.ff a.rad; do
	check "mesh.5: its Python program reads $file" reads "$T/$file"
done
done_testing
