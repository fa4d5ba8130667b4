#!/usr/bin/python3
"""Writes the scenes of this directory (all but clutter): make_scenes.py [NAME...]"""
import math
import os
import sys

import numpy as np

sys.dont_write_bytecode = True
from gltf_writer import Scene, Shape

HERE = os.path.dirname(os.path.abspath(__file__))
PI = math.pi

# The closed room [0,x] x [0,y] x [0,z] of the test scenes, fronts inwards.
def room_faces(x=1.0, y=1.0, z=1.0):
    return {
        "floor": [(0, 0, 0), (x, 0, 0), (x, y, 0), (0, y, 0)],
        "ceiling": [(0, y, z), (x, y, z), (x, 0, z), (0, 0, z)],
        "xmin": [(0, 0, 0), (0, y, 0), (0, y, z), (0, 0, z)],
        "xmax": [(x, 0, z), (x, y, z), (x, y, 0), (x, 0, 0)],
        "ymin": [(0, 0, 0), (0, 0, z), (x, 0, z), (x, 0, 0)],
        "ymax": [(x, y, 0), (x, y, z), (0, y, z), (0, y, 0)],
    }


def paint(exitance=0.0, **coefficients):
    """extras.twopass of a Lambertian emitter with an exitance on its front."""
    return {**coefficients, "emission_front": exitance / PI}


def furnace():
    s = Scene("furnace")
    for i, (name, corners) in enumerate(room_faces().items()):
        rho = i / 5 * .9
        s.rectangle(name, corners, s.material(name, paint(1 - rho, rho_d=rho)))
    s.camera("inside", (.2, .25, .3), (.9, .8, .6), 70, 4 / 3, (0, 0, 1))
    return s


def furnace_two_sided():
    s = Scene("furnace-two-sided")
    wall = s.material("wall", paint(.5, rho_d=.5))
    sheet = s.material("sheet", {"rho_d": .2, "tau_d": .5, "emission_front": .2 / PI,
                                 "emission_back": .4 / PI,
                                 "back": {"rho_d": .1, "tau_d": .6}}, double_sided=True)
    for name, corners in room_faces().items():
        s.rectangle(name, corners, wall)
    s.rectangle("sheet", [(0, 0, .5), (1, 0, .5), (1, 1, .5), (0, 1, .5)], sheet)
    s.camera("below", (.2, .25, .1), (.9, .8, .4), 70, 4 / 3, (0, 0, 1))
    s.camera("above", (.2, .25, .9), (.9, .8, .6), 70, 4 / 3, (0, 0, 1))
    return s


def plates():
    s = Scene("plates")
    mirror = s.material("mirror", {"rho_s": 1})
    floor = s.material("floor", paint(1, rho_d=.5))
    ceiling = s.material("ceiling", {"rho_d": .4})
    lobes = {"rho_s": .25, "alpha": 10, "tau_s": .4, "beta": 10}
    sheet = s.material("sheet", {"rho_d": .1, "tau_d": .15, **lobes,
                                 "back": {"rho_d": .2, "tau_d": .1, **lobes}}, double_sided=True)
    for name, corners in room_faces().items():
        s.rectangle(name, corners, {"floor": floor, "ceiling": ceiling}.get(name, mirror))
    s.rectangle("sheet", [(0, 0, .5), (1, 0, .5), (1, 1, .5), (0, 1, .5)], sheet)
    s.camera("below", (.2, .25, .1), (.9, .8, .4), 70, 4 / 3, (0, 0, 1))
    s.camera("above", (.2, .25, .9), (.9, .8, .6), 70, 4 / 3, (0, 0, 1))
    return s


def corner():
    s = Scene("corner")
    s.rectangle("floor", room_faces()["floor"], s.material("floor", paint(1)))
    s.rectangle("wall", [(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)],
                s.material("wall", {"rho_d": .5}))
    s.camera("view", (2, 1.8, 1.3), (.3, .5, .3), 40, 4 / 3, (0, 0, 1))
    return s


