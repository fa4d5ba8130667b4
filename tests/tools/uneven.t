#!/bin/sh
# tier: slow
# What is stated of patches that are not evenly lit, against particles, in rooms drawn at random.
. "$(dirname "$0")/tap.sh"

check "coarse rooms" $PYTHON "$top/tests/bench/uneven.py" --check -n 5 --seed 20 --particles 1000000 \
	--mesh="-p 25% -e 10%"
done_testing
