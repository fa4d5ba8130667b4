#!/usr/bin/python3
"""Bad glTF files.

corrupt_gltf.py DIR          writes them, and DIR/expected: file, tab, a basic regular
                             expression that the refusal must match
corrupt_gltf.py --sweep MESH DIR
                             runs MESH on files with every property replaced, on
                             truncations and on random bytes: each must be read, or
                             refused with one line, exit status 1 and no output
"""
import base64
import copy
import json
import os
import random
import re
import struct
import subprocess
import sys

HEAD = "data:application/octet-stream;base64,"


def good():
    """A lit box with everything that is read, and its buffer."""
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    index = [i for a, b, c, d in faces for i in (a, b, c, a, c, d)]
    parts = [b"".join(struct.pack("<3f", *c) for c in corners),
             struct.pack("<36H", *index),
             b"".join(struct.pack("<3f", 0, 0, 1) for _ in corners),
             b"".join(struct.pack("<2H", 65535 * x, 65535 * y) for x, y, _ in corners),
             struct.pack("<2H", 3, 5),
             struct.pack("<6f", 0, 1, 1, 1, 0, 1)]
    views, data = [], b""
    for part in parts:
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(part)})
        data += part
    attributes = {"POSITION": 4, "NORMAL": 2, "TEXCOORD_0": 3}
    g = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_ior", "KHR_materials_emissive_strength",
                           "KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"name": "beam", "type": "spot", "color": [1, .5, .25], "intensity": 3,
             "spot": {"innerConeAngle": .1, "outerConeAngle": .5}}]}},
        "extensionsRequired": ["KHR_materials_ior"],
        "scene": 0,
        "scenes": [{"name": "all", "nodes": [0, 3]}],
        "nodes": [
            {"name": "group", "children": [1, 2], "translation": [0, 0, 1]},
            {"name": "box", "mesh": 0, "scale": [2, 3, 1], "rotation": [0, 0, 0, 1]},
            {"name": "lamp", "mesh": 1,
             "matrix": [.1, 0, 0, 0, 0, .1, 0, 0, 0, 0, .1, 0, .5, .5, .5, 1]},
            {"name": "eye", "camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 1, "material": 0,
                                    "mode": 4}]},
                   {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 1}]}],
        "materials": [
            {"name": "paint", "doubleSided": True, "alphaMode": "OPAQUE",
             "extras": {"twopass": {"rho_d": [.5, .4, .3], "rho_s": .2, "alpha": 10,
                                    "back": {"tau_s": .1, "beta": "inf"}}}},
            {"name": "lamp", "emissiveFactor": [1, 1, 1],
             "pbrMetallicRoughness": {"baseColorFactor": [.5, .5, .5, 1],
                                      "metallicFactor": 0, "roughnessFactor": .5},
             "extensions": {"KHR_materials_ior": {"ior": 1.5},
                            "KHR_materials_emissive_strength": {"emissiveStrength": 10}}}],
        "cameras": [{"type": "perspective",
                     "perspective": {"yfov": 1, "znear": .1, "aspectRatio": 1.5}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 3, "componentType": 5123, "normalized": True, "count": 8,
             "type": "VEC2"},
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3",
             "sparse": {"count": 2, "indices": {"bufferView": 4, "componentType": 5123},
                        "values": {"bufferView": 5}}}],
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    return g, bytearray(data)


def gltf(g, data):
    g = copy.deepcopy(g)
    if isinstance(g.get("buffers"), list) and g["buffers"] and isinstance(g["buffers"][0], dict):
        g["buffers"][0].setdefault("uri", HEAD + base64.b64encode(bytes(data)).decode())
    return json.dumps(g).encode()


def glb(g, data):
    text = json.dumps(g).encode()
    text += b" " * (-len(text) % 4)
    data = bytes(data) + bytes(-len(data) % 4)
    return (struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(data), len(text), 0x4E4F534A)
            + text + struct.pack("<II", len(data), 0x004E4942) + data)


