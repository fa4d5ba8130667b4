#!/usr/bin/python3
"""Checks glTF files, as TAP: validate_gltf.py FILE...

With the Khronos validator where it is installed (npm install gltf-validator; NODE_PATH
or GLTF_VALIDATOR says in which node_modules), and in any case with the checks below:
structure, ranges, alignment, bounds, node trees, and triangles that have an area and
agree with their neighbours about the front."""
import base64
import json
import os
import shutil
import struct
import subprocess
import sys

import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "independent"))
from chain import Tap

KINDS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
PARTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
SCRIPT = """
const v = require('gltf-validator'), fs = require('fs');
v.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1]))).then(r => {
  for (const m of r.issues.messages.filter(m => m.severity < 2))
    console.log(m.code, m.pointer, m.message);
  process.exit(r.issues.numErrors ? 1 : 0);
});
"""


class Bad(Exception):
    pass


def need(condition, what):
    if not condition:
        raise Bad(what)


def load(path):
    """The JSON and the bytes of its one buffer."""
    with open(path, "rb") as f:
        data = f.read()
    if data[:4] == b"glTF":
        _, version, length = struct.unpack("<4sII", data[:12])
        need(version == 2 and length == len(data), "GLB header")
        size, kind = struct.unpack("<I4s", data[12:20])
        need(kind == b"JSON" and size % 4 == 0, "GLB JSON chunk")
        root, rest = json.loads(data[20:20 + size]), data[20 + size:]
        size, kind = struct.unpack("<I4s", rest[:8])
        need(kind == b"BIN\0" and size % 4 == 0 and len(rest) == 8 + size, "GLB BIN chunk")
        return root, rest[8:]
    root = json.loads(data)
    uri = root["buffers"][0]["uri"]
    need(uri.startswith("data:application/octet-stream;base64,"), "the buffer is embedded")
    return root, base64.b64decode(uri.split(",", 1)[1], validate=True)


def read_accessor(root, data, index):
    a = root["accessors"][index]
    view = root["bufferViews"][a["bufferView"]]
    kind, parts = np.dtype(KINDS[a["componentType"]]), PARTS[a["type"]]
    offset = a.get("byteOffset", 0)
    stride = view.get("byteStride", kind.itemsize * parts)
    need(offset % kind.itemsize == 0 and view.get("byteOffset", 0) % 4 == 0, f"accessor {index}: alignment")
    need(offset + stride * (a["count"] - 1) + kind.itemsize * parts <= view["byteLength"],
         f"accessor {index}: ends inside its view")
    start = view.get("byteOffset", 0) + offset
    values = np.lib.stride_tricks.as_strided(
        np.frombuffer(data, kind, offset=start), (a["count"], parts), (stride, kind.itemsize))
    if "min" in a:
        need(np.array_equal(values.min(0), a["min"]) and np.array_equal(values.max(0), a["max"]),
             f"accessor {index}: min and max")
    return values


