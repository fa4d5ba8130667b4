#!/bin/sh
# The Cornell box through the whole chain into a directory, saying what each stage
# took and how large its file is. usage: scenes/demo.sh PROGRAMS-DIR OUTPUT-DIR
set -eu
here=$(cd "$(dirname "$0")" && pwd)
programs=$(cd "$1" && pwd)/
mkdir -p "$2"
cd "$2"
cmp -s "$here/cornell.gltf" cornell.gltf || cp "$here/cornell.gltf" cornell.gltf
printf 'include %s/../tools/pipeline.mk\n' "$here" > demo.mk

targets="cornell.mesh cornell.ff cornell.rad cornell.classic.exr cornell.corner.exr
	cornell.classic.png cornell.corner.png"
if ${MAKE:-make} -s -q -f demo.mk TWOPASS="$programs" $targets 2>/dev/null; then
	echo "demo: everything in $PWD is up to date:"
	ls -1 cornell.classic.exr cornell.classic.png cornell.corner.exr cornell.corner.png |
		sed "s|^|  $PWD/|"
	exit 0
fi

seconds() { date +%s.%N; }
table=""
for target in $targets; do
	begun=$(seconds)
	${MAKE:-make} --no-print-directory -f demo.mk TWOPASS="$programs" "$target"
	table="$table$(printf '%-22s %8.2f s %10d bytes' "$target" \
		"$(echo "$begun $(seconds)" | awk '{ print $2 - $1 }')" \
		"$(stat -c %s "$target")")
"
done
echo
echo "demo: written to $PWD:"
printf '%s' "$table" | sed 's/^/  /'
