#!/usr/bin/env python3
"""Which folder may include which: the layers of lib/ and formats/ (a DAG, lowest first)."""
import collections, glob, os, re, sys

LAYERS = {
    "lib/base": "",
    "lib/data": "base",
    "lib/geometry": "base",
    "lib/scatter": "base data",
    "lib/hemicube": "base data ray",
    "lib/interpolate": "base data",
    "lib/picture": "base data",
    "lib/ray": "base data scatter",
    "lib/mesh": "base data geometry scatter",
    "lib/radiosity": "base data scatter",
    "lib/audit": "base data scatter",
    "lib/occlusion": "base data geometry scatter ray",
    "lib/reference": "base data scatter ray picture",
    "lib/ff_tally": "base data scatter",
    "lib/ff_rays": "base data geometry scatter ray occlusion hemicube ff_tally",
    "lib/ff": "base data geometry scatter ray occlusion hemicube ff_tally ff_rays",
    "lib/aim": "base data geometry scatter ray occlusion",
    "lib/view": "base data geometry scatter ray occlusion aim interpolate picture",
    "formats/container": "base",
    "formats/cache": "base data formats/container",
    "formats/picture": "base picture formats/container",
    "formats/gltf": "base data scatter formats/container",
    "formats/api": "base data scatter geometry mesh ff radiosity interpolate audit ray picture view "
                   "formats/container formats/cache formats/gltf",
}
FILES = r"\b(fopen|fread|fwrite|printf|fprintf|exit|abort)\("
PHYSICS = r"\b(cos|sin|tan|acos|asin|atan2?)\b *\(|3\.14159"
bad = []

# `ar r` keeps one member of a name, and debuggers and tags like it, too.
files = [f for top in ("lib", "formats") for f in glob.glob(top + "/*/*") if re.search(r"\.(c|cc|h)$", f)]
for name, count in collections.Counter(os.path.basename(f) for f in files).items():
    if count > 1:
        bad.append(f"{name}: {count} files of this name")

def is_private(header):
    """Its first comment says so, with the name of its folder."""
    head = open(header).read().partition("*/")[0]
    return re.search(r"private\s(\* )?to " + os.path.dirname(header) + r"\b", head)


for path in sorted(glob.glob("lib/*/*.[ch]") + glob.glob("formats/*/*.*") + glob.glob("tools/**/*.[ch]", recursive=True)):
    folder = os.path.dirname(path)
    text = open(path).read()
    may = {f if "/" in f else "lib/" + f for f in LAYERS.get(folder, "").split()} | {folder}
    for line, code in enumerate(text.split("\n"), 1):
        m = re.match(r'#include "((?:lib|formats|tools)/[^"]*)/[^/"]+"', code)
        if m and m[1] != folder and is_private(code.split('"')[1]):
            bad.append(f"{path}:{line}: that header is private to {m[1]}")
        if m and not folder.startswith("tools") and m[1] not in may:
            bad.append(f"{path}:{line}: {folder} must not include {m[1]}")
        if folder.startswith("lib") and path.endswith(".c") and re.search(FILES, code):
            bad.append(f"{path}:{line}: lib must not do files, print or exit")
        if not folder.startswith("lib") and path.endswith(".c") and re.search(PHYSICS, code):
            bad.append(f"{path}:{line}: physics belongs in lib")
    if "rtcore.h" in text and path != "lib/ray/ray.c":
        bad.append(f"{path}: Embree belongs in lib/ray/ray.c")
print("\n".join(bad) or "layers: ok")
sys.exit(bool(bad))
