#!/bin/sh
# tier: slow
# Directional light against particles and the mirror that it becomes.
exec "${PYTHON:-/usr/bin/python3}" "$(dirname "$0")/../exact/directional.py"
