#!/bin/sh
# tier: slow
# Bad glTF: each file is refused with its own message, exit 1, no output file.
. "$(dirname "$0")/tap.sh"

mkdir "$T/bad"
prepare $PYTHON "$top/tests/gltf/corrupt_gltf.py" "$T/bad"
tab=$(printf '\t')
while IFS=$tab read -r file message; do
	refuses 1 "$message" "mesh: $file: $message" mesh "$T/bad/$file" -o "$T/out"
done <"$T/bad/expected"
check "mesh: any property replaced, bits flipped, bytes cut off: read, or one line" \
	$PYTHON "$top/tests/gltf/corrupt_gltf.py" --sweep "$bin/mesh" "$T"
done_testing
