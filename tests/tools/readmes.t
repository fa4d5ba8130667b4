#!/bin/sh
# Every folder of these trees has a README.md, short enough to be read first.
. "$(dirname "$0")/tap.sh"

trees="tests"

cd "$top" || exit 1
for folder in $(find $trees -name __pycache__ -prune -o -type d -print | sort); do
	check "$folder: has a README.md" test -s "$folder/README.md"
	case " $trees " in *" $folder "*) continue ;; esac
	check "$folder: of at most 20 lines" sh -c "[ \$(wc -l <'$folder/README.md') -le 20 ]"
done
done_testing
