"""What the programs are run with on each scene of oracles.py."""
import fnmatch
import math

import numpy as np

LOBES = ["--lobe-rays", "262144"]
# One line a class of scenes, which is named by its group or by a pattern: patch and
# element size as fractions of the longest face edge, samples of each method, where
# shooting stops. The first pattern that fits counts.
CLASSES = {
    #                     patch element hemicube                  rays              shoot
    "infinite_plates_*": (1/2,  1/4,  ["-n", "32", "-p", "256"], ["-n", "4096"], ["-e", "1e-9"]),
    "sphere_mirror_*":   (1,    1,    ["-n", "32", "-p", "32", "--depth", "8"],
                          ["-n", "65536", "--gather", "0", "--depth", "8"], ["-e", "1e-9"]),
    "*sphere*":          (1,    1,    ["-n", "32", "-p", "32"],  ["-n", "2048"], ["-e", "1e-9"]),
    "lobe_in_box_*":     (1,    1,    ["-n", "64", "-p", "16", "--lobe-rays", "65536"],
                          ["-n", "4096", "--lobe-rays", "65536"], ["-e", "1e-9"]),
    "*_to_mirror_*":     (1/4,  1/4,  ["-n", "128", "-p", "64", "--lobe-rays", "65536"],
                          ["-n", "32768", "--lobe-rays", "32768"], ["-e", "1e-9"]),
    "swap_*":            (1/4,  1/4,  ["-n", "128", "-p", "64", "--lobe-rays", "65536"],
                          ["-n", "32768", "--lobe-rays", "32768"], ["-e", "1e-9"]),
    "facing_mirrors_*":  (1/2,  1/2,  ["-n", "16", "-p", "16", "--depth", "1024"],
                          ["-n", "1024", "--depth", "1024"], ["-e", "1e-9"]),
    "furnace":           (1/4,  1/4,  ["-n", "32", "-p", "256"], ["-n", "4096"], ["-e", "1e-12"]),
    "khodulev_cube":     (1/20,  1/40,  ["-n", "32", "-p", "16"],  ["-n", "8192"], ["-e", "1e-9"]),
    "cie171_5.2_*":      (1/8,   1/16,  ["-n", "256", "-p", "16"], ["-n", "65536"], ["-e", "1e-9"]),
    "network":           (1/8,  1/16, ["-n", "32", "-p", "256"], ["-n", "4096"], ["-e", "1e-9"]),
    "cie":               (1/8,  1/16, ["-n", "32", "-p", "256"], ["-n", "4096"], ["-e", "1e-9"]),
    "cornell":           (1/32, 1/32, ["-n", "32", "-p", "8"],   ["-n", "2048"], ["-e", "1e-6"]),
    "specular":          (1/8,  1/8,  ["-n", "128", "-p", "256", *LOBES], ["-n", "131072", *LOBES],
                          ["-e", "1e-9"]),
}
# What meets the tolerances themselves, in less than a minute of one core a scene: patch
# size, or where which faces are cut into patches, and element size, options of ffcalc
# and of shoot. The first pattern that fits counts.
MATRIX = ["-m", "analytic", "--to", "patches", "--precision", "f64"]
ANALYTIC = ["-m", "analytic", "-n", "16384"]


def mild_cuts(n):
    """Fractions of an edge: n spans, those at its ends narrower."""
    t = np.arange(n + 1) / n
    return list(.4 * (1 - np.cos(np.pi * t)) / 2 + .6 * t)


def steep_cuts():
    """Fractions of an edge: towards its ends elements shrink as the cube of the distance,
    and the last to 4e-5, since radiosity goes as about its power of .7 there; elements of
    .002 stand at the quarters and the middle, where values are read."""
    half = [0, 4e-5, *(2e-4 * i ** 3 for i in range(1, 10)), .179, .214, .249,
            *np.linspace(.251, .499, 8)]
    return half + [1 - x for x in half[::-1]]


PATCHES = ["--to", "patches"]
BEST = {
    "furnace_mirror_mix":     (1,    1,    ["-n", "1048576", "--emitter-gain", "1", *PATCHES],
                               ["-e", "1e-9"]),
    "furnace_phong_*":        (1,    1,    ["-n", "32768", "--lobe-rays", "32768"], ["-e", "1e-13"]),
    "furnace*":               (1/2,  1/2,  MATRIX, ["-e", "1e-12"]),
    "all_white_*":            (1/2,  1/2,  MATRIX, ["-e", "1e-12"]),
    "box_in_box_isolated":    (1/2,  1/2,  MATRIX, ["-e", "1e-12"]),
    "infinite_plates_*":      (1,    1,    ["-n", "4096", *PATCHES], ["-e", "1e-9"]),
    "parallel_squares_*":     (1/40, 1/40, MATRIX, ["-e", "1e-9"]),
    "emitter_diffuser_*":     ({"emitter": mild_cuts(24), "*": mild_cuts(84)}, math.inf,
                               ["-m", "analytic", *PATCHES], ["-e", "1e-9"]),
    "cube_one_*":             (1/24, 1/24, MATRIX, ["-e", "1e-9"]),
    "sphere_mirror_caustic":  (1,    1,    ["-n", "524288", "--gather", "0", "--emitter-gain", "1",
                                            "--depth", "8"], ["-e", "1e-9"]),
    "*sphere*":               (1,    1,    ANALYTIC, ["-e", "1e-9"]),
    "facing_mirrors_*":       (1,    1,    ["-n", "1024"], ["-e", "1e-9"]),
    "cie171_5.2_*":           (1/8,  1/32, ANALYTIC, ["-e", "1e-9"]),
    "khodulev_cube":          ({"*": steep_cuts()}, math.inf, MATRIX, ["-e", "1e-9"]),
    "cie171_5.8_*":           (1/8,  1/8,  ANALYTIC, ["-e", "1e-9"]),
    "cie171_5.3_*":           (1/16, 1/32, ANALYTIC, ["-e", "1e-9"]),
    "cie":                    (1/16, 1/32, ANALYTIC, ["-e", "1e-9"]),
    "cornell":                (1/56, 1/56, ["-n", "1280", "--gather", "192"], ["-e", "1e-6"]),
    "light_pipe_*":           (1,    1,    ["-n", "16384", *PATCHES], ["-e", "1e-9"]),
    "mirror_virtual_*":       (1/8,  1/8,  ["-n", "131072"], ["-e", "1e-9"]),
    "clear_pane_*":           (1/8,  1/8,  ["-n", "131072"], ["-e", "1e-9"]),
    "open_lobe_normaliser":   (1/8,  1/8,  ["-n", "16384", "--lobe-rays", "262144"], ["-e", "1e-9"]),
    "lobe_in_box_*":          (1,    1,    ["-n", "4096", "--lobe-rays", "131072"], ["-e", "1e-9"]),
    "*_to_mirror_*":          (1/4,  1/4,  ["-n", "16384", "--lobe-rays", "32768"], ["-e", "1e-9"]),
    "swap_*":                 (1/4,  1/4,  ["-n", "65536", "--lobe-rays", "16384"], ["-e", "1e-9"]),
    "specular":               (1/4,  1/4,  ["-n", "65536", "--lobe-rays", "65536"], ["-e", "1e-9"]),
}


def settings_of(oracle, method):
    """The line of BEST or CLASSES that fits."""
    return next(settings for name, settings in (BEST if method == "best" else CLASSES).items()
                if name == oracle["group"] or fnmatch.fnmatchcase(oracle["id"], name))
