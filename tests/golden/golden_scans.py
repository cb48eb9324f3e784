#!/usr/bin/env python3
"""golden_scans FOLDER: tiny models for golden packages, made by code: bumpy sheets with PNG textures. The same bytes
everywhere."""
import json
import math
import os
import struct
import sys
import zlib


def png(width, height, texel):
    """texel(x, y) gives 3 or 4 numbers."""
    rows, channels = bytearray(), len(texel(0, 0))
    for y in range(height):
        rows.append(0)
        for x in range(width):
            rows += bytes(max(0, min(255, round(v))) for v in texel(x, y))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    head = struct.pack(">IIBBBBB", width, height, 8, 2 if channels == 3 else 6, 0, 0, 0)
    # Stored, not compressed: the same bytes from every zlib.
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(bytes(rows), 0)) + chunk(b"IEND", b"")


def waves(seed, side):
    def texel(x, y):
        u, v = x / side * 2 * math.pi, y / side * 2 * math.pi
        return tuple(128 + 90 * math.sin((2 + k) * u + seed) * math.cos((1 + k) * v + k * seed) for k in range(3))
    return texel


def bumps(side):
    def texel(x, y):
        u, v = x / side * 4 * math.pi, y / side * 4 * math.pi
        n = (0.4 * math.cos(u), 0.4 * math.sin(v), 1.0)
        length = math.sqrt(sum(c * c for c in n))
        return tuple(127.5 + 127.5 * c / length for c in n)
    return texel


def with_holes(colour, side):
    def texel(x, y):
        return (*colour(x, y), 255 * (math.hypot(x - side / 2, y - side / 2) < side * 0.45))
    return texel


def sheet(n, seed, place):
    """Positions, texture coordinates and indices of a bumpy sheet of n * n quads with its corner at `place`."""
    points, uvs, indices = [], [], []
    for j in range(n + 1):
        for i in range(n + 1):
            x, y = i / n, j / n
            points.append((place[0] + x, place[1] + y, 0.3 * math.sin(3 * x + seed) * math.cos(2 * y + seed)))
            uvs.append((0.02 + 0.96 * x, 0.02 + 0.96 * y))
    for j in range(n):
        for i in range(n):
            a, b, c, d = (j * (n + 1) + i, j * (n + 1) + i + 1, (j + 1) * (n + 1) + i, (j + 1) * (n + 1) + i + 1)
            indices += [a, b, d, a, d, c]
    return points, uvs, indices


class Scan:
    """A GLB under way."""

    def __init__(self):
        self.data = bytearray()
        self.gltf = {"asset": {"version": "2.0", "copyright": "texmesh's tests"}, "scene": 0, "scenes": [{"nodes": []}],
                     "nodes": [], "meshes": [], "materials": [], "textures": [], "images": [], "accessors": [],
                     "bufferViews": [], "samplers": [{}]}

    def view(self, data):
        self.data += bytes(-len(self.data) % 4)
        self.gltf["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data
        return len(self.gltf["bufferViews"]) - 1

    def accessor(self, values, kind, code, bounds=False):
        flat = [x for v in values for x in (v if isinstance(v, tuple) else (v,))]
        view = self.view(struct.pack(f"<{len(flat)}{code}", *flat))
        accessor = {"bufferView": view, "componentType": 5126 if code == "f" else 5125, "count": len(values), "type": kind}
        if bounds:
            rounded = [struct.unpack("<3f", struct.pack("<3f", *v)) for v in values]
            accessor |= {"min": [min(c) for c in zip(*rounded)], "max": [max(c) for c in zip(*rounded)]}
        self.gltf["accessors"].append(accessor)
        return len(self.gltf["accessors"]) - 1

    def texture(self, image):
        self.gltf["images"].append({"bufferView": self.view(image), "mimeType": "image/png"})
        self.gltf["textures"].append({"source": len(self.gltf["images"]) - 1, "sampler": 0})
        return {"index": len(self.gltf["textures"]) - 1}

    def material(self, colours, **more):
        material = {"pbrMetallicRoughness": {"baseColorTexture": self.texture(colours), "metallicFactor": 0}, **more}
        self.gltf["materials"].append(material)
        return len(self.gltf["materials"]) - 1

    def part(self, name, material, quads, seed=0.0, place=(0, 0)):
        points, uvs, indices = sheet(quads, seed, place)
        primitive = {"attributes": {"POSITION": self.accessor(points, "VEC3", "f", True),
                                    "TEXCOORD_0": self.accessor(uvs, "VEC2", "f")},
                     "indices": self.accessor(indices, "SCALAR", "I"), "material": material}
        self.gltf["meshes"].append({"primitives": [primitive]})
        self.gltf["nodes"].append({"name": name, "mesh": len(self.gltf["meshes"]) - 1})
        self.gltf["scenes"][0]["nodes"].append(len(self.gltf["nodes"]) - 1)

    def glb(self):
        self.data += bytes(-len(self.data) % 4)
        text = json.dumps(self.gltf | {"buffers": [{"byteLength": len(self.data)}]}, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(self.data), 0x004E4942) + bytes(self.data)
        return struct.pack("<III", 0x46546C67, 2, 12 + len(body)) + body


def colours(side=64, seed=0.5):
    """One sheet with colours of PNG."""
    s = Scan()
    s.part("sheet", s.material(png(side, side, waves(seed, side))), 10)
    return s


def normals():
    s = Scan()
    s.part("sheet", s.material(png(64, 64, waves(0.5, 64)), normalTexture=s.texture(png(64, 64, bumps(64)))), 10)
    return s


def alpha():
    s = Scan()
    s.part("leaf", s.material(png(64, 64, with_holes(waves(0.5, 64), 64)), alphaMode="MASK", alphaCutoff=0.5), 10)
    return s


def nodes():
    s = Scan()
    for k, name in enumerate(("left", "middle", "right")):
        s.part(name, s.material(png(32, 32, waves(k, 32))), 6, k, (1.5 * k, 0))
    return s


def parts():
    """More parts than a GLB has nodes."""
    s = Scan()
    material = s.material(png(32, 32, waves(0.5, 32)))
    for k in range(260):
        s.part(f"part {k}", material, 1, k, (1.5 * (k % 20), 1.5 * (k // 20)))
    return s


def planes():
    s = Scan()
    for k in range(220):
        s.part(f"sheet {k}", s.material(png(16, 16, waves(k, 16))), 1, k, (1.5 * (k % 20), 1.5 * (k // 20)))
    return s


SCANS = {"colours": colours, "colours-256": lambda: colours(256), "normals": normals, "alpha": alpha, "nodes": nodes,
         "parts": parts, "planes": planes}


def main():
    os.makedirs(sys.argv[1], exist_ok=True)
    for name, make in SCANS.items():
        with open(os.path.join(sys.argv[1], name + ".glb"), "wb") as file:
            file.write(make().glb())


if __name__ == "__main__":
    main()
