"""Runs the programs and reads what they write, for the tests in this directory.

BUILD says where the programs are (default build), TEST_THREADS how many threads
they get (default: theirs)."""
import csv
import io
import json
import os
import resource
import struct
import subprocess
import sys

import numpy as np

TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
DATA = os.path.join(TOP, "tests", "exact", "data")
BUILD = os.path.abspath(os.path.join(TOP, os.environ.get("BUILD", "build")))
DTYPES = {"F64": "<f8", "U64": "<u8", "I64": "<i8", "F32": "<f4", "U32": "<u4", "I32": "<i4",
          "U16": "<u2", "U8": "u1"}


class Failed(Exception):
    """A program's exit status was not 0."""


def limited():
    """Keeps a program that wants too much from taking the machine with it. (The
    sanitizers reserve address space by the terabyte.)"""
    if "san" not in os.path.basename(BUILD):
        resource.setrlimit(resource.RLIMIT_AS, (12 << 30, 12 << 30))


def run(tool, *arguments, expect=0, seconds=600):
    """Runs a program; returns its result, or raises if the status is another
    than expected (None: any)."""
    words = [os.path.join(BUILD, tool), *map(str, arguments)]
    try:
        result = subprocess.run(words, capture_output=True, text=True, timeout=seconds,
                                preexec_fn=limited)
    except subprocess.TimeoutExpired:
        raise Failed(f"{tool} took more than {seconds} s") from None
    if expect is not None and result.returncode != expect:
        said = [line for line in result.stderr.splitlines() if not line.startswith("Try ")]
        raise Failed(f"{tool} exited {result.returncode}: {said[-1] if said else '(no message)'}")
    return result


def container(path):
    """The metadata and arrays of a .mesh, .ff or .rad file, mapped from the file."""
    data = np.memmap(path, np.uint8, "r")
    size, = struct.unpack("<Q", data[:8])
    header = json.loads(data[8:8 + size].tobytes())
    meta = header.pop("__metadata__")
    arrays = {name: np.frombuffer(data[8 + size + a["data_offsets"][0]:8 + size + a["data_offsets"][1]],
                                  DTYPES[a["dtype"]]).reshape(a["shape"])
              for name, a in header.items()}
    return meta, arrays


def form_factors(path):
    """The same of a .ff file, with the arrays of rows and blocks that it leaves out, ff(5)."""
    meta, arrays = container(path)
    rows, blocks = len(arrays["row_scale"]), len(arrays["block_column"])
    arrays.setdefault("row_side", 2 * np.arange(rows))
    arrays.setdefault("row_block", np.arange(rows + 1))
    for name in ("row_kind", "row_samples"):
        arrays.setdefault(name, np.zeros(rows, int))
    for name in ("chain", "escape", "black", "lost", "cut"):
        arrays.setdefault("block_" + name, np.zeros(blocks))
    return meta, arrays


def table(text):
    """A CSV with a header as a list of dictionaries; numbers are floats."""
    def value(name, text):
        return text if name in ("name", "material", "side") else float(text)

    rows = csv.DictReader(io.StringIO(text))
    return [{k: value(k, v) for k, v in row.items()} for row in rows]


def picture(path):
    """{channel: array [height, width]} of an uncompressed float EXR file of scan lines
    (OpenEXR file layout: magic, version, attributes, offsets, lines)."""
    with open(path, "rb") as f:
        data = f.read()
    if data[:4] != b"\x76\x2f\x31\x01":
        raise Failed(f"{path}: not an EXR file")
    at, attributes = 8, {}
    while data[at]:
        end = data.index(b"\0", at)
        name = data[at:end].decode()
        at = data.index(b"\0", end + 1) + 1
        size, = struct.unpack_from("<i", data, at)
        attributes[name] = data[at + 4:at + 4 + size]
        at += 4 + size
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    wide, high = x1 - x0 + 1, y1 - y0 + 1
    channels, rest = [], attributes["channels"]
    while rest[0]:
        end = rest.index(b"\0")
        kind, = struct.unpack_from("<i", rest, end + 1)
        channels.append((rest[:end].decode(), {0: "<u4", 1: "<f2", 2: "<f4"}[kind]))
        rest = rest[end + 17:]
    if attributes["compression"] != b"\0":
        raise Failed(f"{path}: compressed; use --compression none")
    planes = {name: np.zeros((high, wide)) for name, _ in channels}
    for offset in struct.unpack_from(f"<{high}Q", data, at + 1):
        y, _ = struct.unpack_from("<ii", data, offset)
        offset += 8
        for name, kind in channels:
            planes[name][y - y0] = np.frombuffer(data, kind, wide, offset)
            offset += wide * np.dtype(kind).itemsize
    return planes


class Tap:
    """Counts and prints test lines; finish() prints the plan and gives the status.
    With ONLY=text in the environment it leaves out those whose name does not contain it."""

    def __init__(self):
        self.count = self.bad = 0
        self.only = os.environ.get("ONLY", "")

    def ok(self, good, name, *notes):
        if self.only not in name:
            return
        self.count += 1
        self.bad += not good
        print(f"{'ok' if good else 'not ok'} {self.count} - {name}")
        for note in notes if not good else ():
            print(f"# {note}")
        sys.stdout.flush()

    def skip(self, name, reason):
        if self.only not in name:
            return
        self.count += 1
        print(f"ok {self.count} - {name} # SKIP {reason}")

    def todo(self, good, name, reason, *notes):
        """An expected failure: does not count as bad."""
        if self.only not in name:
            return
        self.count += 1
        print(f"{'ok' if good else 'not ok'} {self.count} - {name} # TODO {reason}")
        for note in notes:
            print(f"# {note}")

    def finish(self):
        print(f"1..{self.count}")
        return 1 if self.bad else 0
