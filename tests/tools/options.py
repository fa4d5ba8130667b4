#!/usr/bin/python3
"""The options of each program, as its table gives them by --help and by what it refuses, and as
its manual page tells them: letters, names, arguments, defaults, ranges, words."""
import os
import re
import subprocess
import sys

sys.dont_write_bytecode = True
TESTS = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(TESTS, "independent"))
from chain import BUILD, TOP, Tap

OPTION = re.compile(r" +(?:(-[A-Za-z]), )?--([a-z][a-z-]*)(?: |(?=\[))?(\S+)?(?:  +(\S.*))?$")


def output(*command):
    done = subprocess.run(command, capture_output=True, text=True)
    return done.stdout, done.stderr


def listed(lines):
    """{name: (letter, argument, text)}, the text what is on the option's line and below it."""
    options, name = {}, None
    for line in lines:
        m = OPTION.match(line)
        if m:
            name = m[2]
            options[name] = (m[1], m[3], m[4] or "")
        elif name and line.strip() and not line.startswith(" " * 13):
            name = None
        elif name:
            letter, argument, text = options[name]
            options[name] = (letter, argument, f"{text} {line.strip()}")
    return options


def page_of(program):
    page, _ = output("mandoc", "-T", "ascii", "-O", "width=200", os.path.join(TOP, "man", program + ".1"))
    return listed(re.sub(".\b", "", page).split("\n"))


def numbers(text):
    return {float(n) for n in re.findall(r"(?<![\w.])-?(?:\d+\.?\d*|\.\d+)(?:e-?\d+)?(?=%|\b)", text)}


def default_missing(said, page):
    """What --help states to be the default and the page does not, or None."""
    m = re.search(r"(\S+) \(default\)|\(default:? ([\w.%,-]*[\w%])", said)
    if not m:
        return None
    default = m[1] or m[2]
    if numbers(default):
        return None if numbers(default) <= numbers(page) else default
    return None if default in ("a", "by", "from", "one") or re.search(rf"\b{default}\b", page) else default


def refusal(program, name):
    return output(os.path.join(BUILD, program), f"--{name}=-99999999999999999999")[1].split("\n")[0]


def range_wrong(refused, page):
    """A range that the page states and the table does not have, or None."""
    has = re.search(r"range from (\S+) to (\S+)$", refused)
    states = re.search(r"(?<![\w.])([\d.]+(?:e-\d+)?) to ([\d.]*\d)(?=[.,:;]| degrees)", page)
    if not has or not states:
        return None
    return None if [float(x) for x in has.groups()] == [float(x) for x in states.groups()] else states[0]


def words_missing(refused, page):
    m = re.search(r"is not (?:one|a list) of (.*)$", refused)
    return [w for w in (m[1].split(", ") if m else []) if not re.search(rf"(?<![\w-]){w}\b", page)]


def main():
    tap = Tap()
    with open(os.path.join(TOP, "Makefile")) as f:
        programs = re.search(r"^TOOLS := (.*)$", f.read(), re.M)[1].split()
    for program in programs:
        table, page = listed(output(os.path.join(BUILD, program), "--help")[0].split("\n")), page_of(program)
        bad = [f"--{n}: {table.get(n, (0, 0))[:2]} in --help, {page.get(n, (0, 0))[:2]} in the page"
               for n in sorted(table.keys() | page.keys()) if table.get(n, (0, 0))[:2] != page.get(n, (0, 0))[:2]]
        tap.ok(table and not bad, f"{program}.1: letters, names and arguments", *bad)
        bad = []
        for name in table.keys() & page.keys():
            refused = refusal(program, name) if table[name][1] else ""
            for what, wrong in (("default", default_missing(table[name][2], page[name][2])),
                                ("range", range_wrong(refused, page[name][2])),
                                ("words", words_missing(refused, page[name][2]))):
                if wrong:
                    bad.append(f"--{name}: {what} {wrong}")
        tap.ok(not bad, f"{program}.1: defaults, ranges and words", *bad)
    sys.exit(tap.finish())


main()
