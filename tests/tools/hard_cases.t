#!/bin/sh
# tier: slow
# Numerically hard inputs.
exec "${PYTHON:-/usr/bin/python3}" "$(dirname "$0")/../exact/hard_cases.py"
