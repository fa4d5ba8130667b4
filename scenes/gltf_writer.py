"""Writes glTF 2.0 files for the scripts of this directory and of tests/.

A Scene collects materials, meshes, nodes and cameras; Shape collects triangles.
Positions are float32 as glTF says; a node matrix is float64 JSON, so a rectangle
whose corners must be exact is a unit square under a matrix (Scene.rectangle).
"""
import base64
import json
import math
import struct

import numpy as np

FLOAT, USHORT, UINT = 5126, 5123, 5125
IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]


class Shape:
    """Triangles, counter-clockwise from the front, with or without normals."""

    def __init__(self):
        self.positions, self.normals, self.triangles = [], [], []

    def add(self, positions, triangles, normals=None):
        first = len(self.positions)
        self.positions += [tuple(map(float, p)) for p in positions]
        self.normals += [tuple(map(float, n)) for n in normals] if normals is not None else []
        self.triangles += [tuple(first + i for i in t) for t in triangles]
        return self

    def polygon(self, *corners):
        """A planar convex polygon as a fan."""
        return self.add(corners, [(0, i, i + 1) for i in range(1, len(corners) - 1)])

    def box(self, low, high, skip=""):
        """An axis-parallel box, outside in front. skip: faces left out, of xXyYzZ."""
        (x, y, z), (X, Y, Z) = low, high
        faces = {
            "x": [(x, y, z), (x, y, Z), (x, Y, Z), (x, Y, z)],
            "X": [(X, y, Z), (X, y, z), (X, Y, z), (X, Y, Z)],
            "y": [(x, y, z), (X, y, z), (X, y, Z), (x, y, Z)],
            "Y": [(x, Y, Z), (X, Y, Z), (X, Y, z), (x, Y, z)],
            "z": [(X, y, z), (x, y, z), (x, Y, z), (X, Y, z)],
            "Z": [(x, y, Z), (X, y, Z), (X, Y, Z), (x, Y, Z)],
        }
        for name, corners in faces.items():
            if name not in skip:
                self.polygon(*corners)
        return self

    def grid(self, point, columns, rows, closed=False, normal=None):
        """A surface point(u, v), u and v in [0,1]; closed: u wraps around.
        normal(u, v) gives smooth normals. Front where du x dv points."""
        wide = columns if closed else columns + 1
        uv = [(c / columns, r / rows) for r in range(rows + 1) for c in range(wide)]
        triangles = []
        for r in range(rows):
            for c in range(columns):
                a, b = r * wide + c, r * wide + (c + 1) % wide
                triangles += [(a, b, b + wide), (a, b + wide, a + wide)]
        points = [point(u, v) for u, v in uv]
        normals = [normal(u, v) for u, v in uv] if normal else None
        kept = [t for t in triangles if len({points[i] for i in t}) == 3]
        return self.add(points, kept, normals)

    def lathe(self, profile, sides, smooth=True):
        """Turns (radius, height) pairs about +Y; a profile going up faces outwards.
        Rings shared with the neighbours get averaged normals."""
        rings = len(profile)
        slope = []
        for i in range(rings):
            (r0, y0), (r1, y1) = profile[max(i - 1, 0)], profile[min(i + 1, rings - 1)]
            length = math.hypot(r1 - r0, y1 - y0)
            slope.append(((y1 - y0) / length, (r0 - r1) / length))
        place = lambda u: (math.cos(2 * math.pi * u), -math.sin(2 * math.pi * u))
        ring = lambda v: min(int(round(v * (rings - 1))), rings - 1)

        def point(u, v):
            (c, s), (r, y) = place(u), profile[ring(v)]
            return (r * c, y, r * s)

        def normal(u, v):
            (c, s), (r, y) = place(u), slope[ring(v)]
            return (r * c, y, r * s)

        return self.grid(point, sides, rings - 1, True, normal if smooth else None)

    def sphere(self, centre, radius, levels):
        """An icosphere with its exact normals."""
        g = (1 + math.sqrt(5)) / 2
        points = [np.array(p, float) / math.hypot(1, g) for p in
                  [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g),
                   (0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]]
        faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9),
                 (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2),
                 (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10),
                 (8, 6, 7), (9, 8, 1)]
        for _ in range(levels):
            middles = {}

            def middle(a, b):
                key = (min(a, b), max(a, b))
                if key not in middles:
                    m = points[a] + points[b]
                    points.append(m / np.linalg.norm(m))
                    middles[key] = len(points) - 1
                return middles[key]

            faces = [f for a, b, c in faces for ab, bc, ca in
                     [(middle(a, b), middle(b, c), middle(c, a))] for f in
                     [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]]
        return self.add([np.array(centre) + radius * p for p in points], faces, points)

    def turned(self, degrees, about=(0, 0, 0), by=(0, 0, 0)):
        """Turned about the vertical through `about`, then moved."""
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        turn = lambda p: (c * p[0] + s * p[2], p[1], -s * p[0] + c * p[2])
        moved = []
        for p in self.positions:
            q = turn([p[i] - about[i] for i in range(3)])
            moved.append(tuple(q[i] + about[i] + by[i] for i in range(3)))
        self.positions = moved
        self.normals = [turn(n) for n in self.normals]
        return self

    def join(self, other):
        return self.add(other.positions, other.triangles, other.normals or None)


