#!/usr/bin/python3
"""ffcalc --paper against eq. (3) of the paper by brute force: every pixel of the hemicubes on front
and back of patch centres is a ray against all elements; scenes drawn at random."""
import base64
import json
import os
import sys
import tempfile

import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from chain import Failed, Tap, container, form_factors, run

PIXELS = 16       # along an edge
PATCHES = 4       # of a scene that are looked at
OFF = 1e-4        # part of a row that may lie elsewhere: pixels whose centre is on an edge
DIFFUSE, REFLECTED, TRANSMITTED = 0, 2, 3


def quad(corner, u, v):
    corner, u, v = map(np.array, (corner, u, v))
    return [corner, corner + u, corner + u + v, corner + v]


def scene(rng):
    """A box that is open at the top, a lobe for a floor, a sheet across it, a lamp: quads and materials."""
    alpha, beta = (float(np.exp(rng.uniform(0, 6))) for _ in range(2))
    materials = [{"rho_d": .5}, {"emission_front": 1.}, {"rho_d": .2, "rho_s": .6, "alpha": alpha},
                 {"rho_d": .1, "rho_s": .3, "alpha": alpha, "tau_s": .4, "beta": beta}]
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    h, x, y = rng.uniform(.3, .9), rng.uniform(.2, .8), rng.uniform(-.3, .3)
    quads = [(quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), 2), (quad((0, 0, 0), (0, 1, 0), (0, 0, h)), 0),
             (quad((1, 0, 0), (0, 0, h), (0, 1, 0)), 0), (quad((0, 0, 0), (0, 0, h), (1, 0, 0)), 0),
             (quad((0, 1, 0), (1, 0, 0), (0, 0, h)), 0), (quad((x, .1, .1), (y, .7, 0), (0, 0, .5)), 3),
             (quad((.1, .6, h + .2), (0, .3, 0), (.3, 0, 0)), 1)]
    return materials, [([turn @ p for p in corners], m) for corners, m in quads]


def write(path, materials, quads):
    data, views, accessors, meshes = b"", [], [], []
    for corners, material in quads:
        for array, kind, code in ((np.array(corners, "<f4"), "VEC3", 5126),
                                  (np.array([0, 1, 2, 0, 2, 3], "<u2"), "SCALAR", 5123)):
            accessor = {"bufferView": len(views), "componentType": code, "count": len(array), "type": kind}
            if kind == "VEC3":
                accessor |= {"min": array.min(0).tolist(), "max": array.max(0).tolist()}
            views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
            data += array.tobytes()
            accessors.append(accessor)
        meshes.append({"primitives": [{"attributes": {"POSITION": len(accessors) - 2},
                                       "indices": len(accessors) - 1, "material": material}]})
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    gltf = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(len(quads)))}],
            "nodes": [{"name": f"q{i}", "mesh": i} for i in range(len(quads))], "meshes": meshes,
            "materials": [{"name": f"m{i}", "doubleSided": True, "extras": {"twopass": m}}
                          for i, m in enumerate(materials)],
            "accessors": accessors, "bufferViews": views,
            "buffers": [{"byteLength": len(data), "uri": uri}]}
    with open(path, "w") as f:
        json.dump(gltf, f)