def pane():
    s = Scene("pane")
    s.rectangle("emitter", room_faces()["floor"], s.material("emitter", paint(1)))
    s.rectangle("pane", [(-1, -1, .5), (2, -1, .5), (2, 2, .5), (-1, 2, .5)],
                s.material("glass", {"tau_s": 1}, double_sided=True))
    s.rectangle("receiver", room_faces()["ceiling"], s.material("receiver", {"rho_d": 0}))
    s.camera("view", (-1.5, -1.2, 1.4), (.5, .5, .4), 50, 4 / 3, (0, 0, 1))
    return s


def mirror_image():
    s = Scene("mirror-image")
    s.rectangle("emitter", room_faces()["floor"], s.material("emitter", paint(1)))
    s.rectangle("mirror", [(0, 1, 1), (2, 1, 1), (2, 0, 1), (0, 0, 1)],
                s.material("mirror", {"rho_s": .8}))
    s.rectangle("receiver", [(1, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0)],
                s.material("receiver", {"rho_d": 0}))
    s.camera("view", (1, -2.5, .3), (1, .5, .6), 45, 4 / 3, (0, 0, 1))
    return s


def open_lobe():
    s = Scene("open-lobe")
    a, b = .005, .05
    s.rectangle("mirror", [(-a, -a, 0), (a, -a, 0), (a, a, 0), (-a, a, 0)],
                s.material("lobe", {"rho_s": 1, "alpha": 1}))
    s.rectangle("emitter", [(-b, b, 2), (b, b, 2), (b, -b, 2), (-b, -b, 2)],
                s.material("emitter", paint(1)))
    s.rectangle("receiver", [(1, .5, 1), (2, .5, 1), (2, -.5, 1), (1, -.5, 1)],
                s.material("receiver", {"rho_d": 0}))
    s.camera("view", (-2, -3, .2), (.6, 0, 1), 45, 4 / 3, (0, 0, 1))
    return s


# ---- the Cornell box ----

# Reflectances measured at 400, 404 … 700 nm (Cornell University Program of
# Computer Graphics, "Cornell Box Data"), in thousandths.
WHITE = """343 445 551 624 665 687 708 723 715 710 745 758 739 767 777 765 751 745 748 729 745
757 753 750 746 747 735 732 739 734 725 721 733 725 732 743 744 748 728 716 733 726 713 740 754
764 752 736 734 741 740 732 745 755 751 744 731 733 744 731 712 708 729 730 727 707 703 729 750
760 751 739 724 730 740 737"""
GREEN = """092 096 098 097 098 095 095 097 095 094 097 098 096 101 103 104 107 109 112 115 125
140 160 187 229 285 343 390 435 464 472 476 481 462 447 441 426 406 373 347 337 314 285 277 266
250 230 207 186 171 160 148 141 136 130 126 123 121 122 119 114 115 117 117 118 120 122 128 132
139 144 146 150 152 157 159"""
RED = """040 046 048 053 049 050 053 055 057 056 059 057 061 061 060 062 062 062 061 062 060 059
057 058 058 058 056 055 056 059 057 055 059 059 058 059 061 061 063 063 067 068 072 080 090 099
124 154 192 255 287 349 402 443 487 513 558 584 620 606 609 651 612 610 650 638 627 620 630 628
642 639 657 639 635 642"""


