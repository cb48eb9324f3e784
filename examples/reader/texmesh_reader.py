#!/usr/bin/env python3
"""Reads texmesh packages of format 2, written from format/SPEC.md alone; rule names are those of that text.

  texmesh_reader.py info PACKAGE                 what the package holds
  texmesh_reader.py picture PACKAGE --plane P [--rung R] -o OUT.png
  texmesh_reader.py mesh PACKAGE [--scale N] [--raw] -o OUT.obj
  texmesh_reader.py verify PACKAGE...            every rule that conformance.py knows how to check

PACKAGE is a container or the folder of a tree. Needs numpy and Pillow (Debian: python3-numpy python3-pil).
"""
import argparse
import hashlib
import io
import json
import os
import re
import struct
import sys

import numpy as np
from PIL import Image

MAX32 = 0xFFFFFFFF
CREDENTIAL = "META-INF/content_credential.c2pa"


class Refused(Exception):
    """A rule that the package breaks."""


def require(good, rule, what):
    if not good:
        raise Refused(f"{rule}: {what}")


def sha(data):
    return hashlib.sha256(data).hexdigest()


def rises(values):
    return all(a < b for a, b in zip(values, values[1:]))


class Cursor:
    """Little-endian numbers, one after the other; what is missing breaks `rule`."""

    def __init__(self, data, rule, what):
        self.data, self.at, self.rule, self.what = data, 0, rule, what

    def raw(self, count):
        require(count <= len(self.data) - self.at, self.rule, f"{self.what} ends early")
        self.at += count
        return self.data[self.at - count : self.at]

    def get(self, code):
        values = struct.unpack("<" + code, self.raw(struct.calcsize("<" + code)))
        return values[0] if len(values) == 1 else values

    def array(self, dtype, count):
        return np.frombuffer(self.raw(np.dtype(dtype).itemsize * count), dtype)

    def whole(self, width, count):
        """`count` numbers of `width` bytes."""
        digits = self.array("u1", width * count).reshape(count, width).astype(np.uint64)
        return (digits << (8 * np.arange(width, dtype=np.uint64))).sum(axis=1, dtype=np.uint64).astype(np.int64)

    def varint(self):
        value = shift = 0
        while True:
            byte = self.get("B")
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                require(value <= MAX32 and (byte or shift == 7), "S06", "a varint in its shortest form")
                return value
            require(shift < 35, "S06", "a varint below 2^32")

    def finish(self):
        require(self.at == len(self.data), self.rule, f"{self.what} has further bytes")


# Sections 2 and 4: bytes and documents ----------------------------------------------------------------


def is_path(path):
    plain = len(path) <= 200 and re.fullmatch(r"[a-z0-9._/-]+", path) is not None
    return path == CREDENTIAL or (plain and all(p not in ("", ".", "..") for p in path.split("/")))


class Package:
    """Bytes of a container by their offset, of a tree by their path."""

    def __init__(self, name):
        self.name, self.is_tree = name, os.path.isdir(name)
        self.file = None if self.is_tree else open(name, "rb")

    def manifest(self):
        if self.is_tree:
            with open(os.path.join(self.name, "manifest.json"), "rb") as file:
                head = file.read(16385)
            require(len(head) <= 16384, "K12", "a manifest of more than 16,384 bytes")
            return head
        head = self.file.read(16384)
        require(head[:4] == b"PK\3\4" and head[30:43] == b"manifest.json", "K11", "no package")
        end = 64 + struct.unpack("<I", head[22:26])[0]
        require(end <= len(head), "K12", "the manifest ends beyond 16,384 bytes")
        return head[64:end]

    def read(self, path, offset, size):
        if self.is_tree:
            full, root = os.path.realpath(os.path.join(self.name, path)), os.path.realpath(self.name)
            require(full.startswith(root + os.sep) and os.path.isfile(full), "E01", f"no file {path} in the tree")
            with open(full, "rb") as file:
                data = file.read(size + 1)
        else:
            self.file.seek(offset)
            data = self.file.read(size)
        require(len(data) == size, "I08", f"{path} has not {size} bytes")
        return data


def parse_json(data, most, what):
    require(len(data) <= most, "L09", f"{what}: more than {most} bytes")
    try:
        document = json.loads(data.decode("utf-8"))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise Refused(f"J01: {what}: {error}") from error
    require(isinstance(document, dict), "J01", f"{what}: not an object")
    return document


# Sections 6 to 8: index and tables --------------------------------------------------------------------


def read_head(data, magic, m, letter):
    head = Cursor(data, letter + "03" if letter == "I" else letter + "02", magic.decode())
    require(head.raw(4) == magic, letter + "01", "magic")
    version = head.get("HH")
    require(version[0] == 2, "W03", f"{magic.decode()}: version {version[0]}")
    require(version == (m["version"]["major"], m["version"]["minor"]), "R01", f"{magic.decode()}: version {version}")
    return head


def check_head(head, ref, what):
    require(head.at == ref["headBytes"], "R02", f"headBytes of {what}")
    require(sha(head.data[: head.at]) == ref["headSha256"], "R02", f"headSha256 of {what}")


def plane_of(path):
    found = re.fullmatch(r"texture/(0|[1-9]\d*)/(tables|r\d\d|r[1-9]\d\d+)\.pack", path)
    return int(found[1]) if found else MAX32


