#!/bin/sh
# tier: slow
# Caches and pictures have the same bytes for any number of threads, in any
# directory, at every run.
. "$(dirname "$0")/tap.sh"

# chain DIRECTORY THREADS SCENE METHOD CAMERA: everything from glTF to PNG.
chain() {
	mkdir -p "$1" &&
	mesh "$scenes/$3.gltf" -o "$1/a.mesh" -p 25% -e 25% -j "$2" &&
	ffcalc "$1/a.mesh" -o "$1/a.ff" -m "$4" -n 32 -p 4 --lobe-rays 256 -j "$2" &&
	ffcalc "$1/a.mesh" -o "$1/1.ff" -m "$4" -n 32 -p 4 --lobe-rays 256 --part 1/2 -j "$2" &&
	ffcalc "$1/a.mesh" -o "$1/f64.ff" -m "$4" -n 32 -p 4 --lobe-rays 256 --precision f64 -j "$2" &&
	shoot "$1/a.mesh" "$1/a.ff" -o "$1/a.rad" -e 1e-3 -j "$2" &&
	trace "$1/a.rad" -c "$5" -o "$1/a.exr" -s 60x45 --samples 2 -j "$2" &&
	trace "$1/a.rad" -c "$5" -o "$1/lobes.exr" -s 60x45 --samples 2 --lobe-samples 4 -j "$2" &&
	reference "$1/a.mesh" -c "$5" -o "$1/reference.exr" -s 30x22 --samples 4 -j "$2" &&
	tone "$1/a.exr" -o "$1/a.png"
}

while read -r scene method camera; do
	prepare chain "$T/one" 1 $scene $method $camera
	prepare chain "$T/two" 2 $scene $method $camera
	prepare chain "$T/again" 2 $scene $method $camera
	for file in a.mesh a.ff 1.ff f64.ff a.rad a.exr lobes.exr reference.exr a.png; do
		check "$scene, $method, $file: -j 1 as -j 2" cmp "$T/one/$file" "$T/two/$file"
		check "$scene, $method, $file: the same again" cmp "$T/two/$file" "$T/again/$file"
	done
	rm -rf "$T/one" "$T/two" "$T/again"
done <<'END'
cornell rays classic
cornell hemicube corner
plates hemicube below
cornell analytic classic
two-pass rays overview
END

done_testing