def check_primitive(root, data, name, primitive):
    position = read_accessor(root, data, primitive["attributes"]["POSITION"]).astype(float)
    need("min" in root["accessors"][primitive["attributes"]["POSITION"]], f"{name}: bounds")
    need(np.isfinite(position).all(), f"{name}: finite positions")
    if "NORMAL" in primitive["attributes"]:
        normal = read_accessor(root, data, primitive["attributes"]["NORMAL"]).astype(float)
        need(len(normal) == len(position), f"{name}: a normal for each position")
        need(np.abs(np.linalg.norm(normal, axis=1) - 1).max() < 1e-5, f"{name}: unit normals")
    index = read_accessor(root, data, primitive["indices"]).ravel().astype(int)
    need(len(index) % 3 == 0 and index.max() < len(position), f"{name}: indices")
    need(primitive["material"] < len(root["materials"]), f"{name}: material")
    triangles = index.reshape(-1, 3)
    corners = position[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    need((area > 0).all(), f"{name}: no triangle without area")
    if "NORMAL" in primitive["attributes"]:
        front = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        need((np.einsum("ij,ij->i", front, normal[triangles].mean(1)) > 0).all(),
             f"{name}: normals on the front")
    _, welded = np.unique(position, axis=0, return_inverse=True)
    edges = welded.ravel()[triangles[:, [0, 1, 1, 2, 2, 0]]].reshape(-1, 2)
    _, edge, uses = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    direction = np.bincount(edge.ravel(), np.where(edges[:, 0] < edges[:, 1], 1, -1))
    need((direction[uses == 2] == 0).all(), f"{name}: neighbours agree about the front")


def check_nodes(root):
    parents = [child for n in root["nodes"] for child in n.get("children", [])]
    need(len(set(parents)) == len(parents), "every node has one parent")
    roots = [n for scene in root["scenes"] for n in scene["nodes"]]
    need(not set(roots) & set(parents), "scenes list root nodes")
    for n in root["nodes"]:
        need(n["name"], "nodes have names")
        if "matrix" in n:
            m = np.array(n["matrix"]).reshape(4, 4).T
            need(len(n["matrix"]) == 16 and np.array_equal(m[3], [0, 0, 0, 1]), f"{n['name']}: affine")
            columns = m[:3, :3] / np.linalg.norm(m[:3, :3], axis=0)
            need(np.abs(columns.T @ columns - np.eye(3)).max() < 1e-9 and np.linalg.det(columns) > 0,
                 f"{n['name']}: matrix is translation, rotation, scale")
        if "rotation" in n:
            need(abs(np.linalg.norm(n["rotation"]) - 1) < 1e-9, f"{n['name']}: unit quaternion")
        need(n.get("mesh", 0) < len(root.get("meshes", [])), f"{n['name']}: mesh")
        need(n.get("camera", -1) < len(root.get("cameras", [])), f"{n['name']}: camera")
    names = [n["name"] for n in root["nodes"]]
    need(len(set(names)) == len(names), "node names differ")


def check_file(path):
    root, data = load(path)
    need(root["asset"]["version"] == "2.0", "asset version 2.0")
    need(root["buffers"][0]["byteLength"] <= len(data), "buffer length")
    for i, view in enumerate(root["bufferViews"]):
        need(view.get("byteOffset", 0) + view["byteLength"] <= root["buffers"][0]["byteLength"],
             f"bufferView {i} ends inside the buffer")
    for mesh in root["meshes"]:
        for primitive in mesh["primitives"]:
            check_primitive(root, data, mesh["name"], primitive)
    check_nodes(root)
    for m in root["materials"]:
        for extension in m.get("extensions", {}):
            need(extension in root.get("extensionsUsed", []), f"{m['name']}: extensionsUsed")
        need(all(0 <= c <= 1 for c in m.get("emissiveFactor", [])), f"{m['name']}: emissiveFactor")
        need(all(0 <= c <= 1 for c in m.get("pbrMetallicRoughness", {}).get("baseColorFactor", [])),
             f"{m['name']}: baseColorFactor")
    for c in root.get("cameras", []):
        need(0 < c["perspective"]["yfov"] < np.pi and c["perspective"]["znear"] > 0, f"{c['name']}: lens")


def validator():
    """The environment in which node finds the Khronos validator, or None."""
    if not shutil.which("node"):
        return None
    places = [os.environ.get("GLTF_VALIDATOR"), os.environ.get("NODE_PATH")]
    env = dict(os.environ, NODE_PATH=":".join(p for p in places if p))
    found = subprocess.run(["node", "-e", "require.resolve('gltf-validator')"], env=env,
                           stderr=subprocess.DEVNULL)
    return env if found.returncode == 0 else None


def main():
    tap, env = Tap(), validator()
    for path in sys.argv[1:]:
        name = os.path.basename(path)
        if env:
            r = subprocess.run(["node", "-e", SCRIPT, path], env=env, capture_output=True, text=True)
            tap.ok(r.returncode == 0, f"{name}: Khronos validator", *(r.stdout + r.stderr).splitlines())
        else:
            tap.skip(f"{name}: Khronos validator", "gltf-validator is not installed")
        try:
            check_file(path)
            tap.ok(True, f"{name}: structure and geometry")
        except (Bad, KeyError, IndexError, ValueError) as problem:
            tap.ok(False, f"{name}: structure and geometry", repr(problem))
    sys.exit(tap.finish())


if __name__ == "__main__":
    main()