def rgb_of(spectrum):
    """Linear sRGB of a reflectance under equal energy, divided by that of a perfect
    white: colour matching functions of Wyman, Sloan & Shirley, JCGT 2(2), 2013."""
    reflectance = np.array([int(x) for x in spectrum.split()]) / 1000
    wave = np.linspace(400, 700, len(reflectance))

    def bump(height, centre, left, right):
        t = (wave - centre) * np.where(wave < centre, left, right)
        return height * np.exp(-t * t / 2)

    x = bump(1.056, 599.8, .0264, .0323) + bump(.362, 442.0, .0624, .0374) \
        - bump(.065, 501.1, .0490, .0382)
    y = bump(.821, 568.8, .0213, .0247) + bump(.286, 530.9, .0613, .0322)
    z = bump(1.217, 437.0, .0845, .0278) + bump(.681, 459.0, .0385, .0725)
    to_rgb = np.array([[3.2404542, -1.5371385, -.4985314], [-.9692660, 1.8760108, .0415560],
                       [.0556434, -.2040259, 1.0572252]])
    matching = to_rgb @ np.array([x, y, z])
    return [round(float(v), 3) for v in (matching @ reflectance) / matching.sum(1)]


def block(heights, footprint):
    """The top and the four sides of a block, from its footprint seen from above."""
    bottom, top = heights
    s = Shape().polygon(*[(x, top, z) for x, z in footprint])
    for (x0, z0), (x1, z1) in zip(footprint, footprint[1:] + footprint[:1]):
        s.polygon((x0, bottom, z0), (x1, bottom, z1), (x1, top, z1), (x0, top, z0))
    return s


def frame_of(outer, inner):
    """The ring between two quadrilaterals, four trapezia that share their corners."""
    s = Shape()
    for i in range(4):
        j = (i + 1) % 4
        s.polygon(outer[i], outer[j], inner[j], inner[i])
    return s


def cornell():
    s = Scene("cornell")
    metres = lambda shape: scaled(shape, .001)
    white = s.material("white", {"rho_d": rgb_of(WHITE)})
    red = s.material("red", {"rho_d": rgb_of(RED)})
    green = s.material("green", {"rho_d": rgb_of(GREEN)})
    lamp = s.material("lamp", {"rho_d": .78}, glow=(17, 12, 4))
    h, d = 548.8, 559.2
    light = [(343, h, 227), (343, h, 332), (213, h, 332), (213, h, 227)]
    ceiling = [(556, h, 0), (556, h, d), (0, h, d), (0, h, 0)]
    surfaces = {
        "floor": (Shape().polygon((552.8, 0, 0), (0, 0, 0), (0, 0, d), (549.6, 0, d)), white),
        "ceiling": (frame_of(ceiling, light), white),
        "light": (Shape().polygon(*light), lamp),
        "back": (Shape().polygon((549.6, 0, d), (0, 0, d), (0, h, d), (556, h, d)), white),
        "right": (Shape().polygon((0, 0, d), (0, 0, 0), (0, h, 0), (0, h, d)), green),
        # Not planar in the original data: split along the diagonal v0-v2.
        "left": (Shape().polygon((552.8, 0, 0), (549.6, 0, d), (556, h, d), (556, h, 0)), red),
        "short": (block((0, 165), [(130, 65), (82, 225), (240, 272), (290, 114)]), white),
        "tall": (block((0, 330), [(423, 247), (265, 296), (314, 456), (472, 406)]), white),
    }
    for name, (shape, material) in surfaces.items():
        s.shape(name, metres(shape), material)
    lens = math.degrees(2 * math.atan(.0125 / .035))
    s.camera("classic", (.278, .273, -.8), (.278, .273, 0), lens, 1)
    s.camera("corner", (.06, .44, .05), (.36, .17, .36), 62, 1)
    return s


def scaled(shape, factor):
    shape.positions = [tuple(c * factor for c in p) for p in shape.positions]
    return shape


# ---- the paper's subject in one room ----

def upright(points, low, high):
    """Vertical sheets along a polyline seen from above, joined at their edges."""
    s = Shape()
    n = len(points)
    s.add([(x, y, z) for x, z in points for y in (low, high)],
          [t for i in range(n - 1) for a in [2 * i] for t in
           [(a, a + 2, a + 3), (a, a + 3, a + 1)]])
    return s


