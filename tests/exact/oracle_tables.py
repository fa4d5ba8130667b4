"""Scenes for the tables of tests/exact/data/global_illumination.json (its part "analytic") that
say what light does without saying in which scene, in the form of those that it has."""
import copy
import math

import numpy as np


def scenes_of_tables(analytic, becoming):
    """All of them; analytic: the tables by id, becoming: the scene of phong_to_mirror_series."""
    yield small_lamp(analytic["cie171_5.2_diffuse_point"])
    yield from becoming_mirror(analytic["phong_to_mirror_series"], becoming)
    yield from swapped(analytic["reciprocity_swap"])
    yield from lobes_in_box(analytic["directional_form_factors_box"])
    yield caustic(analytic["sphere_mirror_caustic"])


def sampled(value, error, **expect):
    """A mean irradiance that particles found: four of their standard errors are allowed."""
    return {"quantity": "H", "side": "front", "stat": "mean", "value": value,
            "rel_tol_hemicube": .02, "rel_tol": max(.002, 4 * error / value), **expect}


def becoming_mirror(series, scene):
    """The scene of a lobe's exponent and of both kinds of lobes."""
    for kind, name, values in (("seed", "phong", series["values"]["seed"]),
                               ("reciprocal", "reciprocal", series["values"]["max"])):
        for n, v in values.items():
            materials = copy.deepcopy(scene["materials"])
            for m in materials.values():
                if m["front"].get("rho_s"):
                    m["front"]["n"] = float(n)
            yield {**scene, "id": f"{name}_to_mirror_n{n}", "lobe": kind, "materials": materials,
                   "expect": [sampled(v["H"], v["se"], face="receiver")]}


def swapped(oracle):
    """Light of A and of B by way of a lobe of exponent 1, of both kinds, to the other."""
    faces = [("lobe", [(-.5, -.5, 0), (.5, -.5, 0), (.5, .5, 0), (-.5, .5, 0)]),
             ("A", [(-.5, .5, 2), (.5, .5, 2), (.5, -.5, 2), (-.5, -.5, 2)]),
             ("B", [(2, -.5, .1), (2, -.5, .6), (2, .5, .6), (2, .5, .1)])]
    area = {"A": 1, "B": .5}
    for kind, values in oracle["values"].items():
        for emitter, receiver in ("AB", "BA"):
            materials = {"lobe": {"front": {"rho_s": 1, "n": 1}, "back": {}},
                         receiver: {"front": {}, "back": {}}, emitter: {"front": {"E": 1}, "back": {}}}
            flux, error = (x / area[receiver] for x in values[f"flux_{emitter}_to_{receiver}"])
            yield {"id": f"swap_{kind}_{emitter}_to_{receiver}", "group": "specular",
                   "materials": materials, "lobe": "seed" if kind.startswith("seed") else "reciprocal",
                   "faces": [{"name": n, "mat": n, "verts": v} for n, v in faces],
                   "expect": [sampled(flux, error, face=receiver)]}


def small_lamp(oracle):
    """CIE 171, 5.2: a source of 1000 cd straight down as a patch of 1 cm2, 3 m above a floor."""
    materials = {"floor": {"front": {}, "back": {}},
                 "lamp": {"front": {"E": math.pi * 1e7}, "back": {}}}
    patch = lambda r, z: [(-r, -r, z), (r, -r, z), (r, r, z), (-r, r, z)]
    faces = [{"name": "floor", "mat": "floor", "verts": patch(2, 0)},
             {"name": "lamp", "mat": "lamp", "verts": patch(.005, 3)[::-1]}]
    expect = [{"quantity": "H", "stat": "point", "face": "floor", "side": "front", "label": label,
               "point": [x, y, 0], "value": h, "rel_tol": oracle["rel_tol"],
               "rel_tol_hemicube": .01} for label, (x, y, h) in oracle["points"].items()]
    return {**oracle, "materials": materials, "faces": faces, "expect": expect}


