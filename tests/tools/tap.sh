# Helpers of the command tests, sourced by each: TAP on stdout, programs in $BUILD
# (default build), scratch files in $T, which is removed at the end. With ONLY=text
# only the checks whose name contains it.

top=$(cd "$(dirname "$0")/../.." && pwd)
bin=$(cd "$top" && cd "${BUILD:-build}" && pwd) || exit 1
scenes=$top/scenes
PYTHON=${PYTHON:-/usr/bin/python3}
PYTHONDONTWRITEBYTECODE=1
PYTHONPATH=$top/tests/exact:$top/tests/independent
export PYTHONDONTWRITEBYTECODE PYTHONPATH
T=$(mktemp -d "${TMPDIR:-/tmp}/twopass.XXXXXX") || exit 1
trap 'cleanup; rm -rf "$T"' EXIT
trap 'exit 1' HUP INT TERM
cleanup() { :; }
PATH=$bin:$PATH
count=0

wanted() {
	case $1 in *"${ONLY:-}"*) ;; *) false ;; esac
}

# result STATUS NAME: a test line; 0 is good.
result() {
	wanted "$2" || return
	count=$((count + 1))
	if [ "$1" -eq 0 ]; then
		echo "ok $count - $2"
	else
		echo "not ok $count - $2"
	fi
}

skip() {
	wanted "$1" || return
	count=$((count + 1))
	echo "ok $count - $1 # SKIP $2"
}

# check NAME COMMAND…: good if the command succeeds; shows what it said otherwise.
check() {
	check_name=$1
	shift
	wanted "$check_name" || return
	"$@" >"$T/check.out" 2>"$T/check.err"
	check_status=$?
	result $check_status "$check_name"
	[ $check_status -eq 0 ] || sed 's/^/# /' "$T/check.out" "$T/check.err"
}

# prepare COMMAND…: no test, but nothing goes on without it.
prepare() {
	"$@" >"$T/prepare.log" 2>&1 && return
	echo "Bail out! $* failed: $(tail -n 1 "$T/prepare.log")"
	exit 1
}

# refuses STATUS PATTERN NAME COMMAND…: the command ends with STATUS, says one line
# that matches PATTERN (basic regular expression) on stderr, nothing on stdout, and
# leaves no $T/out. (Wrong usage, status 2, may point to --help in a second line.)
refuses() {
	want=$1 pattern=$2 refuse_name=$3
	shift 3
	wanted "$refuse_name" || return
	rm -rf "$T/out"
	"$@" >"$T/refuse.out" 2>"$T/refuse.err" </dev/null
	status=$? why=
	lines=$(grep -vc '^Try ' "$T/refuse.err")
	[ $status -eq "$want" ] || why="status $status, wanted $want"
	[ "$lines" -eq 1 ] || why="$why; $lines lines on stderr, wanted one"
	grep -q -e "$pattern" "$T/refuse.err" || why="$why; stderr does not match '$pattern'"
	[ ! -s "$T/refuse.out" ] || why="$why; stdout is not empty"
	[ ! -e "$T/out" ] || why="$why; there is an output file"
	[ -z "$why" ]
	result $? "$refuse_name"
	[ -z "$why" ] || { echo "# ${why#; }"; sed 's/^/# /' "$T/refuse.err"; }
}

# edit IN OUT STATEMENT: changes a glTF file; g is its JSON, data its buffer.
edit() {
	$PYTHON - "$@" <<-'END'
	import base64, json, struct, sys
	g = json.load(open(sys.argv[1]))
	head = "data:application/octet-stream;base64,"
	data = bytearray(base64.b64decode(g["buffers"][0]["uri"][len(head):]))
	exec(sys.argv[3])
	if "buffers" in g:
	    g["buffers"][0]["uri"] = head + base64.b64encode(bytes(data)).decode()
	json.dump(g, open(sys.argv[2], "w"))
	END
}

# flip IN OUT WHERE: one bit changed in the header, or in the array named WHERE.
flip() {
	$PYTHON - "$@" <<-'END'
	import json, struct, sys
	data = bytearray(open(sys.argv[1], "rb").read())
	size, = struct.unpack("<Q", data[:8])
	if sys.argv[3] == "header":
	    at = data.index(b'"__metadata__"') + 20
	else:
	    first, last = json.loads(data[8:8 + size])[sys.argv[3]]["data_offsets"]
	    at = 8 + size + (first + last) // 2
	data[at] ^= 1
	open(sys.argv[2], "wb").write(data)
	END
}

# arrays FILE: the names of its arrays that are not empty.
arrays() {
	$PYTHON -c '
import sys, chain
for name, a in chain.container(sys.argv[1])[1].items():
    if a.size: print(name)' "$1"
}

done_testing() {
	echo "1..$count"
}
