#!/bin/sh
# tier: slow
# Output that cannot be written, and runs that are stopped half-way: exit 1, one
# line, and the old file whole.
. "$(dirname "$0")/tap.sh"

prepare mesh "$scenes/cornell.gltf" -o "$T/a.mesh"
prepare ffcalc "$T/a.mesh" -o "$T/a.ff" -m rays -n 256
prepare shoot "$T/a.mesh" "$T/a.ff" -o "$T/a.rad"
prepare trace "$T/a.rad" -c classic -o "$T/a.exr" -s 128x128 --samples 1

# writes TOOL OUT: the tool with that output.
writes() {
	case $1 in
	mesh) mesh "$scenes/cornell.gltf" -o "$2" ;;
	ffcalc) ffcalc "$T/a.mesh" -m rays -n 256 -o "$2" ;;
	shoot) shoot "$T/a.mesh" "$T/a.ff" -o "$2" ;;
	trace) trace "$T/a.rad" -c classic -s 128x128 --samples 1 -o "$2" ;;
	reference) reference "$T/a.mesh" -c classic -s 128x128 --samples 1 -o "$2" ;;
	tone) tone -q "$T/a.exr" -o "$2" ;;
	esac
}
tools="mesh ffcalc shoot trace reference tone"

for tool in $tools; do
	refuses 1 "full: .*[Nn]o space left" "$tool: /dev/full" writes $tool /dev/full
	refuses 1 "none/out: .*[Nn]o such file" "$tool: directory that is not there" \
		writes $tool "$T/none/out"
	refuses 1 "a.mesh/out: .*[Nn]ot a directory" "$tool: a file in the place of a directory" \
		writes $tool "$T/a.mesh/out"
done

# What is read is not written over.
for job in "mesh s.gltf -o ./s.gltf" "mesh s.gltf --refine a.rad -o a.rad" "ffcalc a.mesh -o a.mesh" \
		"shoot a.mesh a.ff -o a.ff" "trace a.rad -o a.rad" "reference a.mesh -o a.mesh" \
		"tone a.exr -o a.exr" "inspect a.mesh --npy vertex -o a.mesh"; do
	cp "$scenes/cornell.gltf" "$T/s.gltf"
	refuses 2 "is what is to be read" "$job" sh -c "cd '$T' && $job"
done

# A directory one may not write to.
mkdir "$T/locked"
chmod 555 "$T/locked"
chmod 755 "$T"
as=
if [ "$(id -u)" -eq 0 ]; then
	as="setpriv --reuid 65534 --regid 65534 --clear-groups"
	$as mesh --version >/dev/null 2>&1 || as=no
fi
for tool in $tools; do
	if [ "$as" = no ]; then
		skip "$tool: directory without write permission" "cannot become another user"
		continue
	fi
	case $tool in
	mesh) set -- mesh "$scenes/cornell.gltf" ;;
	ffcalc) set -- ffcalc "$T/a.mesh" -m rays -n 256 ;;
	shoot) set -- shoot "$T/a.mesh" "$T/a.ff" ;;
	trace) set -- trace "$T/a.rad" -c classic -s 128x128 --samples 1 ;;
	reference) set -- reference "$T/a.mesh" -c classic -s 128x128 --samples 1 ;;
	tone) set -- tone -q "$T/a.exr" ;;
	esac
	refuses 1 "locked/out: .*[Pp]ermission denied" "$tool: directory without write permission" \
		$as "$@" -o "$T/locked/out"
done

# A disk that fills up: the old file stays, nothing else does.
cleanup() { umount "$T/disk" 2>/dev/null; }
mkdir "$T/disk"
if mount -t tmpfs -o size=16k none "$T/disk" 2>/dev/null; then
	for tool in $tools; do
		echo old >"$T/disk/out.file"
		refuses 1 "out.file: .*[Nn]o space left" "$tool: full disk" \
			writes $tool "$T/disk/out.file"
		check "$tool: full disk, the old file is whole and alone" \
			sh -c "[ \"\$(ls -A '$T/disk')\" = out.file ] && [ \"\$(cat '$T/disk/out.file')\" = old ]"
	done
	umount "$T/disk"
else
	skip "full disk" "cannot mount a tmpfs"
fi

# Stopped at some moment. ffcalc writes for most of its time.
# (A shell starts background commands with SIGINT ignored; Python takes that back.)
awake='import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
os.execvp(sys.argv[1], sys.argv[1:])'
for delay in 0.2 0.5 1; do
	for signal in KILL INT TERM; do
		rm -rf "$T/stop" && mkdir "$T/stop"
		echo old >"$T/stop/a.ff"
		$PYTHON -c "$awake" ffcalc "$T/a.mesh" -q -m rays -n 1048576 -o "$T/stop/a.ff" 2>/dev/null &
		process=$!
		sleep $delay
		kill -$signal $process 2>/dev/null
		wait $process 2>/dev/null
		status=$?
		[ $status -gt 128 ] && [ "$(cat "$T/stop/a.ff")" = old ]
		result $? "ffcalc: SIG$signal after $delay s leaves the old file"
		[ $signal = KILL ] && continue
		[ "$(ls -A "$T/stop")" = a.ff ]
		result $? "ffcalc: SIG$signal after $delay s leaves no other file"
	done
done
check "ffcalc: runs over what a killed run left" \
	ffcalc "$T/a.mesh" -m rays -n 256 -o "$T/stop/a.ff"
check "ffcalc: and its output is the usual one" cmp "$T/stop/a.ff" "$T/a.ff"

done_testing
