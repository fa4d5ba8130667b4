#!/usr/bin/python3
"""One page about speed and accuracy: index.html with plots, report.txt with the same tables.

report [--out DIR] [--full] [--quick] [--only SECTION]...

Everything is measured anew, in less than 20 minutes on two idle processors; --full adds
what takes longer, --quick takes so few samples that errors mean nothing (to try the
programs). With --work DIR yardsticks are kept there for the next run; remove DIR when
scenes or `reference` changed. BUILD says where the programs are (default build)."""
import argparse
import os
import resource
import shutil
import sys
import tempfile
import time

sys.dont_write_bytecode = True
HERE = os.path.dirname(os.path.abspath(__file__))
TESTS = os.path.dirname(os.path.dirname(HERE))
sys.path[:0] = [HERE, os.path.dirname(HERE), TESTS, os.path.join(os.path.dirname(TESTS), "scenes")]

import directional
import exact
import growth
import page
import rates
import speed
import stated
import views
from chain import Failed
from measure import load, machine
from page import Bar, Title, Words
from plan import FULL, PLAN, QUICK
from yardstick import Scene

SECTIONS = {"rates": rates.section, "views": views.section, "speed": speed.section,
            "stated": stated.section, "exact": exact.oracles, "hard-cases": exact.hard_cases,
            "form-factors": exact.form_factors, "lobes": directional.schemes,
            "exponents": directional.exponent,            "growth": growth.section}
MINUTES = 20


class Run:
    """What the sections share: the plan, scenes with their yardsticks, what was found."""

    def __init__(self, plan, out, work):
        self.plan, self.out, self.work = plan, out, work
        self.scenes, self.rows, self.views, self.bars = {}, [], [], []
        self.begun = time.monotonic()

    def scene(self, name):
        if name not in self.scenes:
            self.tell(f"yardsticks of {name}")
            self.scenes[name] = Scene(name, self.work, *self.plan.samples[name])
        return self.scenes[name]

    def directory(self, name):
        path = os.path.join(self.work, name)
        os.makedirs(path, exist_ok=True)
        return path

    def minutes(self):
        return (time.monotonic() - self.begun) / 60

    def tell(self, what):
        print(f"report: {self.minutes():5.1f} min  {what}", file=sys.stderr, flush=True)

    def told(self, what, things):
        """The things, with a line of progress before each."""
        for i, thing in enumerate(things):
            self.tell(f"{what}: {getattr(thing, 'name', thing)}")
            yield thing


def head(run, begun, whole):
    """The bars, and what it all ran on."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    took = f"{run.minutes():.1f} minutes, {used.ru_utime + used.ru_stime:.0f} processor seconds"
    whole = Bar("this report", f"≤ {MINUTES} minutes on two processors", took,
                run.minutes() <= MINUTES if whole and run.plan is PLAN else None)
    about = machine() + [("load", f"{begun:.1f} processes at the start, {load():.1f} at the end; this "
                                  "report makes it about 2"),
                         ("took", took)]
    yield Words(run.plan.about)
    yield page.bars_table(run.bars + [whole])
    yield Title("The machine")
    yield page.Table("", ["", ""], [list(pair) for pair in about], left=2)
    yield Words("""Other programs on the machine make processor seconds longer, too, up to twice
        where two threads share a core: trust ratios rather than seconds.""")


def write(run, names):
    """The page, anew after each section; one that fails says so. Names of those."""
    begun, blocks, failed = load(), [], []
    for i, name in enumerate(names):
        try:
            blocks += SECTIONS[name](run)
        except Failed as e:
            print(f"report: {name}: {e}", file=sys.stderr)
            failed.append(name)
            blocks += [Title(name), Words(f"Could not be measured: {e}")]
        whole = len(names) == len(SECTIONS) == i + 1
        page.write(run.out, "twopass: speed and accuracy", [*head(run, begun, whole), *blocks])
    return failed


def arguments():
    p = argparse.ArgumentParser(prog="report", description=__doc__,
                                formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("--out", default=".", help="directory to write into (default: this one)")
    p.add_argument("--work", help="keep all files here (default: a temporary directory)")
    p.add_argument("--full", action="store_true", help="also what takes hours")
    p.add_argument("--quick", action="store_true", help="tiny samples")
    p.add_argument("--only", action="append", choices=list(SECTIONS),
                   help="this section, may be repeated")
    return p.parse_args()


def main():
    o = arguments()
    work = o.work or tempfile.mkdtemp(prefix="twopass-report.")
    run = Run(FULL if o.full else QUICK if o.quick else PLAN, o.out, work)
    try:
        failed = write(run, o.only or list(SECTIONS))
    except Failed as e:
        sys.exit(f"report: {e}")
    finally:
        if not o.work:
            shutil.rmtree(work)
    print(f"{os.path.join(o.out, 'index.html')}, report.txt: {run.minutes():.1f} minutes")
    sys.exit(1 if failed else 0)


main()
