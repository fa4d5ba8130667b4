#!/bin/sh
# Every scene is sound glTF, and the scripts still write the scenes that are kept.
. "$(dirname "$0")/tap.sh"

$PYTHON "$scenes/make_clutter.py" "$T/clutter.gltf"
$PYTHON "$scenes/make_clutter.py" "$T/clutter.glb"
check "clutter: the same bytes again" sh -c \
	"$PYTHON '$scenes/make_clutter.py' '$T/again.gltf' && cmp '$T/again.gltf' '$T/clutter.gltf'"
check "all files are valid" $PYTHON "$top/tests/gltf/validate_gltf.py" \
	"$scenes"/*.gltf "$T/clutter.gltf" "$T/clutter.glb"
grep '# SKIP' "$T/check.out" | sed 's/^/# /' | head -n 1
triangles=$($PYTHON -c '
import json, sys
g = json.load(open(sys.argv[1]))
count = [g["accessors"][m["primitives"][0]["indices"]]["count"] // 3 for m in g["meshes"]]
print(sum(count[n["mesh"]] for n in g["nodes"] if "mesh" in n))' "$T/clutter.gltf")
[ "$triangles" -ge 95000 ] && [ "$triangles" -le 105000 ]
result $? "clutter: about 100 000 triangles ($triangles)"
mkdir "$T/scenes"
cp "$scenes"/*.py "$T/scenes"
prepare $PYTHON "$T/scenes/make_scenes.py"
for file in "$scenes"/*.gltf; do
	check "$(basename "$file"): is what make_scenes.py writes" cmp "$file" "$T/scenes/$(basename "$file")"
done
for file in "$scenes"/*.gltf "$T/clutter.gltf"; do
	check "$(basename "$file"): mesh reads it" mesh "$file" -o "$T/a.mesh"
	check "$(basename "$file"): the README has a line about it" \
		grep -q "^| \`$(basename "$file" .gltf)\` |" "$scenes/README.md"
done

done_testing
