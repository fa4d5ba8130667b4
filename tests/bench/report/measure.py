"""Runs of the programs: what they took and what they said; the machine they ran on."""
import os
import re
import resource
import subprocess
import time

from chain import BUILD, TOP, Failed, run


class Ran:
    """Seconds that a run took, elapsed and of the processors, and what it printed."""

    def __init__(self, elapsed, cpu, text):
        self.elapsed, self.cpu, self.text = elapsed, cpu, text

    def said(self, pattern):
        """The number in a pattern's group, None where the program does not say it."""
        found = re.search(pattern, self.text, re.MULTILINE)
        return float(found.group(1)) if found else None

    def memory(self):
        """Peak, MB."""
        return self.said(r"peak memory +([\d.]+) MB")


def ran(tool, *arguments, threads=None, seconds=3600):
    """Runs a program; arguments are what it is given, an output that is there would be
    kept if it was up to date."""
    jobs = ["-j", threads] if threads else []
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    done = run(tool, *jobs, *arguments, seconds=seconds)
    elapsed, after = time.monotonic() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Ran(elapsed, cpu, done.stdout + done.stderr)


def job(function, *arguments):
    """A call's result, and the processor seconds of the programs that it ran: for a process
    of its own, whose children they are (jobs.py)."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    result = function(*arguments)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return result, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def fresh(path):
    """The path, with nothing there."""
    if os.path.exists(path):
        os.remove(path)
    return path


def script(*words, seconds=3600):
    """What a script of tests/ prints, and on stderr. An exit status of 1 says that some
    figure is beyond its bound: the output is still good."""
    words = [os.environ.get("PYTHON", "/usr/bin/python3"), *map(str, words)]
    environment = {**os.environ, "VERBOSE": "1", "BUILD": BUILD}
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=seconds,
                          cwd=TOP, env=environment)
    if done.returncode > 1 or not done.stdout:
        said = done.stderr.strip().splitlines()
        raise Failed(f"{os.path.basename(words[1])} exited {done.returncode}: "
                     f"{said[-1] if said else '(no message)'}")
    return done.stdout, done.stderr


# ---- the machine ----

def first_line(*words):
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=TOP)
    except OSError:
        return ""
    return done.stdout.splitlines()[0].strip() if done.returncode == 0 and done.stdout else ""


def processor():
    model = "unknown processor"
    with open("/proc/cpuinfo") as f:
        for words in f:
            if words.startswith("model name"):
                model = words.split(":")[1].strip()
                break
    return model


def memory_gb():
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30


def machine():
    """Names and values of what the times depend on."""
    return [("processor", f"{processor()}, {len(os.sched_getaffinity(0))} processors"),
            ("memory", f"{memory_gb():.0f} GiB"),
            ("system", f"{first_line('uname', '-sr')}, Embree "
                       f"{first_line('dpkg-query', '-W', '-f', '${Version}', 'libembree-dev')}"),
            ("compiler", f"{first_line(os.environ.get('CC', 'gcc'), '--version')}, "
                         f"{os.environ.get('OPT', 'default options')}"),
            ("version", f"{first_line(os.path.join(BUILD, 'trace'), '--version')}, revision "
                        f"{first_line('git', 'describe', '--always', '--dirty') or 'unknown'}")]


def load():
    return os.getloadavg()[0]
