#!/bin/sh
# tier: slow
# Energy, on every scene of the repository and by both methods: rows that close, a
# ledger that balances at the end and after every step, and what --verify says.
. "$(dirname "$0")/tap.sh"

# Rows: row_scale (values + escape + black + lost + cut) = 1 to 1e-12; the raw
# residual of rays is below 1e-6.
rows_close() {
	$PYTHON -c '
import sys, chain, numpy as np
_, a = chain.form_factors(sys.argv[1])
first = a["row_block"][:-1].astype(int)
start = a["block_start"].astype(int)
values = a["value"] if "value" in a else a["value64"]
total = np.concatenate([[0.0], np.cumsum(values.astype(float))])
block = total[start[1:]] - total[start[:-1]]
exact = np.array([values[start[b]:start[b + 1]].astype(float).sum() for b in first])
rest = sum(a["block_" + n] for n in ("escape", "black", "lost", "cut"))
closed = a["row_scale"] * (exact + rest[first])
residual = np.abs(a["row_residual"]).max()
print(f"closure {np.abs(closed - 1).max():.2g}, raw residual {residual:.2g}")
sys.exit(not (np.abs(closed - 1).max() <= 1e-12 and residual <= float(sys.argv[2])))' "$@"
}

# emitted = absorbed + escaped + lost + cut + unshot, per band.
ledger_closes() {
	$PYTHON -c '
import sys, chain, numpy as np
_, a = chain.container(sys.argv[1])
emitted, *gone = (x.ravel() for x in a["ledger"])
unshot = sum(a[n].reshape(-1, len(emitted)).sum(0)
             for n in ("unshot_emission", "unshot_diffuse", "unshot_link") if a[n].size)
residual = np.abs(emitted - sum(gone) - unshot) / emitted.max()
print("residual", residual.max())
sys.exit(not residual.max() <= 1e-13)' "$1"
}

for file in "$scenes"/*.gltf; do
	scene=$(basename "$file" .gltf)
	prepare mesh "$file" -o "$T/a.mesh" -p 20% -e 20%
	for method in rays hemicube; do
		name="$scene, $method"
		rm -f "$T/a.ff" "$T/a.rad"
		check "$name: ffcalc" ffcalc "$T/a.mesh" -o "$T/a.ff" -m $method -n 32 -p 4 --lobe-rays 256
		[ -f "$T/a.ff" ] || continue
		[ $method = rays ] && raw=1e-6 || raw=1e-2
		check "$name: rows close" rows_close "$T/a.ff" $raw
		check "$name: shoot" shoot "$T/a.mesh" "$T/a.ff" -o "$T/a.rad" -e 1e-3 --log "$T/log"
		[ -f "$T/a.rad" ] || continue
		check "$name: the ledger closes" ledger_closes "$T/a.rad"
		check "$name: inspect --verify" sh -c \
			"inspect --verify '$T/a.mesh' && inspect --verify '$T/a.ff' && inspect --verify '$T/a.rad'"
	done
done

# After every step, and with a resumed run.
prepare mesh "$scenes/two-pass.gltf" -o "$T/a.mesh" -p 20% -e 20%
prepare ffcalc "$T/a.mesh" -o "$T/a.ff" -m rays -n 64 --lobe-rays 256
for steps in 1 2 3 5 8 13 50 200; do
	rm -f "$T/a.rad"
	prepare shoot "$T/a.mesh" "$T/a.ff" -o "$T/a.rad" -n $steps -e 1e-6
	check "two-pass: the ledger closes after $steps steps" ledger_closes "$T/a.rad"
done
prepare shoot "$T/a.mesh" "$T/a.ff" -o "$T/b.rad" -e 1e-4
prepare shoot "$T/a.mesh" "$T/a.ff" -o "$T/a.rad" --resume -e 1e-4
check "two-pass: resumed, the same as in one go" $PYTHON -c '
import sys, chain
a, b = (chain.container(p)[1] for p in sys.argv[1:])
sys.exit(not all((a[n] == b[n]).all() for n in a))' "$T/a.rad" "$T/b.rad"

done_testing
