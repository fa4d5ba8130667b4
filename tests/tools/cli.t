#!/bin/sh
# What all programs have in common: --help, --version, wrong usage.
. "$(dirname "$0")/tap.sh"

tools="mesh ffcalc shoot trace reference inspect exrcmp tone"

for tool in $tools; do
	$tool --help >"$T/help" 2>"$T/err"
	status=$?
	[ $status -eq 0 ] && [ ! -s "$T/err" ] && head -n 2 "$T/help" | grep -q -w "$tool"
	result $? "$tool --help: on stdout, names the program, exit 0"
	$tool --version >"$T/version" 2>"$T/err"
	status=$?
	[ $status -eq 0 ] && [ ! -s "$T/err" ] &&
		grep -q '[0-9][0-9]*\.[0-9][0-9]*\.[0-9]' "$T/version"
	result $? "$tool --version: on stdout, exit 0"
	refuses 2 "^$tool: .*no-such-option" "$tool --no-such-option: exit 2" \
		$tool --no-such-option
	refuses 2 "^$tool: " "$tool without operands: exit 2" $tool
	check "$tool --help: a full disk is noticed" sh -c "! $tool --help >/dev/full 2>/dev/null"
done

# Options that want numbers in a range.
while read -r tool arguments; do
	refuses 2 "^$tool: " "$tool $arguments: exit 2" $tool $arguments -o "$T/out"
done <<END
mesh -p -1 $scenes/corner.gltf
mesh -e x $scenes/corner.gltf
mesh -p 5%% $scenes/corner.gltf
mesh $scenes/corner.gltf $scenes/corner.gltf
ffcalc -m guess any.mesh
ffcalc -n 0 any.mesh
ffcalc -n 1.5 any.mesh
ffcalc --part 3/2 any.mesh
ffcalc --part 0/2 any.mesh
ffcalc --part 1 any.mesh
ffcalc -j 0 any.mesh
shoot -e -1 any.mesh any.ff
shoot -e nan any.mesh any.ff
shoot any.mesh
trace -s 0x10 -c a any.rad
trace -s 10 -c a any.rad
trace --samples 0 -c a any.rad
trace -t 2 -c a any.rad
trace --budget 1 --samples 4 -c a any.rad -o a.exr
trace --gather-rays 0 -c a any.rad
trace -d sideways -c a any.rad
trace --eye 0,0 --target 1,1,1 any.rad
reference --samples 0 -c a any.mesh
END
refuses 2 "^exrcmp: " "exrcmp with one picture: exit 2" exrcmp one.exr
refuses 2 "^exrcmp: --leave-out" "exrcmp -x lamps: exit 2" exrcmp -x lamps a.exr b.exr
refuses 2 "^inspect: " "inspect --row x: exit 2" inspect --row x any.ff

done_testing