class Scene:
    def __init__(self, about):
        self.root = {"asset": {"version": "2.0", "generator": "twopass scenes"},
                     "scene": 0, "scenes": [{"name": about, "nodes": []}], "nodes": []}
        self.points, self.indices = bytearray(), bytearray()
        self.pending, self.squares = [], {}

    def append(self, key, value):
        self.root.setdefault(key, []).append(value)
        return len(self.root[key]) - 1

    def use(self, extension):
        if extension not in self.root.setdefault("extensionsUsed", []):
            self.root["extensionsUsed"].append(extension)

    def material(self, name, twopass=None, colour=None, glow=None, double_sided=False):
        """twopass: extras.twopass. glow: radiance (r, g, b) as glTF's emission.
        colour: for other viewers; by default from the coefficients."""
        m = {"name": name}
        if colour is None and twopass:
            colour = [twopass.get("rho_d", 0), twopass.get("rho_s", 0), twopass.get("tau_d", 0)]
            colour = np.clip(sum(np.broadcast_to(np.asarray(c, float), 3) for c in colour), 0, 1)
        if colour is not None:
            m["pbrMetallicRoughness"] = {"baseColorFactor": [round(float(c), 6) for c in colour] + [1.0],
                                         "metallicFactor": 0.0, "roughnessFactor": 1.0}
        if glow:
            strength = max(glow)
            m["emissiveFactor"] = [g / strength for g in glow]
            m["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
            self.use("KHR_materials_emissive_strength")
        if double_sided:
            m["doubleSided"] = True
        if twopass is not None:
            m["extras"] = {"twopass": twopass}
        return self.append("materials", m)

    def accessor(self, array, kind, component, view):
        store = self.indices if view == 1 else self.points
        while len(store) % 4:
            store.append(0)
        a = {"bufferView": view, "byteOffset": len(store), "componentType": component,
             "count": len(array) if kind == "VEC3" else array.size, "type": kind}
        store += array.tobytes()
        return a

    def mesh(self, name, shape, material):
        p = np.array(shape.positions, "<f4")
        t = np.array(shape.triangles)
        small = len(p) < 65535
        position = self.accessor(p, "VEC3", FLOAT, 0)
        position["min"] = [float(x) for x in p.min(0)]
        position["max"] = [float(x) for x in p.max(0)]
        attributes = {"POSITION": self.append("accessors", position)}
        if shape.normals:
            n = np.array(shape.normals, float)
            n = (n / np.linalg.norm(n, axis=1)[:, None]).astype("<f4")
            attributes["NORMAL"] = self.append("accessors", self.accessor(n, "VEC3", FLOAT, 0))
        index = self.accessor(t.astype("<u2" if small else "<u4"), "SCALAR",
                              USHORT if small else UINT, 1)
        primitive = {"attributes": attributes, "indices": self.append("accessors", index),
                     "material": material}
        return self.append("meshes", {"name": name, "primitives": [primitive]})

    def node(self, name, **what):
        """what: mesh, camera, matrix (16 numbers by column), translation, …"""
        self.root["scenes"][0]["nodes"].append(self.append("nodes", {"name": name, **what}))

    def shape(self, name, shape, material):
        self.node(name, mesh=self.mesh(name, shape, material))

    def rectangle(self, name, corners, material):
        """A rectangle with float64 corners: a unit square under a node matrix."""
        o, a, _, b = [np.array(c, float) for c in corners]
        u, v = a - o, b - o
        n = np.cross(u, v)
        n /= np.linalg.norm(n)
        if material not in self.squares:
            unit = Shape().polygon((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
            self.squares[material] = self.mesh("square", unit, material)
        matrix = [float(x) for column in (u, v, n) for x in (*column, 0.0)] + [*map(float, o), 1.0]
        place = {} if matrix == IDENTITY else {"matrix": matrix}
        self.node(name, mesh=self.squares[material], **place)

    def camera(self, name, eye, target, yfov, aspect=1.0, up=(0, 1, 0)):
        """A perspective camera; yfov in degrees."""
        eye, target = np.array(eye, float), np.array(target, float)
        back = (eye - target) / np.linalg.norm(eye - target)
        right = np.cross(np.array(up, float), back)
        right /= np.linalg.norm(right)
        matrix = [float(x) for column in (right, np.cross(back, right), back)
                  for x in (*column, 0.0)] + [*map(float, eye), 1.0]
        lens = {"yfov": math.radians(yfov), "znear": 0.001, "aspectRatio": aspect}
        index = self.append("cameras", {"name": name, "type": "perspective", "perspective": lens})
        self.node(name, camera=index, matrix=matrix)

    def light(self, name, kind, position=(0, 0, 0), direction=(0, 0, -1), intensity=1.0,
              colour=None, cones=None, scale=1.0):
        """A punctual light that shines along `direction`; cones: inner and outer half
        angle of a spot in degrees; scale of its node, which changes nothing."""
        self.use("KHR_lights_punctual")
        back = -np.array(direction, float) / np.linalg.norm(direction)
        right = np.cross((0, 1, 0) if abs(back[1]) < .9 else (1, 0, 0), back)
        right /= np.linalg.norm(right)
        matrix = [float(x) for column in (right, np.cross(back, right), back)
                  for x in (*(scale * column), 0.0)] + [*map(float, position), 1.0]
        light = {"type": kind, "intensity": intensity}
        if colour is not None:
            light["color"] = list(colour)
        if cones:
            light["spot"] = {"innerConeAngle": math.radians(cones[0]),
                             "outerConeAngle": math.radians(cones[1])}
        lights = self.root.setdefault("extensions", {}).setdefault(
            "KHR_lights_punctual", {"lights": []})["lights"]
        lights.append(light)
        self.node(name, matrix=matrix, extensions={"KHR_lights_punctual": {"light": len(lights) - 1}})

    def finish(self):
        """Lays the buffer out; returns its bytes."""
        while len(self.points) % 4:
            self.points.append(0)
        views = [{"buffer": 0, "byteOffset": 0, "byteLength": len(self.points), "byteStride": 12,
                  "target": 34962},
                 {"buffer": 0, "byteOffset": len(self.points), "byteLength": len(self.indices),
                  "target": 34963}]
        self.root["bufferViews"] = views
        self.root["buffers"] = [{"byteLength": len(self.points) + len(self.indices)}]
        return bytes(self.points + self.indices)

    def write(self, path):
        """A .gltf with an embedded buffer, or a .glb."""
        data = self.finish() if self.root.get("meshes") else b""
        if path.endswith(".glb"):
            text = json.dumps(self.root, separators=(",", ":")).encode()
            text += b" " * (-len(text) % 4)
            data += b"\0" * (-len(data) % 4)
            with open(path, "wb") as f:
                f.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data)))
                f.write(struct.pack("<I4s", len(text), b"JSON") + text)
                f.write(struct.pack("<I4s", len(data), b"BIN\0") + data)
            return
        if data:
            self.root["buffers"][0]["uri"] = ("data:application/octet-stream;base64," +
                                              base64.b64encode(data).decode())
        with open(path, "w", encoding="utf-8") as f:
            f.write(pretty(self.root) + "\n")


def pretty(value, indent=""):
    """JSON a person can edit: short objects and lists of numbers on one line."""
    flat = json.dumps(value)
    leaf = isinstance(value, list) and all(isinstance(v, (int, float)) for v in value)
    if leaf or not isinstance(value, (dict, list)) or len(flat) < 78:
        return flat
    inner = indent + "\t"
    if isinstance(value, dict):
        lines = [f"{inner}{json.dumps(k)}: {pretty(v, inner)}" for k, v in value.items()]
        return "{\n" + ",\n".join(lines) + "\n" + indent + "}"
    return "[\n" + ",\n".join(inner + pretty(v, inner) for v in value) + "\n" + indent + "]"
