#!/usr/bin/python3
"""Directional light as TAP: light of several lobes in succession against particles, by
the default and the paper's way, and a lobe that becomes a mirror, in both passes."""
import os
import sys
import tempfile

sys.dont_write_bytecode = True
sys.path[:0] = [os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", folder)
                for folder in ("bench", "independent")]
import exponents
from chain import Tap
from lobes import compare


def succession(tap, scene, allowed, n=1000):
    """The default's own error is what is left when the yardstick's is taken off."""
    results = dict(compare(scene, n, ["centroid", "one lobe", "default"], 4000000, .25))
    own = {k: max(0, r.rms ** 2 - r.noise ** 2) ** .5 for k, r in results.items()}
    said = ", ".join(f"{k} {100 * x:.2f} %" for k, x in own.items())
    tap.ok(own["default"] <= allowed, f"{scene}: within {100 * allowed:g} % by default", said)
    tap.ok(own["one lobe"] > 1.5 * own["default"], f"{scene}: that is what following light is for", said)
    tap.ok(own["centroid"] > 5 * own["default"], f"{scene}: and the paper's way is off by more", said)


def become_mirror(tap):
    known, mirror = exponents.series()
    with tempfile.TemporaryDirectory() as folder:
        got = {n: exponents.measure(n, folder) for n in (30, 1000, 1000000, "inf")}
    for n in (30, 1000):
        truth, error = known[n]
        off = got[n][0] / truth - 1
        tap.ok(abs(off) <= .002 + 3 * error / truth, f"exponent {n}: irradiance as of particles", f"off by {off:.2e}")
    for n in (1000000, "inf"):
        off = got[n][0] / mirror - 1
        tap.ok(abs(off) <= .002, f"exponent {n}: irradiance as of a mirror", f"off by {off:.2e}")
    off = got[1000000][1] / got["inf"][1] - 1
    tap.ok(abs(off) <= .002, "exponent 1e6: seen as a mirror is", f"off by {off:.2e}")


def main():
    tap = Tap()
    succession(tap, "thrice", .03)
    succession(tap, "pane", .04)
    become_mirror(tap)
    sys.exit(tap.finish())


if __name__ == "__main__":
    main()
