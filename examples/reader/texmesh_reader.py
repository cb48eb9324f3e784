#!/usr/bin/env python3
"""Reads texmesh packages of format 2, written from format/SPEC.md alone; rule names are those of that text.

  texmesh_reader.py info PACKAGE                                   digests, offsets and sizes of all entries
  texmesh_reader.py picture PACKAGE [--plane P] [--rung R] -o OUT.png
  texmesh_reader.py mesh PACKAGE [--scale N] [--raw] -o OUT.obj

PACKAGE is a container or the folder of a tree. Needs numpy and Pillow (Debian: python3-numpy python3-pil).
"""
import argparse
import collections
import hashlib
import io
import itertools
import json
import os
import re
import struct
import sys

import numpy as np
from PIL import Image

MAX32 = 0xFFFFFFFF
PATH = re.compile(r"(?!(.*/)?\.{0,2}(/|$))[a-z0-9._/-]{1,200}")  # no part is empty, . or ..
PACK = re.compile(r"texture/(0|[1-9]\d*)/(tables|r\d\d|r[1-9]\d\d+)\.pack")
SOI, EOI = b"\xff\xd8", b"\xff\xd9"


class Refused(Exception):
    """A rule that the package breaks."""


def require(good, rule, what):
    if not good:
        raise Refused(f"{rule}: {what}")


def sha(data):
    return hashlib.sha256(data).hexdigest()


def rises(values):
    return all(a < b for a, b in zip(values, values[1:]))


def clamp(x, low, high):
    return min(max(x, low), high)


def cut(data, sizes):
    ends = np.cumsum(sizes, dtype=np.int64).tolist()
    return [data[end - int(size) : end] for end, size in zip(ends, sizes)]


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

    def array(self, dtype, *shape):
        return np.frombuffer(self.raw(np.dtype(dtype).itemsize * int(np.prod(shape))), dtype).reshape(shape)

    def varint(self):
        digits = [self.get("B")]
        while digits[-1] > 127 and len(digits) < 6:
            digits.append(self.get("B"))
        value, is_shortest = sum((d & 127) << 7 * k for k, d in enumerate(digits)), 0 < digits[-1] < 128
        require(value <= MAX32 and (is_shortest or digits == [0]), "S06", "a varint in its shortest form")
        return value

    def finish(self):
        require(self.at == len(self.data), self.rule, f"{self.what} has further bytes")


# Sections 6 and 8: index and tables -------------------------------------------------------------------


