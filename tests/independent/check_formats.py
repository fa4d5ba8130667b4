#!/usr/bin/python3
"""check_formats.py MAN FILE...: do the section-5 pages in directory MAN and the
cache files agree? Every array of a file must be in its pages with this dtype and
shape (sizes like P+1 or 2E must mean the same throughout a file) and every array
in the pages must be in the file, unless the page says what its absence means; likewise
the metadata. The programs in the EXAMPLES of
mesh.5 and ff.5 must be tests/independent/read_cache.py and tests/independent/read_row.py."""

import json
import os
import re
import sys

PAGES = {"twopass.mesh": ["mesh.5"], "twopass.ff": ["ff.5"],
         "twopass.rad": ["mesh.5", "rad.5"]}
COMMON = "Metadata of all three files"
OPTIONAL = {"history", "options", "report", "key"}  # absent when a writer has none


def page_items(path):
    """(section heading, cells of an .It line) of every table row of a page."""
    heading = ""
    for line in open(path, encoding="utf-8"):
        if line.startswith((".Ss ", ".Sh ")):
            heading = line[4:].strip()
        elif line.startswith(".It Sy "):
            yield heading, [cell.strip() for cell in line[7:].split(" Ta ")]


def documented(man, kind):
    arrays, absent, metadata = {}, set(), set()
    for page in PAGES[kind]:
        for _, cells in page_items(os.path.join(man, page)):
            if len(cells) == 5:
                arrays[cells[0]] = (cells[1].split("|"), cells[2].strip("[]").split(","))
                if "absent: " in cells[4]:
                    absent.add(cells[0])
            elif page == "mesh.5" or len(cells) == 2:
                metadata.add(cells[0])
    if kind == "twopass.ff":
        metadata |= {cells[0] for heading, cells in page_items(os.path.join(man, "mesh.5"))
                     if heading == COMMON}
    return arrays, absent, metadata


def size_of(text, sizes, have):
    """The number a size like 4, P, P+1 or 2E stands for; learns P from it."""
    factor, symbol, plus = re.fullmatch(r"(\d*)([A-Z]?)(\+1)?", text).groups()
    if not symbol:
        return int(factor)
    known = sizes.setdefault(symbol, (have - bool(plus)) // int(factor or 1))
    return int(factor or 1) * known + bool(plus)


def check(man, path):
    with open(path, "rb") as f:
        header = json.loads(f.read(int.from_bytes(f.read(8), "little")))
    meta = header.pop("__metadata__")
    arrays, absent, metadata = documented(man, meta["format"])
    sizes, wrong = {}, []
    for name in sorted(arrays.keys() - header.keys() - absent):
        wrong.append(f"array {name} is in the page, not in the file")
    for name, h in header.items():
        if name not in arrays:
            wrong.append(f"array {name} is in the file, not in the page")
            continue
        types, shape = arrays[name]
        if h["dtype"] not in types:
            wrong.append(f"array {name} is {h['dtype']}, the page says {types}")
        if len(shape) != len(h["shape"]):
            wrong.append(f"array {name} is {h['shape']}, the page says {shape}")
        elif [size_of(s, sizes, n) for s, n in zip(shape, h["shape"])] != h["shape"]:
            wrong.append(f"array {name} is {h['shape']}, the page says {shape} with {sizes}")
    keys = {k for k in meta if not k.startswith("digest.")} | {"digest.NAME", "digest.header"}
    for key in sorted(keys ^ metadata):
        if key in keys or key not in OPTIONAL:
            wrong.append(f"metadata {key} is only in the {'file' if key in keys else 'page'}")
    for name in header:
        if "digest." + name not in meta:
            wrong.append(f"array {name} has no digest")
    return [f"{path}: {w}" for w in wrong]


def check_example(man, name, program):
    page = open(os.path.join(man, name), encoding="utf-8").read()
    example = re.search(r"^\.Sh EXAMPLES\n.*?^\.Bd -literal\n(.*?)^\.Ed$", page, re.M | re.S)
    reader = open(os.path.join(os.path.dirname(__file__), program)).read()
    return [] if example and example[1] == reader else [f"{name}: EXAMPLES is not {program}"]


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    wrong = check_example(sys.argv[1], "mesh.5", "read_cache.py")
    wrong += check_example(sys.argv[1], "ff.5", "read_row.py")
    for path in sys.argv[2:]:
        wrong += check(sys.argv[1], path)
    print("\n".join(wrong) if wrong else "pages and files agree")
    sys.exit(bool(wrong))


main()
