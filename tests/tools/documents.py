#!/usr/bin/python3
"""Every file, function, struct and constant that a document names exists, as TAP; folders have
READMEs, short enough to be read first."""
import glob
import os
import re
import sys

sys.dont_write_bytecode = True
TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(TOP, "tests", "independent"))
from chain import Tap

SOURCES = ("lib", "formats", "tools", "tests", "scenes")
FILE = re.compile(r"[\w./-]*\w\.(?:c|h|cc|py|t|pl|mk|md|sh|[1-7])")
NAME = re.compile(r"[A-Za-z]\w*_\w+")


def sources():
    for top in SOURCES:
        for folder, folders, files in os.walk(os.path.join(TOP, top)):
            folders[:] = [name for name in folders if name != "__pycache__"]
            yield from (os.path.join(folder, name) for name in files)


def documents():
    yield from glob.glob(os.path.join(TOP, "*.md"))
    yield from (path for path in sources() if path.endswith(".md"))


def is_there(name, document, files):
    places = (TOP, os.path.join(TOP, "lib"), os.path.dirname(document))
    return (any(os.path.exists(os.path.join(place, name)) for place in places) or
            "/" not in name and name in files)


def missing(document, files, words, structs):
    """What a document names in `code` and is nowhere. Words in capitals stand for others."""
    with open(document, encoding="utf-8") as f:
        text = re.sub(r"```.*?```", "", f.read(), flags=re.S)
    for quoted in re.findall(r"`([^`\n]+)`", text):
        struct = re.fullmatch(r"struct (\w+)", quoted)
        if struct and struct[1] not in structs:
            yield quoted
        elif FILE.fullmatch(quoted) and not is_there(quoted, document, files):
            if not re.search("[A-Z]{4}", quoted):
                yield quoted
        elif NAME.fullmatch(quoted) and quoted not in words:
            yield quoted


def main():
    tap = Tap()
    paths = list(sources())
    files = {os.path.basename(path) for path in paths} | set(os.listdir(os.path.join(TOP, "man")))
    words, structs = {name.partition(".")[0] for name in files}, set()
    for path in paths + [os.path.join(TOP, "Makefile")]:
        if re.search(r"\.(c|h|cc|py|t|pl|sh|mk)$|Makefile$", path):
            with open(path, encoding="utf-8") as f:
                text = f.read()
            words.update(re.findall(r"\w+", text))
            structs.update(re.findall(r"struct (\w+)", text))
    for document in sorted(documents()):
        names = list(missing(document, files, words, structs))
        tap.ok(not names, f"{os.path.relpath(document, TOP)}: what it names exists", ", ".join(names))
    for top in ("lib", "formats", "tools", "tests"):
        for folder in sorted({os.path.dirname(path) for path in paths
                              if path.startswith(os.path.join(TOP, top, ""))}):
            place, readme = os.path.relpath(folder, TOP), os.path.join(folder, "README.md")
            lines = len(open(readme, encoding="utf-8").readlines()) if os.path.exists(readme) else 0
            tap.ok(0 < lines and (lines <= 20 or place == top), f"{place}: has a README.md of at most 20 lines",
                   f"{lines} lines")
    return tap.finish()


sys.exit(main())
