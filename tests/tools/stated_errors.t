#!/bin/sh
# tier: slow
# What shoot states of its errors, against reference: within a factor 2 of the true error of
# the elements' irradiance (sampling), and of a picture (with what is between elements).
. "$(dirname "$0")/tap.sh"

# twice FILE OPTION…: two independent yardsticks, FILE.1 and FILE.2.
twice() {
	file=$1
	shift
	for seed in 1 2; do
		reference -q "$T/a.mesh" --seed $seed "$@" -o "$file.$seed" || return 1
	done
}

# Truth without the noise of either yardstick: mean (a - b)(a - c).
compare() {
	$PYTHON -c '
import json, sys, chain, numpy as np
def rms(a, b, c, weight):
    part = weight / weight.sum()
    return np.sqrt(((a - b) * (a - c) * part).sum(1).mean()) / ((b * part).sum(1).mean())
def check(what, stated, true):
    print(f"{what}: stated {stated:.4f}, true {true:.4f}")
    assert stated < 2 * true and true < 2 * stated
t = sys.argv[1]
report = json.loads(chain.container(t + "/a.rad")[0]["report"])
sampling, elements = report["sampling"], report["discretisation"]
tables = [chain.table(open(f"{t}/{n}").read()) for n in ("a.csv", "h.1", "h.2")]
h = [np.array([[row[f"H_{k}"] for row in rows] for k in range(3)]) for rows in tables]
check("elements", sampling, rms(*h, np.array([row["area"] for row in tables[0]])))
lamp, *views = (chain.picture(f"{t}/{n}") for n in ("lamp.exr", "view.exr", "v.1", "v.2"))
keep = sum(lamp["emission." + c] for c in "RGB") == 0
a, b, c = (np.array([v[k][keep] for k in "RGB"]) for v in views)
check("picture", np.hypot(sampling, elements), rms(a, b, c, np.ones(a.shape[1])))' "$T"
}

while read -r scene camera size; do
	prepare mesh "$scenes/$scene.gltf" -o "$T/a.mesh"
	prepare ffcalc "$T/a.mesh" -o "$T/a.ff" -n 2048
	prepare shoot "$T/a.mesh" "$T/a.ff" -o "$T/a.rad"
	prepare trace "$T/a.rad" -d mesh -c $camera -s $size --samples 16 --lobe-samples 4 \
		--compression none -o "$T/view.exr"
	prepare trace "$T/a.rad" -d mesh -c $camera -s $size --samples 64 --layers emission \
		--compression none -o "$T/lamp.exr"
	inspect --csv "$T/a.rad" >"$T/a.csv"
	prepare twice "$T/h" --irradiance --samples 1000000
	prepare twice "$T/v" -c $camera -s $size --samples 64 --compression none
	check "$scene: stated errors are within a factor 2" compare
	sed 's/^/# /' "$T/check.out"
	rm -f "$T"/a.*
done <<'END'
cornell classic 128x128
two-pass overview 96x72
END

done_testing