# Statements on g (the JSON) and data (the buffer), and what must be said of the file.
WRONG = [
    ("g['asset']['version'] = '1.0'", "glTF 1.0 is not read"),
    ("del g['asset']", "asset: is missing"),
    ("g['extensionsRequired'] = ['KHR_draco_mesh_compression']", "KHR_draco_mesh_compression is"),
    ("g['extensionsRequired'] = ['EXT_texture_webp']", "EXT_texture_webp is not supported"),
    ("g['extensions']['KHR_lights_punctual']['lights'][0]['type'] = 7", "type: must be one of"),
    ("g['extensions']['KHR_lights_punctual']['lights'] = []", "light: index 0 is out of range"),
    ("g['scene'] = 4", "scene: index 4 is out of range"),
    ("g['scenes'][0]['nodes'] = [0, 99]", "index 99 is out of range"),
    ("g['scenes'][0]['nodes'] = [0, 1]", "nodes[1] is no root"),
    ("g['scenes'][0]['nodes'] = [0, 0]", "lists nodes[0] twice"),
    ("g['nodes'][1]['children'] = [0]", "is on or below a cycle"),
    ("g['nodes'][3]['children'] = [3]", "is on or below a cycle"),
    ("g['nodes'][3]['children'] = [1]", "nodes[1]: has two parents"),
    ("g['nodes'][0]['children'] = [1, -2]", "index -2 is out of range"),
    ("g['nodes'][1]['mesh'] = 2", "nodes[1].mesh: index 2 is out of range"),
    ("g['nodes'][1]['mesh'] = -1", "nodes[1].mesh: index -1 is out of range"),
    ("g['nodes'][3]['camera'] = 1", "nodes[3].camera: index 1 is out of range"),
    ("g['nodes'][2]['matrix'].pop()", "has 15 numbers, must have 16"),
    ("g['nodes'][2]['matrix'][15] = 2", "is not affine"),
    ("g['nodes'][2]['matrix'][0] = 0", "is singular"),
    ("g['nodes'][2]['scale'] = [1, 1, 1]", "has both matrix and"),
    ("g['nodes'][1]['scale'] = [0, 0, 0]", "is singular"),
    ("g['nodes'][1]['rotation'] = [1, 1, 1, 1]", "no unit quaternion"),
    ("g['nodes'][1]['scale'] = [1, 1, None]", "must be a number"),
    ("g['nodes'][0]['translation'] = [float('nan'), 0, 0]", "not valid JSON"),
    ("g['nodes'][0]['translation'] = [1e308, 0, 0]; g['nodes'][1]['translation'] = [1e308, 0, 0]",
     "world matrix is not finite"),
    ("data[0:4] = struct.pack('<f', float('nan'))", "POSITION 0 is not finite"),
    ("data[12:16] = struct.pack('<f', float('-inf'))", "POSITION 1 is not finite"),
    ("g['accessors'][1]['count'] = 37", "37 elements do not fit"),
    ("g['accessors'][0]['count'] = 2**50", "elements do not fit"),
    ("g['accessors'][0]['count'] = 2**60", "is above 9.0"),
    ("g['accessors'][0]['byteOffset'] = 4", "8 elements do not fit"),
    ("g['accessors'][0]['byteOffset'] = -4", "-4 is below 0"),
    ("g['accessors'][0]['byteOffset'] = 1", "no multiple of its component size"),
    ("g['accessors'][0]['componentType'] = 5124", "componentType 5124 is unknown"),
    ("g['accessors'][0]['type'] = 'VEC4'", "do not fit"),
    ("g['accessors'][4]['type'] = 'VEC2'", "POSITION in accessors[4] must be VEC3"),
    ("g['accessors'][0]['bufferView'] = 6", "bufferView: index 6 is out of range"),
    ("g['accessors'][1]['componentType'] = 5122", "must be SCALAR unsigned"),
    ("g['accessors'][1]['count'] = 35", "35 corners are no whole number"),
    ("data[96:98] = struct.pack('<H', 8)", "index 8 at position 0 of accessors[1]"),
    ("data[96:98] = struct.pack('<H', 65535)", "index 65535 at position 0"),
    ("g['accessors'][4]['sparse']['count'] = 9", "replaces 9 of 8"),
    ("g['accessors'][4]['sparse']['indices']['bufferView'] = 7", "index 7 is out of range"),
    ("data[296:300] = struct.pack('<2H', 5, 3)", "out of range or not ascending"),
    ("g['bufferViews'][0]['byteOffset'] = 10**6", "are outside buffers[0]"),
    ("g['bufferViews'][0]['byteLength'] = 2**52", "are outside buffers[0]"),
    ("g['bufferViews'][0]['buffer'] = 1", "buffer: index 1 is out of range"),
    ("g['bufferViews'][0]['byteStride'] = 5", "5 is no multiple of 4"),
    ("g['bufferViews'][0]['byteStride'] = 8", "byteStride 8 does not suit elements of 12"),
    ("g['bufferViews'][0]['byteStride'] = 16", "do not fit"),
    ("g['bufferViews'][1]['byteStride'] = 4; g['accessors'][1]['count'] = 18",
     "cannot have a byteStride"),
    ("g['buffers'][0]['byteLength'] += 1", "byteLength "),
    ("g['buffers'] = []", "index 0 is out of range, the file has 0 buffers"),
    ("g['buffers'][0]['uri'] = '../x.bin'", "leaves the directory"),
    ("g['buffers'][0]['uri'] = '%2E%2e/x.bin'", "leaves the directory"),
    ("g['buffers'][0]['uri'] = '/dev/zero'", "leaves the directory"),
    ("g['buffers'][0]['uri'] = 'file:///dev/zero'", "only relative and data: URIs"),
    ("g['buffers'][0]['uri'] = 'missing.bin'", "missing.bin: No such file"),
    ("g['buffers'][0]['uri'] = 'data:;base64,%%%%'", "is not base64"),
    ("g['buffers'][0]['uri'] = 'data:;base64,AAAA'", "has 3 bytes, byteLength says"),
    ("del g['meshes'][0]['primitives'][0]['attributes']['POSITION']", "has no POSITION"),
    ("g['meshes'][0]['primitives'][0]['mode'] = 9", "mode: 9 is above 6"),
    ("g['meshes'][0]['primitives'][0]['indices'] = 2", "must be SCALAR unsigned"),
    ("g['meshes'][0]['primitives'][0]['material'] = 2", "material: index 2 is out of range"),
    ("g['meshes'][0]['primitives'][0]['attributes']['NORMAL'] = 3", "NORMAL in accessors[3]"),
    ("g['meshes'][0]['primitives'] = {}", "must be an array of objects"),
    ("g['cameras'][0]['perspective']['yfov'] = 3.5", "is not between 0 and pi"),
    ("g['cameras'][0]['perspective']['yfov'] = -1", "-1 is below 0"),
    ("g['cameras'][0]['perspective']['aspectRatio'] = 0", "aspectRatio: must be above 0"),
    ("g['cameras'][0]['perspective']['znear'] = 0", "znear: must be above 0"),
    ("g['cameras'][0]['type'] = 'orthographic'", "orthographic: is missing"),
    ("g['materials'][0]['extras']['twopass']['rho_s'] = .7",
     "material paint: front side, band 0"),
    ("g['materials'][0]['extras']['twopass']['back']['rho_d'] = 1",
     "material paint: back side, band 0"),
    ("g['materials'][0]['extras']['twopass']['rho_d'] = [.1, .1, -.1]", "must not be negative"),
    ("g['materials'][0]['extras']['twopass']['rho_s'] = [.1, .1]", "has 2 numbers; give 1 or 3"),
    ("g['materials'][0]['extras']['twopass']['rho'] = .1", "unknown key 'rho'; a typo? allowed"),
    ("g['materials'][0]['extras']['twopass']['alpha'] = 'NaN'", "a number or \"inf\""),
    ("g['materials'][0]['extras']['twopass']['alpha'] = -1", "must not be negative"),
    ("g['materials'][0]['extras']['twopass']['rho_d'] = float('nan')", "not valid JSON"),
    ("g['materials'][1]['emissiveFactor'] = [1, 1, -1]", "-1 is below 0"),
    ("g['materials'][1]['extensions']['KHR_materials_ior']['ior'] = .5", "ior: 0.5 is neither"),
    ("g['nodes'][1]['name'] = 'two\\nlines'; g['nodes'][1]['scale'] = [0, 1, 1]", "is singular"),
    ("g['scenes'][0]['nodes'] = [3]", "geometry"),
]