def pixels(n):
    """Directions through the middles of pixels (t, b, n), their form factors and solid angles, by quadrature."""
    x, w = np.polynomial.legendre.leggauss(6)
    directions, factors, angles = [], [], []
    for face in range(5):
        for j in range(n // 2 if face else n):
            for i in range(n):
                u = (2 * (i + (x + 1) / 2) - n) / n
                v = (2 * (j + (x + 1) / 2) - (0 if face else n)) / n
                area = np.outer(w, w) / n**2
                r2 = 1 + u[None, :]**2 + v[:, None]**2
                height = np.broadcast_to(v[:, None], r2.shape) if face else 1
                angles.append((area / r2**1.5).sum())
                factors.append((area * height / r2**2).sum() / np.pi)
                a, b = (2 * i + 1 - n) / n, (2 * j + 1 - (0 if face else n)) / n
                directions.append([(a, b, 1), (1, a, b), (-1, -a, b), (-a, 1, b), (a, -1, b)][face])
    d = np.array(directions)
    return d / np.linalg.norm(d, axis=1)[:, None], np.array(factors), np.array(angles)


def frame(n):
    """Tangents as hemicubes have them: without a branch, of Duff et al. 2017."""
    s = np.copysign(1, n[2])
    a = -1 / (s + n[2])
    b = n[0] * n[1] * a
    return np.array([[1 + s * n[0]**2 * a, s * b, -s * n[0]], [b, s + n[1]**2 * a, -n[1]], n])


class Scene:
    def __init__(self, mesh, ff):
        _, m = container(mesh)
        self.corners = m["vertex"][m["element"]]
        cross = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        self.area = np.linalg.norm(cross, axis=1) / 2
        self.normal = cross / (2 * self.area[:, None])
        self.start = m["patch_start"]
        self.patch = np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))
        material = m["surface_material"][m["patch_surface"]]
        self.exponent = [m["material_alpha"][material], m["material_beta"][material]]
        self.size = np.abs(m["vertex"]).max()
        _, self.ff = form_factors(ff)

    def centre(self, patch):
        e = slice(self.start[patch], self.start[patch + 1])
        return (self.corners[e].mean(1) * self.area[e, None]).sum(0) / self.area[e].sum()

    def look(self, patch, side, directions):
        """Element-side that each direction (world) sees from the centre of a patch; -1: none."""
        a, u, v = self.corners[:, 0], self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0]
        origin = self.centre(patch) + 1e-6 * self.size * self.outward(patch, side)
        p = np.cross(directions[:, None], v[None])
        det = (p * u).sum(2)
        with np.errstate(all="ignore"):
            s = ((origin - a) * p).sum(2) / det
            q = np.cross(origin - a, u)
            t = (directions @ q.T) / det
            r = (q * v).sum(1) / det
        r[~((s >= 0) & (t >= 0) & (s + t <= 1) & (r > 0))] = np.inf
        nearest = r.argmin(1)
        back = np.take_along_axis(det, nearest[:, None], 1)[:, 0] < 0
        return np.where(np.isfinite(r.min(1)), 2 * nearest + back, -1)

    def outward(self, patch, side):
        return (1 - 2 * side) * self.normal[self.start[patch]]

    def row(self, number):
        """Block 0 of a row, dense, with what escapes last."""
        f, b = self.ff, int(self.ff["row_block"][number])
        begin, end = f["block_start"][b:b + 2].astype(int)
        word, spans = int(f["block_column"][b]) >> 1, int(f["block_column"][b]) & 1
        out = np.zeros(2 * len(self.area) + 1)
        while begin < end:
            first, count = int(f["column"][word]), int(f["column"][word + 1]) if spans else 1
            out[first:first + 2 * count:2] = f["value"][begin:begin + count]
            word, begin = word + 1 + spans, begin + count
        out[:-1] *= f["row_scale"][number]
        out[-1] = f["block_escape"][b] * f["row_scale"][number]
        return out


def expected(s, grid, patch, side, weights):
    """A row of weights by pixel, as `Scene.row` has it."""
    seen = s.look(patch, side, grid @ frame(s.outward(patch, side)))
    out = np.zeros(2 * len(s.area) + 1)
    w = weights(seen >= 0)
    np.add.at(out, seen, w)
    return out / w.sum()


def link_row(s, grid, angles, patch, side, source, transmitted, closed):
    """Eq. (3) for light of a source that came to one side of a patch."""
    n, l = s.outward(patch, side), s.centre(source >> 1) - s.centre(patch)
    l /= np.linalg.norm(l)
    axis, out = (-l, 1 - side) if transmitted else (2 * (n @ l) * n - l, side)
    k = s.exponent[transmitted][patch][side]
    cosine = np.maximum(0, grid @ frame(s.outward(patch, out)) @ axis)
    return expected(s, grid, patch, out, lambda seen: cosine**k * angles * (seen | closed))


def compare(tap, seed, folder, closed):
    rng = np.random.default_rng(seed)
    write(f"{folder}/s.gltf", *scene(rng))
    run("mesh", "-q", "-p", "40%", "-e", "15%", f"{folder}/s.gltf", "-o", f"{folder}/s.mesh")
    run("ffcalc", "-q", "--paper=closed" if closed else "--paper", "-n", PIXELS, "--precision", "f64",
        f"{folder}/s.mesh", "-o", f"{folder}/s.ff")
    s = Scene(f"{folder}/s.mesh", f"{folder}/s.ff")
    grid, factors, angles = pixels(PIXELS)
    kind, worst = s.ff["row_kind"], {}
    diffuse = np.flatnonzero(kind == DIFFUSE)
    for number in rng.choice(diffuse, PATCHES):
        side = int(s.ff["row_side"][number])
        want = expected(s, grid, side >> 1, side & 1, lambda seen: factors)
        worst["F"] = max(worst.get("F", 0), np.abs(s.row(number) - want).sum() / 2)
    links = [i for i in range(len(s.ff["link_target"])) if s.ff["link_source"][i] < 2 * len(s.start) - 2]
    for i in rng.choice(links, 2 * PATCHES):
        target, source = int(s.ff["link_target"][i]), int(s.ff["link_source"][i])
        l = s.centre(source >> 1) - s.centre(target >> 1)
        if l @ s.outward(target >> 1, target & 1) <= 0:
            continue
        for way in range(2):
            number = int(s.ff["link_row"][i][way])
            if number == 0xffffffff:
                continue
            want = link_row(s, grid, angles, target >> 1, target & 1, source, way, closed)
            worst["G"] = max(worst.get("G", 0), np.abs(s.row(number) - want).sum() / 2)
    tap.ok(all(x < OFF for x in worst.values()) and "G" in worst,
           f"scene {seed}, {'closed' if closed else 'as printed'}", f"part of rows elsewhere: {worst}")


def main():
    tap = Tap()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(8):
            try:
                compare(tap, seed, folder, seed % 2 == 1)
            except Failed as failure:
                tap.ok(False, f"scene {seed}", str(failure))
    tap.finish()


if __name__ == "__main__":
    main()
