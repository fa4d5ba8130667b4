#!/usr/bin/python3
"""One page about speed and accuracy: index.html with plots, report.txt with the same tables.

report [--out DIR] [--into FILE]... [--full] [--quick] [--only SECTION]...

Everything is measured anew, in less than 20 minutes on two idle processors; the last
table says where they went. --full adds what takes longer, --quick takes so few samples
that errors mean nothing (to try the programs). With --work DIR yardsticks are kept there
for the next run; remove DIR when scenes or `reference` changed. BUILD says where the
programs are (default build)."""
import argparse
import concurrent.futures
import os
import resource
import shutil
import sys
import tempfile
import time

sys.dont_write_bytecode = True
HERE = os.path.dirname(os.path.abspath(__file__))
TESTS = os.path.dirname(os.path.dirname(HERE))
sys.path[:0] = [HERE, os.path.dirname(HERE), os.path.join(TESTS, "exact"),
                os.path.join(TESTS, "independent"), os.path.join(os.path.dirname(TESTS), "scenes")]

import directional
import exact
import growth
import page
import rates
import speed
import stated
import summary
import views
from chain import Failed
from jobs import workers
from measure import job, load, machine, ran
from page import Bar, Title, Words
from plan import FULL, PLAN, QUICK
from yardstick import Scene

SECTIONS = {  # what is submitted first of all, and what is timed and written then
    "rates": (rates.submit, rates.section), "views": (views.submit, views.section),
    "speed": (speed.submit, speed.section), "stated": (None, stated.section),
    "exact": (exact.submit_oracles, exact.oracles),
    "hard-cases": (exact.submit_hard_cases, exact.hard_cases),
    "form-factors": (None, exact.form_factors),
    "lobes": (directional.submit_schemes, directional.schemes),
    "exponents": (directional.submit_exponents, directional.exponent),
    "growth": (None, growth.section)}
APART = {"speed-long": (speed.submit_long, speed.long_section)}  # only if asked for
MINUTES, YARDSTICKS = 20, "yardsticks of "


class Spent:
    """Elapsed and processor seconds since it was made."""

    def __init__(self):
        self.begun = self.now()

    @staticmethod
    def now():
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return time.monotonic(), used.ru_utime + used.ru_stime

    def seconds(self):
        return [now - begun for now, begun in zip(self.now(), self.begun)]


class Run:
    """What the sections share: the plan, scenes with their yardsticks, what was found.

    First all that is not timed is done, one job a processor at a time; then the sections
    have the machine to themselves."""

    def __init__(self, plan, out, work):
        self.plan, self.out, self.work = plan, out, work
        self.scenes, self.rows, self.views, self.bars, self.tables = {}, [], [], [], {}
        self.factors = []
        self.jobs, self.times, self.spent = {}, [], Spent()
        self.pool = workers()

    def submit(self, kind, calls):
        """Of calls {key: (function, arguments…)}; collected() has what they return."""
        self.jobs[kind] = {key: self.pool.submit(job, *call) for key, call in calls.items()}

    def finish_jobs(self):
        jobs = [j for kind in self.jobs.values() for j in kind.values()]
        for i, _ in enumerate(concurrent.futures.as_completed(jobs), 1):
            if i % 10 == 0 or i == len(jobs):
                self.tell(f"{i} of {len(jobs)} jobs that are not timed")
        self.pool.shutdown()
        elapsed, _ = self.spent.seconds()
        for name in self.scenes:
            self.collected(YARDSTICKS + name)  # nothing goes without
        for kind, calls in self.jobs.items():
            took = sum(j.result()[1] for j in calls.values() if not j.exception())
            self.times.append([f"{kind}, side by side", "", f"{took:.0f}"])
        self.times.append(["all that is not timed", f"{elapsed:.0f}", ""])

    def collected(self, kind):
        """{key: (result, processor seconds)}; raises what a job raised."""
        return {key: j.result() for key, j in self.jobs[kind].items()}

    def scene(self, name):
        """Its yardsticks are submitted when it is first asked for."""
        if name not in self.scenes:
            scene = self.scenes[name] = Scene(name, self.work, *self.plan.samples[name])
            self.submit(YARDSTICKS + name, {path: (ran, *words) for path, words in
                                            scene.commands().items()})
        return self.scenes[name]

    def directory(self, name):
        path = os.path.join(self.work, name)
        os.makedirs(path, exist_ok=True)
        return path

    def minutes(self):
        return self.spent.seconds()[0] / 60

    def tell(self, what):
        print(f"report: {self.minutes():5.1f} min  {what}", file=sys.stderr, flush=True)

    def told(self, what, things):
        """The things, with a line of progress before each."""
        for i, thing in enumerate(things):
            self.tell(f"{what}: {getattr(thing, 'name', thing)}")
            yield thing


def head(run, begun, whole):
    """The bars, and what it all ran on."""
    elapsed, processor = run.spent.seconds()
    took = f"{elapsed / 60:.1f} minutes, {processor:.0f} processor seconds"
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


def foot(run):
    """Where the time went."""
    yield Title("What this report took")
    yield Words("""What is not timed is done first, one job on each processor at a time; the
        sections then have the machine to themselves.""")
    yield page.Table("", ["", "seconds", "processor seconds"], run.times)


def write(run, names):
    """The page, anew after each section; one that fails says so. Names of those."""
    begun, blocks, failed = load(), [], []
    sections = {**SECTIONS, **APART}
    for name in names:
        submit, _ = sections[name]
        if submit:
            submit(run)
    run.finish_jobs()
    for i, name in enumerate(names):
        spent = Spent()
        try:
            blocks += sections[name][1](run)
        except Failed as e:
            print(f"report: {name}: {e}", file=sys.stderr)
            failed.append(name)
            blocks += [Title(name), Words(f"Could not be measured: {e}")]
        run.times.append([name, *(f"{s:.0f}" for s in spent.seconds())])
        whole = len(names) == len(SECTIONS) == i + 1
        if whole and not failed:
            run.tables["machine"] = page.Table("", ["", ""], [list(pair) for pair in machine()], left=2)
            run.tables["summary"] = summary.table(run)
        page.write(run.out, "twopass: speed and accuracy",
                   [*head(run, begun, whole), *blocks, *foot(run)])
    return failed


def arguments():
    p = argparse.ArgumentParser(prog="report", description=__doc__,
                                formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("--out", default=".", help="directory to write into (default: this one)")
    p.add_argument("--work", help="keep all files here (default: a temporary directory)")
    p.add_argument("--full", action="store_true", help="also what takes hours")
    p.add_argument("--quick", action="store_true", help="tiny samples")
    p.add_argument("--only", action="append", choices=[*SECTIONS, *APART],
                   help="this section, may be repeated")
    p.add_argument("--into", metavar="FILE", action="append", default=[],
                   help="put the tables of these sections in this file, may be repeated")
    return p.parse_args()


def main():
    o = arguments()
    work = o.work or tempfile.mkdtemp(prefix="twopass-report.")
    run = Run(FULL if o.full else QUICK if o.quick else PLAN, o.out, work)
    try:
        failed = write(run, o.only or list(SECTIONS))
        for path in o.into:
            page.replace_tables(path, run.tables)
    except Failed as e:
        sys.exit(f"report: {e}")
    finally:
        run.pool.shutdown(cancel_futures=True)
        if not o.work:
            shutil.rmtree(work)
    print(f"{os.path.join(o.out, 'index.html')}, report.txt: {run.minutes():.1f} minutes")
    sys.exit(1 if failed else 0)


main()
