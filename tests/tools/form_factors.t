#!/bin/sh
# tier: slow
# Exact form factors between polygons, wherever they are.
exec "${PYTHON:-/usr/bin/python3}" "$(dirname "$0")/../exact/form_factors.py" --tap -m analytic -m rays