def read_index(data, m):
    """{path: (offset, bytes, digest)}"""
    head = read_head(data, b"TXMX", m, "I")
    count, total = head.get("II")
    require(1 <= count <= (len(data) - 16) // 44, "I03", "number of pages")
    pages = [(*head.get("III"), head.raw(32)) for _ in range(count)]
    check_head(head, m["index"], "the index")
    planes = [page[0] for page in pages]
    require(planes[0] == MAX32 and rises(planes[1:]) and MAX32 not in planes[1:], "I02", "planes of pages")
    require(sum(page[1] for page in pages) == total, "I03", "number of entries")
    index = {}
    for plane, entries, size, digest in pages:
        body = head.raw(size)
        require(hashlib.sha256(body).digest() == digest, "I04", f"digest of the page of plane {plane}")
        page, end = Cursor(body, "I04", f"the page of plane {plane}"), 0
        for _ in range(entries):
            offset, length = page.get("QQ")
            digest = page.raw(32).hex()
            path = page.raw(page.get("B")).decode("latin-1")
            require(offset % 64 == 0 and 0 < offset <= 2**53 >= length, "I05", f"place of {path}")
            require(is_path(path) and plane_of(path) == plane, "I06", f"{path} on the page of plane {plane}")
            require(path not in ("manifest.json", "index.bin", CREDENTIAL), "I06", path)
            require(path not in index and offset > end, "I07", f"order of {path}")
            end, index[path] = offset + length, (offset, length, digest)
        if m["version"]["minor"] == 0:
            page.finish()
    head.finish()
    places = sorted(index.values())
    require(all(a[0] + a[1] < b[0] for a, b in zip(places, places[1:])), "I07", "entries overlap")
    return index


def read_tables(data, m, textures):
    """Per plane a dict of arrays, as section 8 names them."""
    head = read_head(data, b"TXMT", m, "T")
    count, zero = head.get("II")
    require(zero == 0 or m["version"]["minor"], "T01", "reserved bytes of the head")
    require(count == m["planeCount"], "R04", "number of planes in tables.bin")
    sections = [(head.get("I"), head.raw(32)) for _ in range(count)]
    check_head(head, m["tables"], "the tables")
    planes = []
    for p, (size, digest) in enumerate(sections):
        body = head.raw(size)
        require(hashlib.sha256(body).digest() == digest, "T02", f"digest of section {p}")
        planes.append(read_section(Cursor(body, "T03", f"section {p}"), textures[p], m))
    head.finish()
    return planes


def read_section(c, texture, m):
    columns, rows, n, r, ws, wf, allocation, flags, k, zero = c.get("IIBBBBBBBB")
    is_new = m["version"]["minor"] > 0
    require((columns, rows) == (texture["columns"], texture["rows"]), "R08", "grid")
    require(n == len(m["scales"]["scale"]), "R11", f"{n} rows")
    require(1 <= r <= 100 and 1 <= ws <= 4 and 1 <= wf <= 3, "T03", "counts and widths")
    require(allocation <= 3, "T13", f"allocation {allocation}")
    require(is_new or (flags <= 1 and zero == 0), "W05", "reserved bits")
    require((flags & 1) == (texture["codec"] == "jpeg-progressive"), "R10", "incremental")
    t = {"incremental": flags & 1, "widths": (ws, wf), "parameters": c.array("<f4", 4)}
    listed = c.get("I")
    require(listed <= columns * rows, "T03", f"{listed} listed fragments")
    rest = 2 * listed + r * 5 + k * 3 + r * listed * (ws + 12) + listed * 10 + n * listed * wf + n * 4
    rest += 2 * listed * (allocation == 3)
    require(len(c.data) >= c.at + rest and (is_new or len(c.data) == c.at + rest), "T03", f"{len(c.data)} bytes")
    t |= {"order": c.array("<u2", listed), "quality": c.array("u1", r), "tables": c.array("<u4", r),
          "knots": c.array("u1", k), "positions": c.array("<u2", k),
          "size": c.whole(ws, r * listed).reshape(r, listed),
          "digest": c.array("u1", r * listed * 8).reshape(r, listed, 8),
          "mse": c.array("<u2", r * listed), "dssim": c.array("<u2", r * listed), "preview": c.array("<u2", listed),
          "covered": c.array("<u4", listed), "surface": c.array("<f4", listed),
          "features": c.whole(wf, n * listed).reshape(n, listed), "middle": c.array("<f4", n),
          "vqp": c.array("<u2", listed if allocation == 3 else 0)}
    require(listed == len(set(t["order"].tolist())) and (t["order"] < columns * rows).all(), "T05", "order")
    require((t["size"] > 0).all(), "T06", "a size of 0")
    return t


# Section 9: fragments and pictures --------------------------------------------------------------------


def cut(data, sizes):
    ends = np.cumsum(sizes.astype(np.int64)).tolist()
    return [data[end - size : end] for end, size in zip(ends, sizes.tolist())]


def decode_image(data, width, height, channels, rule, what):
    try:
        image = Image.open(io.BytesIO(data), formats=("JPEG", "WEBP"))
        require(image.size == (width, height), rule, f"{what}: {image.size}")
        require(image.mode == ("L" if channels == 1 else "RGB"), rule, f"{what}: {image.mode}")
        image.load()
        return image
    except (OSError, SyntaxError, ValueError) as error:
        raise Refused(f"{rule}: {what}: {error}") from error


class Model:
    """A package with its documents. conformance.py fills in what the methods named check_... look for."""

    def __init__(self, name):
        self.package = self.open(name)
        data = self.package.manifest()
        self.id, self.manifest = sha(data), self.parse(data, 16384, "manifest.json")
        m = self.manifest
        require(m.get("format") == "texmesh", "M01", "format")
        major = m["version"]["major"]
        require(major == 2, "W03", f"format {major} is not known; a model of format 1 has to be compiled again")
        self.check_manifest()
        ref = m["index"]
        data = self.package.read("index.bin", ref["offset"], ref["bytes"])
        require(sha(data) == ref["sha256"], "R03", "digest of index.bin")
        self.index = read_index(data, m)
        self.check_index()
        self.textures = self.parse(self.entry("textures.json"), 32 << 20, "textures.json")["textures"]
        require(len(self.textures) == m["planeCount"], "R04", "number of planes in textures.json")
        self.check_textures()
        self.tables = read_tables(self.entry("tables.bin"), m, self.textures)

    def open(self, name):
        return Package(name)

    def parse(self, data, most, what):
        return parse_json(data, most, what)

    def check_manifest(self):
        unknown = set(self.manifest["requiredFeatures"]) - {"codec-jpeg-progressive", "codec-webp"}
        require(not unknown, "M02", f"unknown features {unknown}")

    def check_index(self):
        pass

    def check_textures(self):
        pass

    def entry(self, path):
        """An entry, whose digest is that of the index."""
        require(path in self.index, "R07" if path.startswith(("texture/", "preview/")) else "E01", f"no entry {path}")
        offset, size, digest = self.index[path]
        data = self.package.read(path, offset, size)
        require(sha(data) == digest, "I08", f"digest of {path}")
        return data

    def pack(self, plane, name, rule, sizes):
        data = self.entry(f"texture/{plane}/{name}.pack")
        require(len(data) == int(sizes.sum(dtype=np.int64)), rule, f"{name}.pack of plane {plane} has {len(data)} bytes")
        return cut(data, sizes)

    def table_streams(self, plane):
        return self.pack(plane, "tables", "R12", self.tables[plane]["tables"])

    def files(self, plane, rung):
        """(fragment, complete file) of every listed fragment; digests are checked."""
        t, codec, heads, streams = self.tables[plane], self.textures[plane]["codec"], self.table_streams(plane), []
        for r in range(rung + 1) if t["incremental"] else [rung]:
            streams.append(self.pack(plane, f"r{r:02}", "R13", t["size"][r]))
            for k, stream in enumerate(streams[-1]):
                good = hashlib.sha256(stream).digest()[:8] == t["digest"][r, k].tobytes()
                require(good, "F03", f"digest of fragment {t['order'][k]} at rung {r} of plane {plane}")
        for k, fragment in enumerate(t["order"].tolist()):
            parts, head = [s[k] for s in streams], heads[0 if t["incremental"] else rung]
            is_table = head[:2] == b"\xff\xd8" and head[-2:] == b"\xff\xd9"
            if codec == "jpeg":
                good = is_table and parts[0][:2] == b"\xff\xd8" and parts[0][-2:] == b"\xff\xd9"
                require(good, "F05", f"fragment {fragment}: no SOI or EOI")
                yield fragment, head[:-2] + parts[0][2:]
            elif codec == "jpeg-progressive":
                require(is_table and parts[-1][-1:] != b"\xff", "F06", "no SOI, or a stream that ends with FF")
                yield fragment, head[:-2] + b"".join(parts) + b"\xff\xd9"
            else:
                require(parts[0][:4] == b"RIFF" and parts[0][8:12] == b"WEBP", "F07", f"fragment {fragment}: no WebP")
                yield fragment, parts[0]

    def preview(self, plane):
        t = self.textures[plane]
        data = self.entry(f"preview/{t.get('base', plane):03}.jpg")
        return decode_image(data, t["previewWidthPx"], t["previewHeightPx"], t["channels"], "F16", "preview")

    def fragments(self, plane, rung):
        t = self.textures[plane]
        for fragment, file in self.files(plane, rung):
            what = f"fragment {fragment} at rung {rung} of plane {plane}"
            yield fragment, decode_image(file, t["fragmentWidthPx"], t["fragmentHeightPx"], t["channels"], "F08", what)

    def picture(self, plane, rung):
        """The plane at a rung; the preview where nothing is listed."""
        t = self.textures[plane]
        whole = self.preview(plane).resize((t["widthPx"], t["heightPx"]), Image.BILINEAR)
        for fragment, image in self.fragments(plane, rung):
            row, column = divmod(fragment, t["columns"])
            whole.paste(image, (column * t["fragmentWidthPx"], row * t["fragmentHeightPx"]))
        return whole

    def stream(self):
        require("stream" in self.manifest, "E01", "no split stream in this package")
        data, ref = self.entry("mesh/stream.bin"), self.manifest["stream"]
        head = read_stream_head(data)
        require(head["bytes"] == ref["headBytes"], "S08", "headBytes of the stream")
        require(sha(data[: head["bytes"]]) == ref["headSha256"], "R02", "headSha256 of the stream")
        return Splits(head), data


# Section 11: the stream of vertex splits; names are those of that text, written small -----------------

COMPONENTS = (2, 2, 2, 4)  # of the attribute kinds


def read_stream_head(data):
    c = Cursor(data, "S08", "the head of the stream")
    require(c.raw(4) == b"TXMS", "S01", "magic")
    major, _, bits, attributes, scales, zero = c.get("HHBBBB")
    require(major == 2, "S01", f"version {major} of the stream")
    require(zero == 0, "S02", "a reserved byte")
    groups, blocks = c.get("II")
    require(1 <= bits <= 24, "S03", f"{bits} bits")
    require(1 <= groups <= 65536 and 1 <= scales <= 100, "S05", "number of groups or scales")
    head = {"bits": bits, "grid": read_grid(c, 3), "attributes": [], "blocks": []}
    for _ in range(attributes):
        kind, bits, zero = c.get("BBH")
        require(kind <= 3 and all(a["kind"] < kind for a in head["attributes"]), "S03", f"attribute kind {kind}")
        require((2 if kind == 2 else 1) <= bits <= 24, "S03", f"{bits} bits of kind {kind}")
        require(zero == 0, "S02", "reserved bytes")
        head["attributes"].append({"kind": kind, "bits": bits, "grid": read_grid(c, 2) if kind < 2 else None})
    head["groups"] = [tuple(c.get("HH")) for _ in range(groups)]
    head["scales"] = read_scales(c, scales, blocks)
    head["models"] = [list(c.raw(117)) for _ in range(attributes + 1)]
    require(blocks <= len(data) // (attributes + 11), "S08", f"{blocks} blocks")
    for _ in range(blocks):
        code, parts = c.varint(), [c.varint() for _ in range(attributes + 2)]
        block = {"patch": code & 1, "count": code >> 1, "parts": parts, "digest": c.raw(8)}
        require(block["count"] >= 1 and (block["patch"] or block["count"] <= 4096), "S07", "count of a block")
        require(sum(parts) >= block["count"] // 64, "S07", "too few bytes for the count of a block")
        head["blocks"].append(block)
    head["bytes"] = c.at
    return head


def read_grid(c, axes):
    values = c.array("<f4", axes + 1)
    require(np.isfinite(values).all() and values[-1] > 0, "S04", "a grid")
    return values


def read_scales(c, count, blocks):
    scales, number, sums = [], 256, [0, 0, 0, 0]
    for _ in range(count):
        scale, before = c.get("B"), sums
        sums = [a + c.varint() for a in sums]
        hidden = c.varint()
        require(scale < number and max(sums) <= MAX32, "S05", f"scale {scale}")
        require(before[0] < sums[0] <= blocks, "S05", "blocks of a scale")
        require(sums[2] >= sums[1] and sums[3] >= max(1, hidden), "S05", "counts of a scale")
        number = scale
        scales.append(dict(zip(("scale", "blocks", "points", "wedges", "faces", "hidden"), (scale, *sums, hidden))))
    require(number == 0 and sums[0] == blocks, "S05", "the last scale")
    return scales


class Bits:
    """11.3: binary decisions."""

    def __init__(self, data):
        self.data, self.at = data, 4
        self.code, self.range = int.from_bytes((data[:4] + bytes(4))[:4], "big"), MAX32

    def decide(self, odds):
        bound = (self.range >> 12) * odds
        bit = 1 if self.code < bound else 0
        self.code, self.range = (self.code, bound) if bit else (self.code - bound, self.range - bound)
        while self.range < 1 << 24:
            byte = self.data[self.at] if self.at < len(self.data) else 0
            self.at, self.range, self.code = self.at + 1, self.range << 8, (self.code << 8 | byte) & MAX32
        return bit

    def bit(self, model, limit):
        p, n = model
        bit, w = self.decide(min(max(p >> 4, 1), 4095)), 65535 // (n + 2)
        model[:] = p + ((65535 - p) * w >> 16) if bit else p - (p * w >> 16), min(n + 1, limit)
        return bit

    def raw(self, count):
        value = 0
        for _ in range(count):
            value = 2 * value + self.decide(2048)
        return value


class Part:
    """11.4: the values of one part of a block."""

    def __init__(self, data, start):
        self.bits = Bits(data[1:]) if data else None
        self.models, self.mean = [[256 * s, 24] for s in start], [2 * data[0]] * 4 if data else None

    def residual(self, c):
        if not self.bits:
            return 0
        mean, bit = self.mean[c], self.bits.bit
        quarter, middle = 20 * (mean >> 2 & 3), mean >> 4

        def longer(length):
            return bit(self.models[quarter + clamp(length - middle + 10, 0, 19)], 60)

        at = clamp(middle - 2, 0, 25)
        if longer(at):
            at += 1
            while at < 26 and longer(at):
                at += 1
        else:
            while at > 0 and not longer(at - 1):
                at -= 1
        self.mean[c] = mean + (16 * at - mean >> 3)
        if at == 0:
            return 0
        left, v, k = at - 1, 1, min(at, 11)
        if left > 0:
            v, left = 2 * v + bit(self.models[80 + k], 60), left - 1
        if left > 0:
            v, left = 2 * v + bit(self.models[92 + 2 * k + (v & 1)], 60), left - 1
        if left > 0:
            v = (v << left) + self.bits.raw(left)
        return -v if self.bits.raw(1) else v

    def same(self):
        return self.bits and self.bits.bit(self.models[116], 60)

    def value(self, guess, count, bits):
        most = (1 << bits) - 1
        return [(clamp(guess[c], 0, most) + self.residual(c)) & most for c in range(count)]


def models(*shape):
    return [models(*shape[1:]) for _ in range(shape[0])] if shape else [32768, 0]


def clamp(x, low, high):
    return min(max(x, low), high)


class Corner:
    __slots__ = ("face", "corner", "a", "b", "wedge", "moves", "target")

    def __init__(self, face, corner, a, b, wedge):
        self.face, self.corner, self.a, self.b, self.wedge, self.moves = face, corner, a, b, wedge, False


class Splits:
    """The decoder: points, wedges, faces of the mesh so far."""

    def __init__(self, head):
        self.head, self.most = head, head["scales"][-1]
        self.places, self.corners_of, self.wedge_point, self.values, self.pending = [], [], [], [], []
        self.faces, self.face_group, self.fresh, self.corners, self.fans = [], [], [], [], []
        self.last, self.steps, self.child, self.parent = 0, 0, None, None
        shapes = {"ask": (14, 4, 2, 2), "first": (12, 2), "turn": (2, 2, 12, 5), "turn_back": (2, 2, 7, 8, 5),
                  "turn_again": (2, 2), "target_expected": (2,), "target_copied": (2,), "listed": (),
                  "more_faces": (4, 2), "flipped": (), "extra_face": (), "same_group": (), "beside_moving": (3,),
                  "corner_expected": (3, 2), "seed_exists": (), "gate_open": (8, 8), "third_new": (8, 8),
                  "third_left": (8, 8), "third_right": (), "patch_expected": (4,)}
        self.m = {name: models(*shape) for name, shape in shapes.items()}

    # 11.3, 11.5

    def bit(self, model):
        return self.connectivity.bit(model, 200)

    def index(self, count):
        v = self.connectivity.raw((count - 1).bit_length())
        require(v < count, "S19", f"number {v} of {count}")
        return v

    def step(self, count):
        self.steps += count
        require(self.steps <= (1 << 20) + 256 * (len(self.places) + len(self.faces)), "S20", "too many steps")

    def new_point(self):
        require(len(self.places) < self.most["points"], "S19", "too many points")
        self.places.append([0, 0, 0])
        self.corners_of.append([])
        return len(self.places) - 1

    def new_wedge(self, point, pending=True):
        require(len(self.wedge_point) < self.most["wedges"], "S19", "too many wedges")
        self.wedge_point.append(point)
        self.values.append([[0] * COMPONENTS[a["kind"]] for a in self.head["attributes"]])
        self.pending.append(pending)
        self.fresh += [len(self.wedge_point) - 1] if pending else []
        return len(self.wedge_point) - 1

    def new_face(self, wedges, group):
        require(len(self.faces) < self.most["faces"], "S19", "too many faces")
        self.faces.append(list(wedges))
        self.face_group.append(group)
        for c, w in enumerate(wedges):
            self.corners_of[self.wedge_point[w]].insert(0, (len(self.faces) - 1, c))
        return len(self.faces) - 1

    def w(self, face, corner):
        return self.faces[face][corner % 3]

    def p(self, face, corner):
        return self.wedge_point[self.faces[face][corner % 3]]

    def gather(self, v):
        self.step(len(self.corners_of[v]))
        loose = [Corner(f, c, self.p(f, c + 1), self.p(f, c + 2), self.w(f, c)) for f, c in self.corners_of[v]]
        by_a, ends, taken = {}, {x.b for x in loose}, set()
        for x in reversed(loose):
            by_a.setdefault(x.a, []).append(x)  # popped from the back: in order of the list
        self.corners, self.fans = [], []
        for x in [x for x in loose if x.a not in ends] + loose:
            begin = len(self.corners)
            while x and x not in taken:
                taken.add(x)
                self.corners.append(x)
                follow = by_a.get(x.b, [])
                while follow and follow[-1] in taken:
                    follow.pop()
                x = follow[-1] if follow else None
            fan = self.corners[begin:]
            self.fans += [(fan, fan[0].a == fan[-1].b)] if fan else []

    # 11.6

    def decode(self, stream, scale):
        """Blocks up to a scale."""
        require(any(end["scale"] == scale for end in self.scale_ends(stream)), "S21", f"no scale {scale} in the stream")

    def scale_ends(self, stream):
        """Decodes scale after scale: what each has, and the bytes up to its end."""
        at, done = self.head["bytes"], 0
        for s in self.head["scales"]:
            self.queue, self.queued, self.next = [], set(), 0
            self.refusals, self.has_split, self.progress = {}, {}, 1
            for block in self.head["blocks"][done : s["blocks"]]:
                data = stream[at : at + sum(block["parts"])]
                require(len(data) == sum(block["parts"]), "S08", "a block ends early")
                require(hashlib.sha256(data).digest()[:8] == block["digest"], "S09", "digest of a block")
                at += len(data)
                self.decode_block(block, data)
            done = s["blocks"]
            found = len(self.places), len(self.wedge_point), len(self.faces), len(self.faces) - len(self.triangles())
            expected = s["points"], s["wedges"], s["faces"], s["hidden"]
            require(found == expected, "S19", f"scale {s['scale']}: {found} instead of {expected}")
            yield {**s, "triangles": s["faces"] - s["hidden"], "bytes": at}

    def decode_block(self, block, data):
        first, *parts = cut(data, np.array(block["parts"]))
        self.connectivity, left = Bits(first), block["count"]
        self.parts = [Part(part, start) for part, start in zip(parts, self.head["models"])]
        if block["patch"]:
            self.gates, end = [], len(self.faces) + left
            while len(self.faces) < end:
                self.at_gate(*self.gates.pop()) if self.gates else self.seed()
            return
        while left:
            v = self.ask()
            self.step(1)
            asked = self.m["ask"][min(len(self.corners_of[v]), 13)][self.refusals.get(v, 0)][self.has_split.get(v, 0)]
            self.last = self.bit(asked[self.last])
            if not self.last:
                self.refusals[v] = min(self.refusals.get(v, 0) + 1, 3)
                continue
            self.refusals[v], self.has_split[v], self.progress, left = 0, 1, 1, left - 1
            u = self.split(v)
            for point in (v, u, *(end for x in self.corners for end in (x.a, x.b))):
                if point not in self.queued:
                    self.queued.add(point)
                    self.queue.append(point)

    def ask(self):
        if self.next == len(self.queue):
            require(self.progress and self.places, "S19", "no point splits")
            self.progress, self.next, self.queue = 0, 0, list(range(len(self.places)))
            self.queued = set(self.queue)
        self.next += 1
        self.queued.discard(self.queue[self.next - 1])
        return self.queue[self.next - 1]

    # 11.7

    def split(self, v):
        self.gather(v)
        u = self.new_point()
        self.parent, self.child, self.targets, self.fresh, self.mapped = v, u, [], [], {}
        for k, (fan, closed) in enumerate(self.fans):
            self.moves(fan, 0 if closed else 1, min(k, 1))
        for x in self.corners:
            if x.moves:
                self.target(x)
        self.corners_of[v], self.corners_of[u] = [], []
        for x in self.corners:
            if x.moves:
                self.faces[x.face][x.corner] = x.target
            self.corners_of[u if x.moves else v].append((x.face, x.corner))
        for fan, closed in self.fans:
            ring = ([fan[-1]] if closed else [None]) + fan + ([] if closed else [None])
            for last, following in zip(ring, ring[1:]):
                self.edge(last, following)
        while self.bit(self.m["extra_face"]):
            x = self.index(len(self.places))
            require(x not in (v, u), "S22", "a face with a point twice")
            self.finish(x, self.connectivity.raw(1) == 1, None, None, None, 1, None)
        near = [self.places[self.p(f, c + k)] for f, c in self.corners_of[u] for k in (1, 2)]
        self.places[u] = self.parts[0].value(mean(near) if near else self.places[v], 3, self.head["bits"])
        self.fresh_wedges()
        self.parent = self.child = None
        return u

    def moves(self, fan, is_open, later):
        side, turns, run, n = 0, 0, 0, len(fan)
        for i, x in enumerate(fan):
            turn, valence = 0, clamp(len(self.corners_of[x.a]), 4, 8) - 4
            if i == 0:
                side = self.bit(self.m["first"][min(n, 11)][later])
            elif turns == 0:
                turn = self.bit(self.m["turn"][is_open][side][min(n - i, 11)][valence])
            elif turns == 1:
                turn = self.bit(self.m["turn_back"][is_open][side][min(run, 7) - 1][clamp(n, 3, 10) - 3][valence])
            else:
                turn = self.bit(self.m["turn_again"][is_open][side])
            if turn:
                side, turns, run = 1 - side, turns + 1, 0
            run += 1
            x.moves = side == 1

    def target(self, x):
        known = 1 if x.wedge in self.mapped else 0
        as_expected, x.target = self.bit(self.m["target_expected"][known]), None
        if as_expected and known:
            x.target = self.mapped[x.wedge]
        elif not as_expected:
            offered = (w for w in self.targets if not known or w != self.mapped[x.wedge])
            x.target = next((w for w in offered if self.bit(self.m["listed"])), None)
        if x.target is None:
            lost = 0 if any(not y.moves and y.wedge == x.wedge for y in self.corners) else 1
            copied = self.bit(self.m["target_copied"][lost])
            x.target = self.new_wedge(self.child, not copied)
            if copied:
                self.values[x.target] = [list(value) for value in self.values[x.wedge]]
            self.targets.append(x.target)
        self.mapped.setdefault(x.wedge, x.target)

    def edge(self, last, following):
        one, made = following or last, 0
        x = following.a if following else last.b
        kind = (1 if last.moves != following.moves else 0) if last and following else 3 if one.moves else 2
        while self.bit(self.m["more_faces"][kind][min(made, 1)]):
            self.step(1)
            self.face(x, last, following)
            made += 1

    def face(self, x, last, following):
        usual = following.moves if following else not last.moves
        forward = (self.bit(self.m["flipped"]) == 1) != usual
        moving = next((y for y in (last, following) if y and y.moves), None)
        staying = next((y for y in (last, following) if y and not y.moves), None)

        def far(y):
            return self.w(y.face, y.corner + (1 if y is following else 2))

        seam, by_moving = 0, moving is not None
        if moving and staying:
            differs, differs_far = moving.wedge != staying.wedge, far(moving) != far(staying)
            if differs or differs_far:
                seam = 1
                by_moving = self.bit(self.m["beside_moving"][0 if not differs_far else 2 if differs else 1])
        y = moving if by_moving else staying
        child = y.target if by_moving else self.mapped.get(y.wedge)
        self.finish(x, forward, y.wedge, child, far(y), seam, y.face)

    def finish(self, x, forward, expected_v, expected_u, expected_x, seam, beside):
        corners = zip((expected_v, expected_u, expected_x), self.m["corner_expected"], (self.parent, self.child, x))
        wv, wu, wx = [self.wedge(expected, model[seam], p) for expected, model, p in corners]
        self.new_face((wv, wx, wu) if forward else (wv, wu, wx), self.group(beside))

    def wedge(self, expected, model, p):
        if expected is not None and self.bit(model):
            return expected
        lists = [x.wedge for x in self.corners] if p == self.parent else []
        if p == self.child:
            lists += self.targets
        else:
            self.step(len(self.corners_of[p]))
            lists += [self.w(f, c) for f, c in self.corners_of[p]]
        for w in dict.fromkeys(lists):  # each once, in order
            if w != expected and self.bit(self.m["listed"]):
                return w
        w = self.new_wedge(p)
        if p == self.child:
            self.targets.append(w)
        return w

    def group(self, beside):
        same = beside is not None and self.bit(self.m["same_group"])
        return self.face_group[beside] if same else self.index(len(self.head["groups"]))

    # 11.8

    def seed(self):
        self.fresh, points, wedges = [], [], []
        for k in range(3):
            if self.places and self.bit(self.m["seed_exists"]):
                p = self.index(len(self.places))
                require(p not in points, "S22", "a face with a point twice")
                points.append(p)
                wedges.append(self.wedge(None, None, p))
            else:
                before = points[0] if k else len(self.places) - 1
                points.append(self.placed_point(self.places[before] if self.places else [0, 0, 0]))
                wedges.append(self.new_wedge(points[-1]))
        self.add(wedges, None)

    def placed_point(self, guess):
        p = self.new_point()
        self.places[p] = self.parts[0].value(guess, 3, self.head["bits"])
        return p

    def add(self, wedges, beside):
        f = self.new_face(wedges, self.group(beside))
        self.fresh_wedges()
        self.gates += [(f, 0), (f, 1), (f, 2)]

    def fan_with(self, point, face):
        self.gather(point)
        return next(fan for fan in self.fans if any(x.face == face for x in fan[0]))

    def at_gate(self, f, c):
        a, b, d = self.p(f, c), self.p(f, c + 1), self.p(f, c + 2)
        left, closed = self.fan_with(a, f)
        if closed or left[0].face != f:
            return
        right, _ = self.fan_with(b, f)
        sides = min(len(left), 8) - 1, min(len(right), 8) - 1
        if not self.bit(self.m["gate_open"][sides[0]][sides[1]]):
            return
        self.fresh = []
        wb = self.wedge(self.w(f, c + 1), self.m["patch_expected"][0], b)
        wa = self.wedge(self.w(f, c), self.m["patch_expected"][1], a)
        self.add((wb, wa, self.third(a, b, d, left[-1], right[0], *sides)), f)

    def third(self, a, b, d, l, r, sl, sr):
        if self.bit(self.m["third_new"][sl][sr]):
            guess = [x + y - z for x, y, z in zip(self.places[a], self.places[b], self.places[d])]
            return self.new_wedge(self.placed_point(guess))
        if l.b != b and self.bit(self.m["third_left"][sl][sr]):
            return self.wedge(self.w(l.face, l.corner + 2), self.m["patch_expected"][2], l.b)
        if r.a != a and r.a != l.b and self.bit(self.m["third_right"]):
            return self.wedge(self.w(r.face, r.corner + 1), self.m["patch_expected"][3], r.a)
        p = self.index(len(self.places))
        require(p not in (a, b), "S22", "a face with a point twice")
        return self.wedge(None, None, p)

    # 11.9

    def fresh_wedges(self):
        for w in self.fresh:
            p, twin, beside = self.wedge_point[w], None, []
            self.step(len(self.corners_of[p]))
            for f, c in self.corners_of[p]:
                if self.w(f, c) == w:
                    beside += [n for n in (self.w(f, c + 1), self.w(f, c + 2)) if not self.pending[n]]
                elif twin is None and not self.pending[self.w(f, c)]:
                    twin = self.w(f, c)
            for k, a in enumerate(self.head["attributes"]):
                part, count = self.parts[k + 1], COMPONENTS[a["kind"]]
                if twin is not None and part.same():
                    self.values[w][k] = list(self.values[twin][k])
                    continue
                if not beside and twin is not None:
                    beside = [twin]
                elif not beside and self.parent is not None and self.corners:
                    beside = [self.corners[0].wedge]
                known = [self.values[n][k] for n in beside]
                guess = [0] * count if not known else mean_normal(known, a["bits"]) if a["kind"] == 2 else mean(known)
                self.values[w][k] = part.value(guess, count, a["bits"])
            self.pending[w] = False
        self.fresh = []

    # What was decoded, as numbers

    def triangles(self):
        """Numbers of the faces that show."""
        place = [tuple(self.places[p]) for p in self.wedge_point]
        return [f for f, face in enumerate(self.faces) if len({place[w] for w in face}) == 3]

    def positions(self):
        return on_grid(self.places, self.head["grid"], self.head["bits"])

    def attribute(self, k):
        a, numbers = self.head["attributes"][k], [v[k] for v in self.values]
        if a["kind"] < 2:
            return on_grid(numbers, a["grid"], a["bits"])
        if a["kind"] == 3:
            return np.float32(numbers) / np.float32((1 << a["bits"]) - 1)
        x = np.float32([octahedron(u, v, a["bits"]) for u, v in numbers])
        length = np.sqrt(x[:, 0] * x[:, 0] + x[:, 1] * x[:, 1] + x[:, 2] * x[:, 2])[:, None]
        return np.where(length > 0, x / np.where(length > 0, length, np.float32(1)), np.float32([0, 0, 1]))


def on_grid(numbers, grid, bits):
    return np.float32(numbers) * (grid[-1] / np.float32((1 << bits) - 1)) + grid[:-1]


def mean(values):
    n = len(values)
    return [(2 * sum(column) + n) // (2 * n) for column in zip(*values)]


def fold(x, y, c):
    return (c - abs(y)) * (-1 if x < 0 else 1), (c - abs(x)) * (-1 if y < 0 else 1)


def octahedron(u, v, bits):
    c = (1 << (bits - 1)) - 1
    x, y = u - c, v - c
    z = c - abs(x) - abs(y)
    return (*(fold(x, y, c) if z < 0 else (x, y)), z)


def mean_normal(values, bits):
    c = (1 << (bits - 1)) - 1
    x, y, z = (sum(column) for column in zip(*(octahedron(u, v, bits) for u, v in values)))
    total = abs(x) + abs(y) + abs(z)
    x, y = ((abs(s) * c // max(total, 1)) * (-1 if s < 0 else 1) for s in (x, y))
    x, y = fold(x, y, c) if z < 0 else (x, y)
    return x + c, y + c


# Commands ---------------------------------------------------------------------------------------------


def show_info(model):
    m = model.manifest
    print(f"format {m['version']['major']}.{m['version']['minor']}, id {model.id}\ntitle {m['title']!r}")
    for k, s in enumerate(m["scales"]["scale"]):
        print(f"scale {s}: {m['scales']['triangles'][k]} triangles, {m['scales']['bytes'][k]} bytes")
    for p, (t, tables) in enumerate(zip(model.textures, model.tables)):
        print(f"plane {p}: {t['role']}, {t['widthPx']} x {t['heightPx']} px, {len(tables['order'])} fragments")
        for r, quality in enumerate(t["rungQuality"]):
            print(f"  rung {r}: quality {quality}, {tables['size'][r].sum()} bytes")
    for path, (offset, size, digest) in model.index.items():
        print(f"{digest} {offset} {size} {path}")


def write_raw(splits, file):
    for place in splits.places:
        print("p", *place, file=file)
    for point, values in zip(splits.wedge_point, splits.values):
        print("w", point, *(number for value in values for number in value), file=file)
    for face, group in zip(splits.faces, splits.face_group):
        print("f", *face, group, file=file)


def write_obj(splits, file):
    kinds = [a["kind"] for a in splits.head["attributes"]]
    rows = splits.positions()[splits.wedge_point]
    if 3 in kinds:
        rows = np.hstack([rows, splits.attribute(kinds.index(3))[:, :3]])
    for row in rows:
        print("v", *(f"{x:.9g}" for x in row), file=file)
    for u, v in splits.attribute(kinds.index(0)) if 0 in kinds else []:
        print(f"vt {u:.9g} {1 - float(v):.17g}", file=file)  # v of OBJ grows upwards
    for normal in splits.attribute(kinds.index(2)) if 2 in kinds else []:
        print("vn", *(f"{x:.9g}" for x in normal), file=file)
    form = "{0}" + ("/{0}" if 0 in kinds else "/" if 2 in kinds else "") + ("/{0}" if 2 in kinds else "")
    before = None
    for f in sorted(splits.triangles(), key=lambda f: splits.face_group[f]):
        if splits.face_group[f] != before:
            before = splits.face_group[f]
            print("g material{}_part{}".format(*splits.head["groups"][before]), file=file)
        print("f", *(form.format(w + 1) for w in splits.faces[f]), file=file)


def run(options):
    model = Model(options.package[0])
    if options.command == "info":
        return show_info(model)
    if options.command == "mesh":
        splits, data = model.stream()
        splits.decode(data, options.scale)
        with open(options.output, "w", encoding="ascii") as file:
            return (write_raw if options.raw else write_obj)(splits, file)
    rungs = len(model.textures[options.plane]["rungQuality"])
    rung = rungs - 1 if options.rung is None else options.rung
    if not -1 <= rung < rungs:
        sys.exit(f"the plane has {rungs} rungs")
    shown = model.preview(options.plane) if rung < 0 else model.picture(options.plane, rung)
    return shown.save(options.output, format="PNG")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=("info", "picture", "mesh", "verify"))
    parser.add_argument("package", nargs="+")
    parser.add_argument("--plane", type=int, default=0)
    parser.add_argument("--rung", type=int, help="default: the highest; -1: the preview alone")
    parser.add_argument("--scale", type=int, default=0)
    parser.add_argument("--raw", action="store_true", help="whole numbers of points, wedges and faces")
    parser.add_argument("-o", "--output")
    options = parser.parse_args()
    if options.command in ("picture", "mesh") and not options.output:
        parser.error("-o OUTPUT is missing")
    if options.command == "verify":
        import conformance
        sys.exit(0 if conformance.verify(options.package) else 1)
    try:
        run(options)
    except (Refused, OSError) as error:
        sys.exit(f"{options.package[0]}: refused: {error}")
    except (KeyError, IndexError, TypeError, ValueError) as error:  # a document without a field, or of another type
        sys.exit(f"{options.package[0]}: refused: J04: {error!r}")


if __name__ == "__main__":
    main()