def changed(statement):
    g, data = good()
    exec(statement, {"g": g, "data": data, "struct": struct})
    return g, data


def raw_files():
    """Whole files with what must be said of them."""
    g, data = good()
    binary, text = glb(g, data), gltf(g, data)
    size, = struct.unpack("<I", binary[12:16])
    chunk = 20 + size
    yield "empty.gltf", b"", "is empty"
    yield "text.gltf", b"This is text.\n", "is not glTF"
    yield "png.gltf", b"\x89PNG\r\n\x1a\n" + bytes(40), "is not glTF"
    yield "array.gltf", b"[]", "is not glTF"
    yield "deep.gltf", b'{"a":' + b"[" * 100000, "nested too deeply"
    yield "twice.gltf", text.replace(b'"POSITION": 0', b'"POSITION": 0, "POSITION": 0'), "duplicate"
    yield "utf8.gltf", text.replace(b'"box"', b'"b\xffx"'), "not valid JSON"
    yield "half.gltf", text[:len(text) // 2], "not valid JSON"
    for n in (4, 11, 12, 19, 20, 40, chunk, chunk + 4, chunk + 8, len(binary) - 8, len(binary) - 1):
        yield f"short{n}.glb", binary[:n], "GLB: truncated"
    yield "long.glb", binary + bytes(8), "8 bytes follow"

    def word(at, value):
        return binary[:at] + struct.pack("<I", value) + binary[at + 4:]

    yield "version.glb", word(4, 1), "version 1 is not read"
    yield "json-long.glb", word(12, 0xFFFFFFF0), "chunk 0: says"
    yield "json-type.glb", word(16, 0x004E4942), "first chunk is not JSON"
    yield "bin-long.glb", word(chunk, len(data) + 8), "chunk 1: says"
    yield "bin-odd.glb", word(chunk, len(data) - 1), "no multiple of 4"
    yield "bin-type.glb", word(chunk + 4, 7), "no BIN chunk"
    alias = copy.deepcopy(g)
    alias["buffers"].append({"byteLength": 4})
    yield "alias.glb", glb(alias, data), "buffers[1]: has no uri"
    short = copy.deepcopy(g)
    short["buffers"][0]["byteLength"] += 100
    yield "bin-short.glb", glb(short, data), "the BIN chunk has"


def pattern(text):
    """A basic regular expression that matches just this text."""
    return re.sub(r"([\[\].*^$\\])", r"\\\1", text)


def write(directory):
    with open(os.path.join(directory, "expected"), "w") as table:
        def put(name, content, message):
            with open(os.path.join(directory, name), "wb") as f:
                f.write(content)
            table.write(f"{name}\t{pattern(message)}\n")

        for i, (statement, message) in enumerate(WRONG):
            g, data = changed(statement)
            put(f"wrong{i:02}.gltf", gltf(g, data), message)
            if "buffers" not in statement and "nan" not in statement:
                put(f"wrong{i:02}.glb", glb(g, data), message)
        for name, content, message in raw_files():
            put(name, content, message)


def places(node, path=()):
    if path:
        yield path
    for key in (node if isinstance(node, dict) else
                range(len(node)) if isinstance(node, list) else ()):
        yield from places(node[key], path + (key,))


def sweep_files():
    g, data = good()
    for path in places(g):
        for value in (None, -1, 2**31, .5, 1e300, "x", [], {}, [[]], [{}], True):
            other = copy.deepcopy(g)
            at = other
            for key in path[:-1]:
                at = at[key]
            at[path[-1]] = value
            yield f"{path} = {value}", ".gltf", gltf(other, data)
    whole, text = glb(g, data), gltf(g, data)
    generator = random.Random(1)
    for round in range(300):
        kind, good_bytes = ((".glb", whole), (".gltf", text))[round % 2]
        bad = bytearray(good_bytes)
        for _ in range(generator.randint(1, 4)):
            bad[generator.randrange(len(bad))] ^= 1 << generator.randrange(8)
        yield f"flipped bits {round}", kind, bytes(bad)
    for n in range(1, len(whole), 61):
        yield f"{n} bytes", ".glb", whole[:n]


def sweep(mesh, directory):
    count = bad = 0
    for what, kind, content in sweep_files():
        path, out = (os.path.join(directory, n) for n in ("swept" + kind, "swept.mesh"))
        for old in (path, out):
            if os.path.exists(old):
                os.remove(old)
        with open(path, "wb") as f:
            f.write(content)
        run = subprocess.run([mesh, path, "-o", out, "-p", "inf", "-e", "inf", "-q"],
                             stdin=subprocess.DEVNULL, capture_output=True)
        said = run.stderr.decode(errors="replace")
        fine = (run.returncode == 0 and os.path.exists(out) or
                run.returncode == 1 and said.count("\n") == 1 and not os.path.exists(out))
        count += 1
        if not fine:
            bad += 1
            print(f"{what}: status {run.returncode}: {said[:300]}")
    print(f"{count} files, {bad} went wrong")
    return bad > 0


if __name__ == "__main__":
    if len(sys.argv) == 4 and sys.argv[1] == "--sweep":
        sys.exit(sweep(*sys.argv[2:]))
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    write(sys.argv[1])