def read_pages(data, m, name, magic, code, rules):
    """The head's last number and, for each page or section, its record of `code` and a cursor over it."""
    head = Cursor(data, rules[1], name)
    require(head.raw(4) == magic, rules[0], "magic")
    major, minor, count, number = head.get("HHII")
    require(major == 2, "W03", f"{name}: version {major}")
    require([major, minor] == [m["version"]["major"], m["version"]["minor"]], "R01", f"version of {name}")
    require(count <= (len(data) - 16) // struct.calcsize("<" + code), head.rule, f"{count} records")
    records, pages = [head.get(code) for _ in range(count)], []
    require((head.at, sha(data[: head.at])) == (m[name]["headBytes"], m[name]["headSha256"]), "R02", name)
    for *record, size, digest in records:
        pages.append((*record, Cursor(head.raw(size), rules[3], f"page {len(pages)} of {name}")))
        require(hashlib.sha256(pages[-1][-1].data).digest() == digest, rules[2], f"digest of {name}'s page")
    head.finish()
    return number, pages


def read_index(data, m):
    """{path: (offset, bytes, digest)}"""
    total, pages = read_pages(data, m, "index", b"TXMX", "III32s", ("I01", "I03", "I04", "I04"))
    require(pages and sum(entries for _, entries, _ in pages) == total, "I03", "number of pages or entries")
    require(pages[0][0] == MAX32 and rises([p[0] for p in pages[1:]] + [MAX32]), "I02", "planes of pages")
    index = {}
    for plane, entries, page in pages:
        end = 0
        for _ in range(entries):
            offset, length, digest, size = page.get("QQ32sB")
            path = page.raw(size).decode("latin-1")
            pack = PACK.fullmatch(path)
            is_here = plane == (int(pack[1]) if pack else MAX32)
            is_plain = PATH.fullmatch(path) and path not in ("manifest.json", "index.bin")
            require(offset % 64 == 0 and 0 < offset <= 2**53 >= length, "I05", f"place of {path}")
            require(is_here and is_plain, "I06", f"{path} on the page of plane {plane}")
            require(path not in index and offset > end, "I07", f"order of {path}")
            end, index[path] = offset + length, (offset, length, digest.hex())
        if m["version"]["minor"] == 0:
            page.finish()
    places = sorted(index.values())
    require(all(a[0] + a[1] < b[0] for a, b in zip(places, places[1:])), "I07", "entries overlap")
    return index


def read_tables(data, m, textures):
    """Per plane a dict of arrays, as section 8 names them."""
    zero, sections = read_pages(data, m, "tables", b"TXMT", "I32s", ("T01", "T02", "T02", "T03"))
    require(zero == 0 or m["version"]["minor"], "T01", "reserved bytes of the head")
    require(len(sections) == m["planeCount"], "R04", "number of planes in tables.bin")
    return [read_section(section, texture, m) for (section,), texture in zip(sections, textures)]


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
    layout = {"order": ("<u2", listed), "quality": ("u1", r), "tables": ("<u4", r), "knots": ("u1", k)}
    layout |= {"positions": ("<u2", k), "size": ("u1", r, listed, ws), "digest": ("V8", r, listed)}
    layout |= {"mse": ("<u2", r * listed), "dssim": ("<u2", r * listed), "preview": ("<u2", listed)}
    layout |= {"covered": ("<u4", listed), "surface": ("<f4", listed), "features": ("u1", n, listed, wf)}
    layout |= {"middle": ("<f4", n), "vqp": ("<u2", listed * (allocation == 3))}
    rest = len(c.data) - c.at - sum(np.dtype(d).itemsize * int(np.prod(s)) for d, *s in layout.values())
    require(rest == 0 or (is_new and rest > 0), "T03", f"{rest} bytes too many")
    t |= {name: c.array(*form) for name, form in layout.items()}
    for name in ("size", "features"):  # little-endian numbers of ws or wf bytes
        t[name] = (t[name].astype(np.int64) << 8 * np.arange(t[name].shape[-1])).sum(axis=-1)
    require(listed == len(np.unique(t["order"])) and (t["order"] < columns * rows).all(), "T05", "order")
    require((t["size"] > 0).all(), "T06", "a size of 0")
    return t


# Sections 2, 4, 5, 7 and 9: bytes, documents, pictures ------------------------------------------------


def parse_json(data, most, what):
    require(len(data) <= most, "L09", f"{what}: more than {most} bytes")
    try:
        document = json.loads(data.decode("utf-8"))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise Refused(f"J01: {what}: {error}") from error
    require(isinstance(document, dict), "J01", f"{what}: not an object")
    return document


def decode_image(data, width, height, channels, rule, what):
    try:
        image = Image.open(io.BytesIO(data), formats=("JPEG", "WEBP"))
        good = image.size == (width, height) and image.mode == ("L" if channels == 1 else "RGB")
        require(good, rule, f"{what}: {image.size}, {image.mode}")
        image.load()
        return image
    except (OSError, SyntaxError, ValueError) as error:
        raise Refused(f"{rule}: {what}: {error}") from error


class Model:
    """A package, container or tree, with its documents."""

    parse = staticmethod(parse_json)

    def __init__(self, name):
        self.name, self.is_tree = name, os.path.isdir(name)
        data = self.read("manifest.json", 0, 16385)
        if not self.is_tree:
            require(data[:4] == b"PK\3\4" and data[30:43] == b"manifest.json", "K11", "no package")
            data = data[64 : 64 + int.from_bytes(data[22:26], "little")]
        require(64 + len(data) <= 16384, "K12", "the manifest ends beyond 16,384 bytes")
        self.id, self.manifest = sha(data), self.parse(data, 16384, "manifest.json")
        m, major = self.manifest, self.manifest["version"]["major"]
        require(m.get("format") == "texmesh", "M01", "format")
        require(major == 2, "W03", f"format {major} is not known; a model of format 1: compile again")
        require(set(m["requiredFeatures"]) <= {"codec-jpeg-progressive", "codec-webp"}, "M02", "features")
        self.check("manifest")
        data = self.read("index.bin", m["index"]["offset"], m["index"]["bytes"])
        require(sha(data) == m["index"]["sha256"], "R03", "digest of index.bin")
        self.index = read_index(data, m)
        self.check("index")
        self.textures = self.parse(self.entry("textures.json"), 32 << 20, "textures.json")["textures"]
        require(len(self.textures) == m["planeCount"], "R04", "number of planes in textures.json")
        self.check("textures")
        self.tables = read_tables(self.entry("tables.bin"), m, self.textures)

    def check(self, document):
        """conformance.py checks here, field by field, what has just been read."""

    def read(self, path, offset, size):
        full, root = os.path.realpath(os.path.join(self.name, path)), os.path.realpath(self.name)
        is_inside = full.startswith(root + os.sep) and os.path.isfile(full)
        require(is_inside or not self.is_tree, "E01", f"no file {path} in the tree")
        with open(full if self.is_tree else self.name, "rb") as file:
            file.seek(0 if self.is_tree else offset)
            return file.read(size)

    def entry(self, path):
        rule = "R07" if path.startswith(("texture/", "preview/")) else "E01"
        require(path in self.index, rule, f"no entry {path}")
        offset, size, digest = self.index[path]
        data = self.read(path, offset, size)
        require(sha(data) == digest, "I08", f"digest of {path}")
        return data

    def pack(self, plane, name, rule, sizes):
        data = self.entry(f"texture/{plane}/{name}.pack")
        require(len(data) == sizes.sum(dtype=np.int64), rule, f"bytes of {name}.pack of plane {plane}")
        return cut(data, sizes)

    def preview(self, plane):
        t = self.textures[plane]
        data = self.entry(f"preview/{t.get('base', plane):03}.jpg")
        return decode_image(data, t["previewWidthPx"], t["previewHeightPx"], t["channels"], "F16", "preview")

    def fragments(self, plane, rung):
        """(fragment, image) of every listed fragment."""
        texture, t, streams = self.textures[plane], self.tables[plane], []
        first = 0 if t["incremental"] else rung
        head = self.pack(plane, "tables", "R12", t["tables"])[first]
        for r in range(first, rung + 1):
            streams.append(self.pack(plane, f"r{r:02}", "R13", t["size"][r]))
            digests = [hashlib.sha256(stream).digest()[:8] for stream in streams[-1]]
            require(b"".join(digests) == t["digest"][r].tobytes(), "F03", f"digests of rung {r}")
        for fragment, *parts in zip(t["order"].tolist(), *streams):
            one, has_table = parts[0], head.startswith(SOI) and head.endswith(EOI)
            good, rule, file = {
                "jpeg": (has_table and one[:2] == SOI and one[-2:] == EOI, "F05", head[:-2] + one[2:]),
                "jpeg-progressive": (
                    has_table and parts[-1][-1:] != b"\xff", "F06", head[:-2] + b"".join(parts) + EOI
                ),
                "webp": (one[:4] == b"RIFF" and one[8:12] == b"WEBP", "F07", one),
            }.get(texture["codec"], (False, "X03", b""))
            what = f"fragment {fragment} at rung {rung} of plane {plane}"
            require(good, rule, what)
            sides = texture["fragmentWidthPx"], texture["fragmentHeightPx"]
            yield fragment, decode_image(file, *sides, texture["channels"], "F08", what)

    def picture(self, plane, rung):
        """The plane at a rung; the preview where nothing is listed."""
        t = self.textures[plane]
        rung = range(len(t["rungQuality"]))[rung]  # -1: the highest
        whole = self.preview(plane).resize((t["widthPx"], t["heightPx"]), Image.BILINEAR)
        for fragment, image in self.fragments(plane, rung):
            row, column = divmod(fragment, t["columns"])
            whole.paste(image, (column * t["fragmentWidthPx"], row * t["fragmentHeightPx"]))
        return whole

    def stream(self):
        require("stream" in self.manifest, "E01", "no split stream in this package")
        return Splits(self.entry("mesh/stream.bin"), self.manifest["stream"])


# Section 11: the stream of vertex splits; names are those of that text, written small -----------------

COMPONENTS = {-1: 3, 0: 2, 1: 2, 2: 2, 3: 4}  # of the kinds of attributes; positions are kind -1 here


class Bits:
    """11.3: binary decisions. A model is a list [p, n]."""

    def __init__(self, data, limit):
        self.data, self.at, self.limit, self.range = data, 4, limit, MAX32
        self.code = int.from_bytes(data[:4].ljust(4, b"\0"), "big")

    def decide(self, odds):
        bound = (self.range >> 12) * odds
        bit = 1 if self.code < bound else 0
        self.code, self.range = (self.code, bound) if bit else (self.code - bound, self.range - bound)
        while self.range < 1 << 24:
            byte = self.data[self.at] if self.at < len(self.data) else 0
            self.at, self.range, self.code = self.at + 1, self.range << 8, (self.code << 8 | byte) & MAX32
        return bit

    def bit(self, model):
        p, n = model
        bit, w = self.decide(clamp(p >> 4, 1, 4095)), 65535 // (n + 2)
        model[:] = p + ((65535 - p) * w >> 16) if bit else p - (p * w >> 16), min(n + 1, self.limit)
        return bit

    def raw(self, count):
        return sum(self.decide(2048) << k for k in reversed(range(count)))


class Values(Bits):
    """11.4: a part of a block with values; a part of 0 bytes says nothing."""

    def __init__(self, data, start):
        super().__init__(data[1:], 60)
        self.is_there, self.models = len(data) > 0, [[256 * s, 24] for s in start]
        self.mean = [2 * data[0]] * 4 if data else None

    def longer(self, mean, length):
        return self.bit(self.models[20 * (mean >> 2 & 3) + clamp(length - (mean >> 4) + 10, 0, 19)])

    def residual(self, c):
        mean = self.mean[c]
        at = clamp((mean >> 4) - 2, 0, 25)
        up = self.longer(mean, at)
        at += up
        while (at < 26 if up else at > 0) and self.longer(mean, at if up else at - 1) == up:
            at += 1 if up else -1
        self.mean[c] = mean + (16 * at - mean >> 3)
        v, k, left = 1, min(at, 11), max(at - 3, 0)
        for first, step in ((80 + k, 0), (92 + 2 * k, 1))[: max(at - 1, 0)]:
            v = 2 * v + self.bit(self.models[first + step * (v & 1)])
        v = (v << left) + self.raw(left)
        return 0 if at == 0 else -v if self.raw(1) else v

    def value(self, guess, bits):
        most = (1 << bits) - 1
        return [clamp(g, 0, most) + (self.is_there and self.residual(c)) & most for c, g in enumerate(guess)]


class Splits:
    """The decoder. A corner is the number 3 * face + c."""

    def __init__(self, data, ref):
        self.data, self.head_bytes = data, ref["headBytes"]
        self.read_head(Cursor(data, "S08", "the head of the stream"))
        require(sha(data[: self.head_bytes]) == ref["headSha256"], "R02", "headSha256 of the stream")
        self.places, self.around, self.point_of, self.values = [], [], [], []
        self.wedge_of, self.groups_of, self.old, self.targets, self.fresh = [], [], {}, [], []
        self.last, self.steps, self.parent, self.child = 0, 0, None, None
        self.models = collections.defaultdict(lambda: [32768, 0])

    # 11.2

    def read_head(self, c):
        require(c.raw(4) == b"TXMS", "S01", "magic")
        major, _, bits, attributes, scales, zero, groups, blocks = c.get("HHBBBBII")
        require(major == 2, "S01", f"version {major} of the stream")
        require(zero == 0, "S02", "a reserved byte")
        require(1 <= groups <= 65536 and 1 <= scales <= 100, "S05", "number of groups or scales")
        self.kinds = [(-1, bits, c.array("<f4", 4))]
        for _ in range(attributes):
            kind, bits, zero = c.get("BBH")
            require(self.kinds[-1][0] < kind <= 3, "S03", f"attribute kind {kind}")
            require(zero == 0, "S02", "reserved bytes")
            self.kinds.append((kind, bits, c.array("<f4", 3) if kind < 2 else np.ones(1)))
        for kind, bits, grid in self.kinds:
            require((2 if kind == 2 else 1) <= bits <= 24, "S03", f"{bits} bits of kind {kind}")
            require(np.isfinite(grid).all() and grid[-1] > 0, "S04", "a grid")
        self.groups, self.scales, self.blocks = [tuple(c.get("HH")) for _ in range(groups)], [], []
        before = {"scale": 256, "blocks": 0, "points": 0, "wedges": 0, "faces": 0}
        for _ in range(scales):
            s = {"scale": c.get("B")} | {name: before[name] + c.varint() for name in list(before)[1:5]}
            s["hidden"] = c.varint()
            good = s["scale"] < before["scale"] and before["blocks"] < s["blocks"] <= blocks
            good = good and s["wedges"] >= s["points"] and s["faces"] >= max(1, s["hidden"])
            require(good and max(s.values()) <= MAX32, "S05", f"numbers of scale {s['scale']}")
            self.scales.append(before := s)
        require(before["scale"] == 0 and before["blocks"] == blocks, "S05", "the last scale")
        self.starts = c.array("u1", attributes + 1, 117).tolist()
        require(blocks <= len(c.data) // (attributes + 11), "S08", f"{blocks} blocks")
        for _ in range(blocks):
            (count, is_patch), *parts = divmod(c.varint(), 2), *(c.varint() for _ in range(attributes + 2))
            good = count >= 1 and (is_patch or count <= 4096) and sum(parts) >= count // 64
            require(good, "S07", "count of a block, or too few bytes for it")
            self.blocks.append((is_patch, count, parts, c.raw(8)))
        require(c.at == self.head_bytes, "S08", "headBytes of the stream")

    # 11.3, 11.5

    def b(self, *model):
        """B of a model, which is its name and its indices."""
        return self.connectivity.bit(self.models[model])

    def index(self, count, *others):
        v = self.connectivity.raw((count - 1).bit_length())
        require(v < count, "S19", f"number {v} of {count}")
        require(v not in others, "S22", "a face with a point twice")
        return v

    def step(self, count):
        self.steps += count
        made = {"points": len(self.places), "wedges": len(self.point_of), "faces": len(self.groups_of)}
        require(all(made[n] <= self.scales[-1][n] for n in made), "S19", "too many points, wedges or faces")
        require(self.steps <= (1 << 20) + 256 * (made["points"] + made["faces"]), "S20", "too many steps")

    def new_point(self, guess=None):
        self.around.append([])
        self.places.append(self.parts[0].value(guess, self.kinds[0][1]) if guess else [0, 0, 0])
        return len(self.places) - 1

    def new_wedge(self, point, copied=None):
        w = len(self.point_of)
        self.point_of.append(point)
        self.values.append(copied or [[0] * COMPONENTS[kind] for kind, *_ in self.kinds[1:]])
        self.fresh += [w] if copied is None else []
        self.targets += [w] if point == self.child else []
        return w

    def new_face(self, wedges, beside):
        is_same = beside is not None and self.b("same_group")
        self.groups_of.append(self.groups_of[beside] if is_same else self.index(len(self.groups)))
        for w in wedges:
            self.around[self.point_of[w]].insert(0, len(self.wedge_of))
            self.wedge_of.append(w)

    def w(self, h, step=0):
        return self.wedge_of[h - h % 3 + (h + step) % 3]

    def p(self, h, step=0):
        return self.point_of[self.wedge_of[h - h % 3 + (h + step) % 3]]

    def gather(self, v):
        """FANS with whether each is closed; CORNERS are the keys of `old`, whose values are their wedges."""
        corners, taken, by_a, self.fans = self.around[v], set(), collections.defaultdict(list), []
        self.step(len(corners))
        for h in corners:
            by_a[self.p(h, 1)].append(h)
        ends, following = {self.p(h, 2) for h in corners}, {a: iter(list) for a, list in by_a.items()}
        for h in [h for h in corners if self.p(h, 1) not in ends] + corners:
            fan = []
            while h is not None and h not in taken:
                taken.add(h)
                fan.append(h)
                h = next((x for x in following.get(self.p(h, 2), ()) if x not in taken), None)
            self.fans += [(fan, self.p(fan[0], 1) == self.p(fan[-1], 2))] if fan else []
        self.old = {h: self.w(h) for fan, _ in self.fans for h in fan}

    # 11.6

    def scale_ends(self):
        """Decodes scale after scale: what each has, and the bytes up to its end."""
        at, done = self.head_bytes, 0
        for s in self.scales:
            self.queue, self.refusals = collections.OrderedDict(), collections.Counter()
            self.has_split, self.progress = set(), True
            for is_patch, count, sizes, digest in self.blocks[done : s["blocks"]]:
                data, at = self.data[at : at + sum(sizes)], at + sum(sizes)
                require(at <= len(self.data), "S08", "a block ends early")
                require(hashlib.sha256(data).digest()[:8] == digest, "S09", "digest of a block")
                first, *parts = cut(data, sizes)
                self.connectivity = Bits(first, 200)
                self.parts = [Values(part, start) for part, start in zip(parts, self.starts)]
                (self.patch if is_patch else self.split_block)(count)
            done, hidden = s["blocks"], len(self.groups_of) - len(self.triangles())
            found = [len(self.places), len(self.point_of), len(self.groups_of), hidden]
            require(found == list(s.values())[2:], "S19", f"scale {s['scale']}: {found} instead of {s}")
            yield s | {"triangles": s["faces"] - hidden, "bytes": at}

    def split_block(self, count):
        while count:
            if not self.queue:
                require(self.progress and self.places, "S19", "no point splits")
                self.progress, self.queue = False, self.queue.fromkeys(range(len(self.places)))
            v, _ = self.queue.popitem(last=False)
            self.step(1)
            degree, refusals = min(len(self.around[v]), 13), min(self.refusals[v], 3)
            self.last = self.b("ask", degree, refusals, v in self.has_split, self.last)
            self.refusals[v] = 0 if self.last else refusals + 1
            if self.last:
                self.has_split.add(v)
                self.progress, count, u = True, count - 1, self.split(v)
                self.queue |= dict.fromkeys([v, u, *(self.ends[h][k] for h in self.old for k in (0, 1))])

    # 11.7

    def split(self, v):
        self.gather(v)
        u = self.new_point()
        self.parent, self.child, self.targets, self.mapped = v, u, [], {}
        self.ends, self.moving = {h: (self.p(h, 1), self.p(h, 2)) for h in self.old}, {}
        for k, (fan, is_closed) in enumerate(self.fans):
            self.choose_moving(fan, is_closed, k > 0)
        for h in self.moving:
            self.moving[h] = self.target(self.old[h])
        self.around[v], self.around[u] = [h for h in self.old if h not in self.moving], list(self.moving)
        for h, w in self.moving.items():
            self.wedge_of[h] = w
        for fan, is_closed in self.fans:
            ring = [fan[-1], *fan] if is_closed else [None, *fan, None]
            for last, following in zip(ring, ring[1:]):
                self.edge(last, following)
        while self.b("extra_face"):
            x = self.index(len(self.places), v, u)
            self.finish(x, self.connectivity.raw(1), None, None, None)
        near = [self.places[self.p(h, k)] for h in self.around[u] for k in (1, 2)]
        self.places[u] = self.parts[0].value(mean(near or [self.places[v]]), self.kinds[0][1])
        self.fresh_wedges()
        self.parent = self.child = None
        return u

    def choose_moving(self, fan, is_closed, later):
        side, turns, run, n = 0, 0, 0, len(fan)
        for i, h in enumerate(fan):
            valence = clamp(len(self.around[self.p(h, 1)]), 4, 8)
            later_turns = (
                ("turn", is_closed, side, min(n - i, 11), valence),
                ("turn_back", is_closed, side, min(run, 7), clamp(n, 3, 10), valence),
                ("turn_again", is_closed, side),
            )
            turn = self.b(*(later_turns[min(turns, 2)] if i else ("first", min(n, 11), later)))
            side, turns, run = side ^ turn, turns + (turn if i else 0), 1 if turn else run + 1
            if side:
                self.moving[h] = None

    def target(self, wedge):
        """The wedge at the child of a moving corner that had `wedge`."""
        known = self.mapped.get(wedge)
        offered = (w for w in self.targets if w != known and self.b("listed"))
        found = known if self.b("target_expected", known is not None) else next(offered, None)
        if found is None:
            stays = any(w == wedge for h, w in self.old.items() if h not in self.moving)
            copied = list(self.values[wedge]) if self.b("target_copied", stays) else None
            found = self.new_wedge(self.child, copied)
        self.mapped.setdefault(wedge, found)
        return found

    def edge(self, last, following):
        """New faces between two neighbours of a fan, of which one may be missing."""
        there = [h for h in (last, following) if h is not None]
        sides, far = [h in self.moving for h in there], {last: 2} | {following: 1}  # far: the corner at x
        kind = sides[0] != sides[1] if len(sides) == 2 else 2 + sides[0]
        first, made = dict(zip(sides[::-1], there[::-1])), 0  # the first that moves, the first that stays
        while self.b("more_faces", kind, made):
            self.step(1)
            forward = self.b("flipped") != (sides[-1] == (following is not None))
            made, seam, by_moving = 1, 0, True in first
            if len(first) == 2:
                differs = self.old[first[True]] != self.old[first[False]]
                differs_far = len({self.w(h, far[h]) for h in there}) == 2
                if differs or differs_far:
                    seam, by_moving = 1, self.b("beside_moving", differs, differs_far)
            y = first[by_moving]
            child = self.moving[y] if by_moving else self.mapped.get(self.old[y])
            self.finish(self.p(y, far[y]), forward, self.old[y], child, self.w(y, far[y]), seam, y // 3)

    def finish(self, x, forward, expected_v, expected_u, expected_x, seam=1, beside=None):
        wv = self.wedge(expected_v, ("corner_expected", 0, seam), self.parent)
        wu = self.wedge(expected_u, ("corner_expected", 1, seam), self.child)
        wx = self.wedge(expected_x, ("corner_expected", 2, seam), x)
        self.new_face((wv, wx, wu) if forward else (wv, wu, wx), beside)

    def wedge(self, expected, model, p):
        if expected is not None and self.b(*model):
            return expected
        offered = list(self.old.values()) if p == self.parent else []
        if p == self.child:
            offered += self.targets
        else:
            self.step(len(self.around[p]))
            offered += [self.w(h) for h in self.around[p]]
        found = next((w for w in dict.fromkeys(offered) if w != expected and self.b("listed")), None)
        return self.new_wedge(p) if found is None else found

    # 11.8

    def patch(self, count):
        self.gates, end = [], len(self.groups_of) + count
        while len(self.groups_of) < end:
            self.at_gate(self.gates.pop()) if self.gates else self.seed()

    def add(self, wedges, beside):
        h = len(self.wedge_of)
        self.new_face(wedges, beside)
        self.fresh_wedges()
        self.gates += [h, h + 1, h + 2]

    def seed(self):
        points, wedges = [], []
        for k in range(3):
            if self.places and self.b("seed_exists"):
                points.append(self.index(len(self.places), *points))
                wedges.append(self.wedge(None, None, points[-1]))
            else:
                before = points[0] if k else len(self.places) - 1
                points.append(self.new_point(self.places[before] if self.places else [0, 0, 0]))
                wedges.append(self.new_wedge(points[-1]))
        self.add(wedges, None)

    def fan_with(self, point, face):
        self.gather(point)
        return next(fan for fan in self.fans if any(h // 3 == face for h in fan[0]))

    def at_gate(self, h):
        a, b, d = (self.p(h, k) for k in range(3))
        left, is_closed = self.fan_with(a, h // 3)
        if is_closed or left[0] // 3 != h // 3:
            return
        right, _ = self.fan_with(b, h // 3)
        sides, l, r = (min(len(left), 8), min(len(right), 8)), left[-1], right[0]
        if not self.b("gate_open", *sides):
            return
        wb = self.wedge(self.w(h, 1), ("patch_expected", 0), b)
        wa = self.wedge(self.w(h), ("patch_expected", 1), a)
        if self.b("third_new", *sides):
            guess = [x + y - z for x, y, z in zip(*(self.places[p] for p in (a, b, d)))]
            third = self.new_wedge(self.new_point(guess))
        elif self.p(l, 2) != b and self.b("third_left", *sides):
            third = self.wedge(self.w(l, 2), ("patch_expected", 2), self.p(l, 2))
        elif self.p(r, 1) not in (a, self.p(l, 2)) and self.b("third_right"):
            third = self.wedge(self.w(r, 1), ("patch_expected", 3), self.p(r, 1))
        else:
            third = self.wedge(None, None, self.index(len(self.places), a, b))
        self.add((wb, wa, third), h // 3)

    # 11.9

    def fresh_wedges(self):
        """What stands in FRESH is pending."""
        while self.fresh:
            w = self.fresh[0]
            corners = self.around[self.point_of[w]]
            self.step(len(corners))
            twin = next((self.w(h) for h in corners if self.w(h) not in self.fresh), None)
            beside = [self.w(h, k) for h in corners if self.w(h) == w for k in (1, 2)]
            beside = [n for n in beside if n not in self.fresh]
            for k, (kind, bits, _) in enumerate(self.kinds[1:]):
                part = self.parts[k + 1]
                if twin is not None and part.is_there and part.bit(part.models[116]):
                    self.values[w][k] = list(self.values[twin][k])
                    continue
                if not beside and (twin is not None or self.parent is not None):
                    beside = [twin] if twin is not None else list(self.old.values())[:1]
                known = [self.values[n][k] for n in beside] or [[0] * COMPONENTS[kind]]
                guess = mean_normal(known, bits) if kind == 2 and beside else mean(known)
                self.values[w][k] = part.value(guess, bits)
            self.fresh.pop(0)

    # What was decoded, as numbers

    def triangles(self):
        """Numbers of the faces that show."""
        corners = np.array(self.places)[np.array(self.point_of)[np.array(self.wedge_of)]].reshape(-1, 3, 3)
        return np.flatnonzero((corners != np.roll(corners, 1, axis=1)).any(axis=2).all(axis=1)).tolist()

    def numbers(self, k):
        """Positions (k = 0) or attribute k - 1 of every wedge, in binary32."""
        kind, bits, grid = self.kinds[k]
        whole = np.array([v[k - 1] for v in self.values] if k else [self.places[p] for p in self.point_of])
        if kind == 3:
            return np.float32(whole) / np.float32((1 << bits) - 1)
        if kind < 2:
            return np.float32(whole) * (grid[-1] / np.float32((1 << bits) - 1)) + grid[:-1]
        x = np.float32(octahedron(whole, (1 << bits - 1) - 1))
        length = np.sqrt(x[:, 0] * x[:, 0] + x[:, 1] * x[:, 1] + x[:, 2] * x[:, 2])[:, None]
        return np.where(length > 0, x / np.where(length > 0, length, np.float32(1)), np.float32([0, 0, 1]))


def mean(values):
    n = len(values)
    return [(2 * sum(column) + n) // (2 * n) for column in zip(*values)]


def folded(xy, c):
    return (c - np.abs(xy[..., ::-1])) * np.where(xy < 0, -1, 1)


def octahedron(uv, c):
    xy = uv - c
    z = c - np.abs(xy).sum(axis=1, keepdims=True)
    return np.hstack([np.where(z < 0, folded(xy, c), xy), z])


def mean_normal(values, bits):
    c = (1 << bits - 1) - 1
    total = octahedron(np.array(values), c).sum(axis=0)
    xy = np.sign(total[:2]) * (np.abs(total[:2]) * c // max(np.abs(total).sum(), 1))
    return ((folded(xy, c) if total[2] < 0 else xy) + c).tolist()


# Commands ---------------------------------------------------------------------------------------------


def write_raw(splits, file):
    for place in splits.places:
        print("p", *place, file=file)
    for point, values in zip(splits.point_of, splits.values):
        print("w", point, *(number for value in values for number in value), file=file)
    for face, group in zip(np.reshape(splits.wedge_of, (-1, 3)), splits.groups_of):
        print("f", *face, group, file=file)


def write_obj(splits, file):
    kinds = {kind: k for k, (kind, *_) in enumerate(splits.kinds)}
    columns = {"v": [splits.numbers(0)] + ([splits.numbers(kinds[3])[:, :3]] if 3 in kinds else [])}
    if 0 in kinds:
        columns["vt"] = [np.float64(splits.numbers(kinds[0])) * [1, -1] + [0, 1]]  # v of OBJ grows upwards
    if 2 in kinds:
        columns["vn"] = [splits.numbers(kinds[2])]
    for name, parts in columns.items():
        rows = np.hstack(parts)
        np.savetxt(file, rows, name + (" %.17g" if name == "vt" else " %.9g") * rows.shape[1])
    corner = {3: "{0}/{0}/{0}", 2: "{0}//{0}" if 2 in kinds else "{0}/{0}", 1: "{0}"}[len(columns)]
    group_of = splits.groups_of.__getitem__
    for group, faces in itertools.groupby(sorted(splits.triangles(), key=group_of), key=group_of):
        print("g material{}_part{}".format(*splits.groups[group]), file=file)
        for f in faces:
            print("f", *(corner.format(w + 1) for w in splits.wedge_of[3 * f : 3 * f + 3]), file=file)


def run(options):
    model = Model(options.package)
    if options.command == "info":
        print(f"id {model.id}")
        for path, (offset, size, digest) in model.index.items():
            print(digest, offset, size, path)
    elif options.command == "mesh":
        splits = model.stream()
        is_there = any(end["scale"] == options.scale for end in splits.scale_ends())
        require(is_there, "S21", f"no scale {options.scale} in the stream")
        with open(options.output, "w", encoding="ascii") as file:
            (write_raw if options.raw else write_obj)(splits, file)
    else:
        p, rung = options.plane, options.rung
        shown = model.preview(p) if rung == "preview" else model.picture(p, int(rung))
        shown.save(options.output, format="PNG")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("command", choices=("info", "picture", "mesh"))
    parser.add_argument("package")
    parser.add_argument("--plane", type=int, default=0)
    parser.add_argument("--rung", default="-1", help="a number, or preview; default: the highest")
    parser.add_argument("--scale", type=int, default=0)
    parser.add_argument("--raw", action="store_true", help="whole numbers of points, wedges and faces")
    parser.add_argument("-o", "--output", default="/dev/stdout")
    options = parser.parse_args()
    try:
        run(options)
    except (Refused, OSError, KeyError, IndexError, TypeError, ValueError) as error:
        is_told = isinstance(error, (Refused, OSError))  # else a field is missing, or of another type
        sys.exit(f"{options.package}: refused: {error if is_told else f'J04: {error!r}'}")


if __name__ == "__main__":
    main()
