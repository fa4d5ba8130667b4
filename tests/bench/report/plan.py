"""How much is measured: samples, settings and scenes of a whole, a full and a quick report."""
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Plan:
    about: str
    scenes: tuple            # of speed against error
    samples: dict            # {scene: (paths a pixel, particles)} of the yardsticks
    ladder: tuple            # paths a pixel of `reference` beside them
    crowd: tuple             # particles likewise
    repeat: int              # runs whose median is shown
    repeat_views: int        # of the Cornell box
    solutions: int           # of its solutions
    steps: int               # of each growth
    ff_scenes: tuple
    ff_rays: int             # a patch, of their yardstick
    oracles: tuple           # scenes; empty: all
    oracle_methods: tuple
    pairs: int               # of polygons at random
    hard: bool               # whether hard cases are tried
    lobe_scenes: tuple       # of lobes.py; empty: all
    lobe_exponents: tuple
    lobe_schemes: tuple      # of lobes.SCHEMES
    lobe_samples: int        # particles of the yardstick
    lobe_size: float         # of patches and elements
    exponents: tuple         # of a lobe that becomes a mirror
    rooms: int = 20          # of uneven.py
    room_particles: int = 2_000_000
    most: dict = field(default_factory=dict)  # {(scene, method): settings}, fewer than all

    def settings(self, scene, method):
        return self.most.get((scene, method), self.most.get(method, 99))

    def methods(self, scene):
        return [m for m in ("hemicube", "rays", "auto", "analytic") if self.settings(scene, m)]

    def left_out(self):
        fewer = [f"{m or 'other settings'} on {s}" for (s, m), n in
                 ((k, n) for k, n in self.most.items() if isinstance(k, tuple)) if not n]
        return (f"Left out, for they take too long: {', '.join(fewer)} (`make report FULL=1`)."
                if fewer else "")


EXPONENTS = (1, 3, 10, 30, 100, 300, 1000, 3000, 10_000, 100_000, 1_000_000)
PLAN = Plan(
    about="All in one run of less than 20 minutes on two processors; `make report FULL=1` "
          "measures more.",
    scenes=("cornell", "two-pass", "clutter"),
    samples={"cornell": (24576, 16_000_000), "two-pass": (2048, 16_000_000),
             "clutter": (1024, 16_000_000)},
    ladder=(1, 4, 16, 64, 256), crowd=(10_000, 100_000, 1_000_000), repeat=1, repeat_views=3,
    solutions=99, steps=99, ff_scenes=("cube16", "cube24", "room", "city100"), ff_rays=40960,
    oracles=(), oracle_methods=("best",), pairs=150, hard=True, lobe_scenes=(), lobe_exponents=(20, 1000),
    lobe_schemes=("paper", "paper closed", "centroid", "one lobe", "default"),
    lobe_samples=4_000_000, lobe_size=.25,
    exponents=EXPONENTS,
    most={("two-pass", "analytic"): 0, ("two-pass", None): 0, ("clutter", "analytic"): 0,
          ("clutter", "hemicube"): 0, ("clutter", "rays"): 2, ("clutter", "auto"): 3,
          ("clutter", None): 0})
FULL = Plan(
    about="The long report (`make report FULL=1`): also the methods that take long, medians of three.",
    scenes=PLAN.scenes, samples={name: (4 * s, 4 * p) for name, (s, p) in PLAN.samples.items()},
    ladder=(1, 4, 16, 64, 256, 1024), crowd=(10_000, 100_000, 1_000_000, 10_000_000), repeat=3,
    repeat_views=5, solutions=99, steps=99,
    ff_scenes=("cube16", "cube24", "room", "room-turned", "city100", "city370", "city2100"),
    ff_rays=409600, oracles=(), oracle_methods=("hemicube", "rays", "best"), pairs=2000, hard=True,
    lobe_scenes=(), lobe_exponents=(5, 20, 100, 1000),
    lobe_schemes=("paper", "paper closed", "centroid", "one lobe", "default", "fine"),
    lobe_samples=16_000_000, lobe_size=.25, exponents=EXPONENTS, rooms=100, room_particles=8_000_000)
QUICK = Plan(
    about="A quick try of the programs: samples are so few that the errors mean nothing.",
    scenes=("cornell",), samples={name: (32, 100_000) for name in PLAN.scenes},
    ladder=(1, 4), crowd=(1000, 10_000), repeat=1, repeat_views=1, solutions=1, steps=3,
    ff_scenes=("cube16",), ff_rays=4096, oracles=("furnace_hetero_diffuse",), oracle_methods=("best",),
    pairs=8, hard=False, lobe_scenes=("twice",), lobe_exponents=(20,), lobe_schemes=("paper", "default"),
    lobe_samples=100_000, lobe_size=.5,
    exponents=(30, 1000, 10_000), rooms=1, room_particles=10_000,
    most={"hemicube": 1, "rays": 1, "auto": 1, "analytic": 0, None: 1})
