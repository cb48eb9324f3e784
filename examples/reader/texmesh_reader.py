#!/usr/bin/env python3
"""Reads texmesh packages of format 2, written from format/SPEC.md alone; rule names are those of that text.

PACKAGE is a container or the folder of a tree. check: which rule it breaks first, by every byte. info: digests and
places of its entries. picture: a texture plane as PNG. mesh: a scale of its stream as OBJ. Needs numpy and Pillow.
"""
import argparse
import collections
import io
import os
import pathlib
import sys
import zlib

import numpy as np
from PIL import Image

from formal_rules import MAX32, Cursor, Record, Refused, Rules, clamp, cut, follow_schema, major_of, parse_json, require, sha
from package_checks import Checks, write_raw

RULES = Rules("format/rules.txt")

# Sections 2 and 6: container, tree, index ---------------------------------------------------------------
def list_tree(root):
    """{path: entry}, without offsets and CRCs."""
    files = (file for file in pathlib.Path(root).rglob("*") if file.is_file())
    sizes = {file.relative_to(root).as_posix(): file.stat().st_size for file in files}
    return {p: Record(data=0, size=n, crc=None) for p, n in sizes.items() if not RULES.helpers.LOOSE.fullmatch(p)}

def list_container(name):
    """{path: central header and place of the data}; every byte outside of entries is what it must be."""
    with open(name, "rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - 98))
        tail = file.read()
        end = last = RULES.follow("end record", Cursor(tail[-22:], "K01", "the end record"))
        if 0xFFFF in end.counts or MAX32 in (end.size, end.at) or tail[-42:-38] == b"PK\6\7":
            last = RULES.follow("ZIP64 end", Cursor(tail[:-22], "K10", "the ZIP64 end record"), end=end)
        require(last.at + last.size + (22 if last is end else 98) == size, "K01", "bytes of no entry, or too few")
        file.seek(last.at)
        directory, entries, here = Cursor(file.read(last.size), "K01", "the central directory"), {}, 0
        for _ in range(last.counts[0]):
            central = RULES.follow("central header", directory, here=here, paths=entries)
            file.seek(here)
            header = Cursor(file.read(512), "K01", f"the local header of {central.path}")
            entries[central.path] = RULES.follow("local header", header, central=central, size=central.size)
            here = entries[central.path].data + central.size
    directory.finish()
    RULES.follow("container", paths=list(entries), entries=entries, here=here, directory=last.at)
    return entries

def read_pages(data, m, name, rules, ref=None):
    """(record, cursor) of each page of the index or section of the tables, to be read to its end."""
    c = Cursor(data, rules[0], name)
    head = RULES.follow(name, c, m=m)
    told = m[ref or name]
    good = "headBytes" not in told or (c.at, sha(data[: c.at])) == (told.headBytes, told.headSha256)
    require(good, "R02", f"the head of {name}")
    for *record, size, digest in head.pages:
        page = Cursor(c.raw(size), rules[2], f"page {record} of {name}")
        require(sha(page.data) == digest.hex(), rules[1], f"digest of {page.what}")
        yield record, page
        if m.version.minor <= 1:
            page.finish()
    c.finish()

def read_index(data, m, ref="index"):
    """{path: [offset, bytes, SHA-256]}"""
    index = {}
    for (plane, entries), page in read_pages(data, m, "index", ("I03", "I04", "I04"), ref):
        end = 0
        for _ in range(entries):
            r = RULES.follow("index record", page, plane=plane, index=index, end=end)
            end, index[r.path] = r.offset + r.bytes, [r.offset, r.bytes, r.digest.hex()]
    return index


# Sections 4, 5, 7 to 10: documents, tables, pictures, GLBs ----------------------------------------------
def decode_image(data, width, height, channels, rule, what, kind=("JPEG", "WEBP")):
    try:
        image = Image.open(io.BytesIO(data), formats=kind)
        good = image.size == (width, height) and (not channels or image.mode == ("L" if channels == 1 else "RGB"))
        require(good, rule, f"{what}: {image.size}, {image.mode}")
        image.load()
        return image
    except (OSError, SyntaxError, ValueError) as error:
        raise Refused(f"{rule}: {what}: {error}") from error

def with_z(image):
    xy = np.asarray(image)[..., :2]  # F24
    z = (256 + np.sqrt(np.maximum(0, 65025 - ((2.0 * xy - 255) ** 2).sum(axis=2))).astype(int)) // 2
    return Image.fromarray(np.dstack([xy, z]).astype("u1"))

class Model:
    """A package, container or tree, with its documents."""

    def __init__(self, name):
        self.name, self.is_tree = name, os.path.isdir(name)
        self.entries = list_tree(name) if self.is_tree else list_container(name)
        data = self.read("manifest.json")
        self.id, self.manifest = sha(data), parse_json(data, 16384, "manifest.json")
        m = self.manifest
        require(major_of(m) == 2, "W03", f"format {major_of(m)} is not known; of format 1: compile again")
        follow_schema(m, "manifest.v2", "manifest.json")
        RULES.follow("manifest", m=m)
        data = self.read("index.bin")
        require((len(data), sha(data)) == (m.index.bytes, m.index.sha256), "R03", "index.bin")
        self.index, viewers = read_index(data, m), {}
        if "gltf" in m:
            data = self.read("gltf/index.bin")
            require((len(data), sha(data)) == (m.gltf.bytes, m.gltf.sha256), "R03", "gltf/index.bin")
            viewers = read_index(data, m, "gltf")
        RULES.follow("gltf index", m=m, index=self.index, viewers=viewers)
        self.index |= viewers | ({"gltf/index.bin": [m.gltf.offset, m.gltf.bytes, m.gltf.sha256]} if "gltf" in m else {})
        RULES.follow("references", m=m, index=self.index, entries=self.entries, is_tree=self.is_tree)
        self.textures = self.document("textures.json", 32 << 20, "textures.v2").textures
        names = dict(m=m, index=self.index, textures=self.textures, names=list(self.entries), is_tree=self.is_tree)
        RULES.follow("planes", **names)
        self.tables = self.read_tables(self.entry("tables.bin"))
        RULES.follow("order", **names)

    def read(self, path):
        full, root = os.path.realpath(os.path.join(self.name, path)), os.path.realpath(self.name)
        is_inside = full.startswith(root + os.sep) and os.path.isfile(full)
        require(path in self.entries and (is_inside or not self.is_tree), "E01", f"no entry {path}")
        with open(full if self.is_tree else self.name, "rb") as file:
            file.seek(self.entries[path].data)
            return file.read(self.entries[path].size)

    def entry(self, path):
        data = self.read(path)
        require(self.entries[path].crc in (None, zlib.crc32(data)), "K07", f"CRC-32 of {path}")
        require(path not in self.index or sha(data) == self.index[path][2], "I08", f"digest of {path}")
        return data

    def document(self, path, most, schema=None, free=()):
        return follow_schema(parse_json(self.entry(path), most, path, free), schema, path)

    def read_tables(self, data):
        """Per plane a record of arrays, as section 8 names them."""
        m, later = self.manifest, self.manifest.version.minor > 1
        sections = zip(read_pages(data, m, "tables", ("T02", "T02", "T03")), self.textures)
        return [RULES.follow("section", section, m=m, t=t, later=later) for (_, section), t in sections]

    def pack(self, plane, name, rule, sizes):
        data = self.entry(f"texture/{plane}/{name}.pack")
        require(len(data) == int(np.sum(sizes, dtype=np.int64)), rule, f"bytes of {name}.pack of plane {plane}")
        return cut(data, sizes)

    def preview(self, plane):
        t = self.textures[plane]
        data = self.entry(f"preview/{t.get('base', plane):03}.jpg")
        return decode_image(data, t.previewWidthPx, t.previewHeightPx, t.channels, "F16", "preview")

    def fragments(self, plane, rung):
        """(fragment, image) of every listed fragment."""
        t, table, streams = self.textures[plane], self.tables[plane], []
        first = 0 if table.flags & 1 else rung
        head = self.pack(plane, "tables", "R12", table.tables)[first]
        for r in range(first, rung + 1):
            streams.append(self.pack(plane, f"r{r:02}", "R13", table.sizes[r]))
            digests = "".join(sha(stream)[:16] for stream in streams[-1])
            require(digests == table.digests[r].tobytes().hex(), "F03", f"digests of rung {r}")
        for fragment, *parts in zip(table.order, *streams):
            what = f"fragment {fragment} at rung {rung} of plane {plane}"
            file = RULES.follow("fragment", head=head, parts=parts, t=t, what=what).file
            image = decode_image(file, t.fragmentWidthPx, t.fragmentHeightPx, t.channels, "F08", what)
            yield fragment, with_z(image) if t.codec == "jpeg-xy" else image

    def picture(self, plane, rung):
        """The plane at a rung; the preview where nothing is listed."""
        t = self.textures[plane]
        rung = range(len(t.rungQuality))[rung]  # -1: the highest
        whole = self.preview(plane).resize((t.widthPx, t.heightPx), Image.BILINEAR)
        for fragment, image in self.fragments(plane, rung):
            row, column = divmod(fragment, t.columns)
            whole.paste(image, (column * t.fragmentWidthPx, row * t.fragmentHeightPx))
        return whole

    def stream(self):
        return Splits(self.entry("mesh/stream.bin"), self.manifest.stream)


# Section 11: the stream of vertex splits; names are those of that text, written small -----------------

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
        self.data, self.head_bytes = data, ref.headBytes
        self.read_head(Cursor(data, "S08", "the head of the stream"))
        require(sha(data[: self.head_bytes]) == ref.headSha256, "R02", "headSha256 of the stream")
        self.places, self.around, self.point_of, self.values = [], [], [], []
        self.wedge_of, self.groups_of, self.old, self.targets, self.fresh = [], [], {}, [], []
        self.last, self.steps, self.parent, self.child = 0, 0, None, None
        self.models = collections.defaultdict(lambda: [32768, 0])

    # 11.2
    def read_head(self, c):
        h = RULES.follow("stream", c)
        self.kinds = [(-1, h.bits, h.grid, 3)]  # kind, bits, grid, components; -1: positions
        for _ in range(h.A):
            a = RULES.follow("attribute", c, kinds=[kind for kind, *_ in self.kinds])
            self.kinds.append((a.kind, a.bits, a.grid, 4 if a.kind == 3 else 2))
        self.groups = c.field("<u2", (h.groups, 2)).tolist()
        before, self.scales = Record(scale=256, blocks=0, points=0, wedges=0, faces=0), []
        for _ in range(h.scales):
            self.scales.append(before := RULES.follow("stream scale", c, before=before, head=h))
        self.starts = RULES.follow("stream starts", c, last=before, head=h, left=len(c.data) - c.at).starts.tolist()
        self.blocks = [RULES.follow("block", c, head=h) for _ in range(h.blocks)]
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
        self.values.append(copied or [[0] * n for *_, n in self.kinds[1:]])
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
        """Decodes scale after scale; what each has, and its prefix."""
        at, done = self.head_bytes, 0
        for s in self.scales:
            self.queue, self.refusals = collections.OrderedDict(), collections.Counter()
            self.has_split, self.progress = set(), True
            for block in self.blocks[done : s.blocks]:
                data, at = self.data[at : at + sum(block.sizes)], at + sum(block.sizes)
                require(at <= len(self.data), "S08", "a block ends early")
                require(sha(data)[:16] == block.digest.hex(), "S09", "digest of a block")
                first, *parts = cut(data, block.sizes)
                self.connectivity = Bits(first, 200)
                self.parts = [Values(part, start) for part, start in zip(parts, self.starts)]
                (self.patch if block.is_patch else self.split_block)(block.count)
            done, triangles = s.blocks, len(self.triangles())
            found = (len(self.places), len(self.point_of), len(self.groups_of), len(self.groups_of) - triangles)
            told = (s.points, s.wedges, s.faces, s.hidden)
            require(found == told, "S19", f"scale {s.scale}: {found} instead of {told}")
            yield Record(scale=s.scale, wedges=s.wedges, triangles=triangles, bytes=at)

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
            self.wedge_of[h] = self.moving[h] = self.target(self.old[h])
        self.around[v], self.around[u] = [h for h in self.old if h not in self.moving], list(self.moving)
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
            turn_back = "turn_back", is_closed, side, min(run, 7), clamp(n, 3, 10), valence
            usual = ("turn", is_closed, side, min(n - i, 11), valence), turn_back, ("turn_again", is_closed, side)
            turn = self.b(*(usual[min(turns, 2)] if i else ("first", min(n, 11), later)))
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
            beside = [self.w(h, k) for h in corners if self.w(h) == w for k in (1, 2) if self.w(h, k) not in self.fresh]
            for k, (kind, bits, _, components) in enumerate(self.kinds[1:]):
                part = self.parts[k + 1]
                if twin is not None and part.is_there and part.bit(part.models[116]):
                    self.values[w][k] = list(self.values[twin][k])
                    continue
                if not beside and (twin is not None or self.parent is not None):
                    beside = [twin] if twin is not None else list(self.old.values())[:1]
                known = [self.values[n][k] for n in beside] or [[0] * components]
                guess = mean_normal(known, bits) if kind == 2 and beside else mean(known)
                self.values[w][k] = part.value(guess, bits)
            self.fresh.pop(0)

    def triangles(self):
        """Numbers of the faces that show."""
        corners = np.array(self.places)[np.array(self.point_of)[np.array(self.wedge_of)]].reshape(-1, 3, 3)
        return np.flatnonzero((corners != np.roll(corners, 1, axis=1)).any(axis=2).all(axis=1))

    def numbers(self, k):
        """Positions (k = 0) or attribute k - 1 of every wedge, in binary32."""
        kind, bits, grid, _ = self.kinds[k]
        whole = np.array([v[k - 1] for v in self.values] if k else [self.places[p] for p in self.point_of])
        if kind == 3:
            return np.float32(whole) / np.float32((1 << bits) - 1)
        if kind < 2:
            return np.float32(whole) * (grid[-1] / np.float32((1 << bits) - 1)) + grid[:-1]
        x = np.float32(octahedron(whole, (1 << bits - 1) - 1))
        length = np.sqrt(x[:, 0] * x[:, 0] + x[:, 1] * x[:, 1] + x[:, 2] * x[:, 2])[:, None]
        return np.where(length > 0, x / np.where(length > 0, length, np.float32(1)), np.float32([0, 0, 1]))

def mean(values):
    return [(2 * sum(column) + len(column)) // (2 * len(column)) for column in zip(*values)]

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
    corner = {3: " %d/%d/%d", 2: " %d//%d" if 2 in kinds else " %d/%d", 1: " %d"}[len(columns)]
    shown, groups_of = splits.triangles(), np.array(splits.groups_of)
    wedges = np.reshape(splits.wedge_of, (-1, 3)) + 1
    for number, group in enumerate(splits.groups):
        print("g material{}_part{}".format(*group), file=file)
        faces = wedges[shown[groups_of[shown] == number]]
        np.savetxt(file, np.repeat(faces, len(columns), axis=1), "f" + 3 * corner)

def run(options, package):
    model, output = Model(package), options.output
    if options.command == "check":
        Checks(model, RULES, decode_image).run()
        print(f"{package}: no rule broken")
    elif options.command == "info":
        print(f"id {model.id}")
        print(*(f"{digest} {at} {size} {path}\n" for path, (at, size, digest) in model.index.items()), sep="", end="")
    elif options.command == "picture":
        plane, is_preview = options.plane, options.rung == "preview"
        (model.preview(plane) if is_preview else model.picture(plane, int(options.rung))).save(output, format="PNG")
    else:
        splits = model.stream()
        require(any(end.scale == options.scale for end in splits.scale_ends()), "S21", "no such scale")
        with open(output, "w", encoding="ascii") as file:
            (write_raw if options.raw else write_obj)(splits, file)

def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("command", choices=("check", "info", "picture", "mesh"))
    parser.add_argument("packages", nargs="+")
    parser.add_argument("--plane", type=int, default=0)
    parser.add_argument("--rung", default="-1", help="a number, or preview; default: the highest")
    parser.add_argument("--scale", type=int, default=0)
    parser.add_argument("--raw", action="store_true", help="whole numbers of points, wedges and faces")
    parser.add_argument("-o", "--output", default="/dev/stdout")
    options, refused = parser.parse_args(), []
    for package in options.packages:
        try:
            run(options, package)
        except (Refused, OSError, AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            rule = "" if isinstance(error, (Refused, OSError)) else "J04: "  # a field is missing, or of another type
            refused.append(f"{package}: refused: {rule}{error}\n")
    print(*refused, sep="", end="", file=sys.stdout if options.command == "check" else sys.stderr)
    sys.exit(len(refused) > 0)

if __name__ == "__main__":
    main()