def slats(points, low, high, rails, offset):
    """A lattice of bars a little in front of each sheet of `upright`."""
    s = Shape()
    half, deep = .012, .016
    for (x0, z0), (x1, z1) in zip(points, points[1:]):
        length = math.hypot(x1 - x0, z1 - z0)
        bars = Shape()
        for x in (.03, length - .03):
            bars.box((x - half, low, offset), (x + half, high, offset + deep))
        for k in range(rails):
            y = low + (high - low) * (k + .5) / rails
            bars.box((.03 + half, y - half, offset), (length - .03 - half, y + half, offset + deep),
                     skip="xX")
        s.join(bars.turned(math.degrees(math.atan2(-(z1 - z0), x1 - x0)), by=(x0, 0, z0)))
    return s


def walls(x, y, z):
    """The six faces of a room with the height y, fronts inwards, by name."""
    return {
        "floor": [(0, 0, z), (x, 0, z), (x, 0, 0), (0, 0, 0)],
        "ceiling": [(0, y, 0), (x, y, 0), (x, y, z), (0, y, z)],
        "back wall": [(0, 0, 0), (x, 0, 0), (x, y, 0), (0, y, 0)],
        "front wall": [(x, 0, z), (0, 0, z), (0, y, z), (x, y, z)],
        "left wall": [(0, 0, z), (0, 0, 0), (0, y, 0), (0, y, z)],
        "right wall": [(x, 0, 0), (x, 0, z), (x, y, z), (x, y, 0)],
    }


def recessed(s, room, holes, plain, lamp, name):
    """The ceiling as a frame around one lamp."""
    s.shape("ceiling", frame_of(room, holes), plain)
    s.shape(name, Shape().polygon(*holes), lamp)


