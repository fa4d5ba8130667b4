#!/bin/sh
# The paper's algorithm from form factors to pictures, and what goes together with --paper.
. "$(dirname "$0")/tap.sh"

prepare mesh -p 50% -e 20% "$scenes/two-pass.gltf" -o "$T/a.mesh"
prepare ffcalc -j 1 -n 16 --paper "$T/a.mesh" -o "$T/a.ff"
prepare ffcalc -n 16 -m hemicube -p 1 "$T/a.mesh" -o "$T/b.ff"
prepare shoot --paper "$T/a.mesh" "$T/a.ff" -o "$T/a.rad"

check "rows are those of eq. (3) by brute force" $PYTHON "$top/tests/independent/paper.py"
check "errors of one hemicube a side are stated" $PYTHON "$top/tests/independent/hemicube_errors.py"
check "the ledger closes" inspect --verify "$T/a.rad"
check "threads change nothing" sh -c "ffcalc -j 2 -n 16 --paper '$T/a.mesh' -o '$T/c.ff' && cmp '$T/a.ff' '$T/c.ff'"
check "a picture" trace --paper -c overview -s 16x12 "$T/a.rad" -o "$T/a.exr"
check "is that of lobes along their axes" trace -d mesh --lobe-samples 0 -c overview -s 16x12 "$T/a.rad" -o "$T/b.exr"
check "to the last bit" exrcmp --max 0 "$T/a.exr" "$T/b.exr"

for option in "-m rays" "-p 4" "--links rays" "--depth 3" "--to patches" "--gather 0" "--lobe-rays 9"; do
	refuses 2 "^ffcalc: --paper " "ffcalc: not with $option" ffcalc --paper $option "$T/a.mesh" -o "$T/out"
done
for option in "-d gather" "--lobe-samples 4" "--gather-rays 64"; do
	refuses 2 "^trace: --paper goes without" "trace: not with $option" trace --paper $option -c overview "$T/a.rad" -o "$T/out"
done
refuses 1 "a.ff: made by ffcalc --paper; give --paper" "shoot: nor its form factors without it" \
	shoot "$T/a.mesh" "$T/a.ff" -o "$T/out"
refuses 1 "b.ff: not made by ffcalc --paper" "shoot: nor others with it" \
	shoot --paper "$T/a.mesh" "$T/b.ff" -o "$T/out"
prepare mesh --lobe reciprocal -p 50% -e 20% "$scenes/open-lobe.gltf" -o "$T/r.mesh"
refuses 1 "run mesh with --lobe paper" "reciprocal lobes are refused" ffcalc --paper "$T/r.mesh" -o "$T/out"
done_testing