def lobes_in_box(oracle):
    """A speck of a lobe on the floor of a black box, and a spot light that lights nothing else,
    from each angle of the table: the share of the reflected light that each face gets. The
    speck reflects .5 up into a box without a floor. The table is good to 1e-4; what samples
    make of it is asked to 1e-3 of all that is reflected."""
    speck, far, asked = .002, .9, 1e-3
    walls = {"ceiling": [(-1, 1, 1), (1, 1, 1), (1, -1, 1), (-1, -1, 1)],
             "xmin": [(-1, -1, 0), (-1, 1, 0), (-1, 1, 1), (-1, -1, 1)],
             "xmax": [(1, -1, 1), (1, 1, 1), (1, 1, 0), (1, -1, 0)],
             "ymin": [(-1, -1, 0), (-1, -1, 1), (1, -1, 1), (1, -1, 0)],
             "ymax": [(1, 1, 0), (1, 1, 1), (-1, 1, 1), (-1, 1, 0)]}
    faces = [{"name": name, "mat": "k", "verts": v} for name, v in walls.items()]
    square = lambda r, z: [(-r, -r, z), (r, -r, z), (r, r, z), (-r, r, z)]
    faces.append({"name": "mirror", "mat": "m", "verts": square(speck, 0)})
    for name, shares in oracle["values"].items():
        theta, n = (int(word) for word in name[len("theta"):].split("_n"))
        s, c = math.sin(math.radians(theta)), math.cos(math.radians(theta))
        spot = {"name": "spot", "kind": "spot", "intensity": 1e6, "position": (-far * s, 0, far * c),
                "direction": (s, 0, -c), "cones": (.3, .5)}
        materials = {"m": {"front": {"rho_s": .5, "n": n}, "back": {}}, "k": {"front": {}, "back": {}}}
        expect = [{"quantity": "fraction_of_mirror_reflected_flux", "face": face, "value": shares[row],
                   "rel_tol": asked / shares[row],
                   "rel_tol_hemicube": oracle["rel_tol_hemicube"] / shares[row]}
                  for row, face in (("ceiling", "ceiling"), ("xmax", "xmax"), ("xmin", "xmin"),
                                    ("ymin=ymax", "ymin"), ("ymin=ymax", "ymax"))
                  if shares[row] > asked]
        yield {"id": f"lobe_in_box_{name}", "group": "specular", "lobe": "seed", "materials": materials,
               "faces": faces, "lights": [spot], "expect": expect}


def caustic(oracle):
    """A mirror sphere in rings of flat facets, and a speck at its pole of exitance E = flux /
    area. Light that leaves it at a chord of arc psi is at (k + 1) psi after k reflections,
    and psi is spread as sin(psi) / 2. What lands on each quarter of the way to the other pole,
    over all reflections: sum of rho_s^k times the share of psi that is there then."""
    rho, rings, speck, flux = .3, 64, 5e-4, 1.0
    angle = np.pi * np.arange(rings + 1) / rings
    around = 2 * np.pi * np.arange(2 * rings + 1) / (2 * rings)
    at = lambda i, j: (math.sin(angle[i]) * math.cos(around[j]),
                       math.sin(angle[i]) * math.sin(around[j]), math.cos(angle[i]))
    quarter = lambda i: f"quarter {4 * i // rings}"
    faces, area = [], {}
    for i in range(rings):
        for j in range(2 * rings):
            corners = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]
            corners = corners[1:] if not i else corners[:3] if i == rings - 1 else corners
            u, v = np.subtract(corners[1], corners[0]), np.subtract(corners[2], corners[0])
            size = np.linalg.norm(np.cross(u, v)) / 2
            if len(corners) == 4:
                size += np.linalg.norm(np.cross(v, np.subtract(corners[3], corners[0]))) / 2
            area[quarter(i)] = area.get(quarter(i), 0) + size
            faces.append({"name": f"{quarter(i)} {i},{j}", "mat": "mirror", "verts": corners})
    z = 1 - 3e-5
    square = [(-speck, speck, z), (speck, speck, z), (speck, -speck, z), (-speck, -speck, z)]
    faces.append({"name": "speck", "mat": "speck", "verts": square})
    materials = {"mirror": {"front": {"rho_s": rho, "n": "inf"}, "back": {}},
                 "speck": {"front": {"E": flux / (2 * speck) ** 2}, "back": {}}}
    expect = [{"quantity": "H", "stat": "mean", "face": name + " *", "side": "front",
               "value": flux * sum(rho ** k * landing(k, q * math.pi / 4, (q + 1) * math.pi / 4)
                                   for k in range(60)) / area[name],
               "rel_tol": .005, "rel_tol_hemicube": .02} for q, name in enumerate(area)]
    return {"id": oracle["id"], "group": "specular", "lobe": "any", "materials": materials,
            "faces": faces, "expect": expect}


def landing(k, low, high):
    """Share of the light that is between these arcs from the pole after k reflections in a
    sphere, absorbed light not counted: (k + 1) psi folded into 0 ... pi."""
    share, turns = 0.0, k + 1
    for fold in range(turns):
        a, b = (fold * math.pi + low, fold * math.pi + high) if fold % 2 == 0 else \
            ((fold + 1) * math.pi - high, (fold + 1) * math.pi - low)
        share += (math.cos(a / turns) - math.cos(b / turns)) / 2
    return share