def two_pass():
    s = Scene("two-pass")
    plain = s.material("plaster", {"rho_d": [.78, .76, .72]})
    warm = s.material("ochre paint", {"rho_d": [.66, .47, .28]})
    boards = s.material("boards", {"rho_d": [.42, .28, .17]})
    lacquer = s.material("lacquer", {"rho_d": [.10, .17, .24], "rho_s": .45, "alpha": 60})
    mirror = s.material("mirror", {"rho_s": .92})
    wood = s.material("dark wood", {"rho_d": [.16, .10, .06]})
    paper = s.material("paper", {"rho_d": [.40, .38, .34], "tau_d": [.48, .44, .36]},
                       double_sided=True)
    clear = s.material("clear glass", {"rho_s": .08, "tau_s": [.86, .90, .88]}, double_sided=True)
    frosted = s.material("frosted glass", {"rho_d": .06, "tau_d": .06, "rho_s": .05, "alpha": 30,
                                           "tau_s": [.70, .74, .73], "beta": 30},
                         double_sided=True)
    brick = s.material("brick red", {"rho_d": [.58, .13, .08]})
    teal = s.material("teal", {"rho_d": [.06, .36, .36]})
    ivory = s.material("ivory", {"rho_d": [.80, .77, .68]})
    day = s.material("ceiling lamp", {"rho_d": .7}, glow=(13, 15.5, 19))
    glow = s.material("lantern", {"rho_d": .6}, glow=(36, 20, 8))

    x, y, z = 4, 2.6, 3
    faces = walls(x, y, z)
    for name, material in [("floor", boards), ("front wall", plain), ("left wall", lacquer),
                           ("right wall", warm)]:
        s.shape(name, Shape().polygon(*faces[name]), material)
    recessed(s, faces["ceiling"], [(1.2, y, 1.35), (2.6, y, 1.35), (2.6, y, 1.75), (1.2, y, 1.75)],
             plain, day, "ceiling lamp")

    # The screen closes the back right corner; a lantern stands behind it.
    folds = [(2.62, .22), (3.08, .52), (3.34, 1.02), (3.82, 1.24)]
    s.shape("paper screen", upright(folds, 0, 1.7), paper)
    s.shape("lattice", slats(folds, .03, 1.67, 5, .02), wood)
    s.shape("lantern", Shape().box((3.40, .75, .38), (3.62, 1.05, .60)), glow)
    s.shape("lantern foot", Shape().box((3.46, 0, .44), (3.56, .70, .54), skip="y"), wood)

    # The mirror hangs on the back wall, which is cut out behind it.
    def panel(x0, y0, x1, y1, z):
        return [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]

    face, rim = panel(1.15, 1.1, 2.25, 2.15, .03), panel(1.1, 1.05, 2.3, 2.2, .03)
    s.shape("back wall", frame_of(faces["back wall"], panel(1.1, 1.05, 2.3, 2.2, 0)), plain)
    s.shape("wall mirror", Shape().polygon(*face), mirror)
    s.shape("wall mirror frame", frame_of(rim, face).join(
        Shape().box((1.1, 1.05, 0), (2.3, 2.2, .03), skip="zZ")), wood)

    # Two panes on a low plinth, with things to see behind them.
    s.shape("plinth", Shape().box((.70, 0, 1.70), (2.14, .08, 1.86), skip="y"), wood)
    s.shape("clear pane", Shape().polygon((.74, .08, 1.78), (1.40, .08, 1.78), (1.40, 1.28, 1.78),
                                          (.74, 1.28, 1.78)), clear)
    s.shape("frosted pane", Shape().polygon((1.44, .08, 1.78), (2.10, .08, 1.78),
                                            (2.10, 1.28, 1.78), (1.44, 1.28, 1.78)), frosted)
    posts = Shape().box((.70, 1.28, 1.76), (2.14, 1.32, 1.80))
    for left in (.70, 1.40, 2.10):
        posts.box((left, .08, 1.76), (left + .04, 1.28, 1.80), skip="yY")
    s.shape("pane frame", posts, wood)
    tall = Shape().box((-.16, 0, -.16), (.16, .86, .16), skip="y").turned(24, by=(1.16, 0, 1.02))
    s.shape("tall box", tall, brick)
    low_box = Shape().box((-.22, 0, -.20), (.22, .36, .20), skip="y").turned(-17, by=(1.80, 0, 1.12))
    s.shape("low box", low_box, teal)
    s.shape("ball", Shape().sphere((1.80, .545, 1.12), .18, 3), ivory)

    s.camera("overview", (2.45, 1.5, 6.1), (1.98, 1.22, 0), 41, 4 / 3)
    s.camera("screen", (1.75, 1.35, 2.75), (3.2, .85, .62), 44, 4 / 3)
    s.camera("glossy", (2.9, 1.45, 2.55), (0, 1.05, .95), 55, 4 / 3)
    s.camera("mirror", (.45, 1.5, 1.05), (1.75, 1.48, 0), 58, 4 / 3)
    s.camera("panes", (1.75, 1.05, 2.95), (1.38, .58, 1.2), 52, 4 / 3)
    return s


def lamps():
    s = Scene("lamps")
    s.rectangle("floor", [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)],
                s.material("floor", {"rho_d": .5}))
    s.light("bulb", "point", (-1, 0, 1), intensity=100)
    s.light("beam", "spot", (1, 0, 2), (0, 0, -1), 200, cones=(10, 20))
    s.light("sun", "directional", direction=(0, 3, -4), intensity=10)
    s.camera("above", (0, -4, 4), (0, 0, 0), 45, 4 / 3, (0, 0, 1))
    return s


SCENES = {"cornell": cornell, "two-pass": two_pass, "furnace": furnace,
          "furnace-two-sided": furnace_two_sided, "plates": plates, "corner": corner,
          "pane": pane, "mirror-image": mirror_image, "open-lobe": open_lobe,
          "lamps": lamps}


def main():
    names = sys.argv[1:] or list(SCENES)
    unknown = [n for n in names if n not in SCENES]
    if unknown:
        sys.exit(f"make_scenes.py: no scene {unknown[0]}; there are {', '.join(SCENES)}")
    for name in names:
        SCENES[name]().write(os.path.join(HERE, name + ".gltf"))


if __name__ == "__main__":
    main()
