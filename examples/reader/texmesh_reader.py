#!/usr/bin/env python3
"""Reads texmesh packages of format 2, written from format/SPEC.md alone; rule names are those of that text.

  texmesh_reader.py info PACKAGE                 what the package holds
  texmesh_reader.py verify PACKAGE...            every rule that this reader knows how to check
  texmesh_reader.py picture PACKAGE --plane P [--rung R] -o OUT.png
  texmesh_reader.py mesh PACKAGE [--scale N] [--raw] -o OUT.obj

PACKAGE is a container or the folder of a tree. Needs numpy and Pillow (Debian: python3-numpy python3-pil).
"""
import argparse
import hashlib
import io
import os
import re
import struct
import sys
import zlib

import numpy as np
from PIL import Image

from texmesh_rules import *
from texmesh_splits import Splits
from texmesh_splits import read_head as read_stream_head

MAX16 = 0xFFFF


def sha(data):
    return hashlib.sha256(data).hexdigest()


# Section 2: container and tree ------------------------------------------------------------------------


def is_path(path):
    parts = path.split("/")
    return path == CREDENTIAL or (
        len(path) <= 200
        and re.fullmatch(r"[a-z0-9._/-]+", path) is not None
        and all(p not in ("", ".", "..") for p in parts)
    )


def local_header(path, size, crc, at):
    big = size >= MAX32
    extra = struct.pack("<HHQQ", 1, 16, size, size) if big else b""
    gap = -(at + 30 + len(path) + len(extra)) % 64
    gap += 64 if 0 < gap < 6 else 0
    if gap:
        extra += struct.pack("<HHH", 0xD935, gap - 4, 64) + bytes(gap - 6)
    shown = MAX32 if big else size
    return (
        struct.pack("<IHHHHHIIIHH", 0x04034B50, 45 if big else 10, 0, 0, 0, 0x21, crc, shown, shown,
                    len(path), len(extra)) + path.encode() + extra
    )


def central_header(path, size, crc, at):
    big, far = size >= MAX32, at >= MAX32
    body = (struct.pack("<QQ", size, size) if big else b"") + (struct.pack("<Q", at) if far else b"")
    extra = struct.pack("<HH", 1, len(body)) + body if body else b""
    version, shown = 45 if body else 10, MAX32 if big else size
    return (
        struct.pack("<IHHHHHHIIIHHHHHII", 0x02014B50, version, version, 0, 0, 0, 0x21, crc, shown, shown,
                    len(path), len(extra), 0, 0, 0, 0, min(at, MAX32)) + path.encode() + extra
    )


def end_record(count, size, at):
    out = b""
    if count >= MAX16 or size >= MAX32 or at >= MAX32:
        out = struct.pack("<IQHHIIQQQQ", 0x06064B50, 44, 45, 45, 0, 0, count, count, size, at)
        out += struct.pack("<IIQI", 0x07064B50, 0, at + size, 1)
    few = min(count, MAX16)
    return out + struct.pack("<IHHHHIIH", 0x06054B50, 0, 0, few, few, min(size, MAX32), min(at, MAX32), 0)


class Package:
    """Entries by path: {path: (offset, size, crc)}; of a tree offset and crc are None."""

    def __init__(self, name):
        self.name, self.is_tree = name, os.path.isdir(name)
        self.entries = self.list_tree() if self.is_tree else self.list_container()

    def read(self, path, begin=0, count=None):
        require(path in self.entries, "E01", f"no entry {path}")
        offset, size, _ = self.entries[path]
        count = size - begin if count is None else count
        require(begin + count <= size, "E01", f"{path} has {size} bytes")
        with open(os.path.join(self.name, path) if self.is_tree else self.name, "rb") as f:
            f.seek(begin if self.is_tree else offset + begin)
            return f.read(count)

    def list_tree(self):
        entries = {}
        for folder, _, files in os.walk(self.name):
            for file in files:
                full = os.path.join(folder, file)
                path = os.path.relpath(full, self.name).replace(os.sep, "/")
                if path != "fragments.json" and not re.fullmatch(r"texture/\d+/r\d\d+/\d+\.(jpg|webp)", path):
                    entries[path] = (None, os.path.getsize(full), None)
        return entries

    def list_container(self):
        size = os.path.getsize(self.name)
        with open(self.name, "rb") as f:
            f.seek(max(0, size - 98))
            tail = f.read()
            require(len(tail) >= 22 and tail[-22:-14] == b"PK\5\6" + bytes(4), "K01", "no end record at the end")
            count, length, at = struct.unpack("<HII", tail[-12:-2])
            if MAX16 == count or MAX32 in (length, at):
                require(len(tail) == 98, "K10", "no ZIP64 end record")
                count, length, at = struct.unpack("<QQQ", tail[32:56])
            end = end_record(count, length, at)
            is_zip64 = len(end) > 22 or tail[-42:-38] == b"PK\6\7"
            require(tail[-len(end):] == end, "K10" if is_zip64 else "K01", "the end record")
            require(at + length + len(end) == size, "K01", "bytes of no entry, or too few")
            f.seek(at)
            directory = Cursor(f.read(length), "K01", "the central directory")
            entries, here = {}, 0
            for _ in range(count):
                begin = directory.at
                fields = directory.get("IHHHHHHIIIHHHHHII")
                path, extra = directory.raw(fields[10]).decode("latin-1"), directory.raw(fields[11])
                crc, bytes_, header = fields[7], fields[9], fields[16]
                if MAX32 in (bytes_, header):
                    more = Cursor(extra, "K08", f"the ZIP64 record of {path}")
                    more.raw(4)
                    bytes_ = more.get("QQ")[0] if bytes_ == MAX32 else bytes_
                    header = more.get("Q") if header == MAX32 else header
                require(is_path(path), "K05", f"path {path!r}")
                require(path not in entries, "K06", f"{path} twice")
                found, expected = directory.data[begin : directory.at], central_header(path, bytes_, crc, header)
                rule = "K08" if found[30:32] != expected[30:32] else "K09" if fields[1] == fields[2] == 45 else "K02"
                require(found == expected, rule, f"the central header of {path}")
                require(header == here, "K01", f"a gap before {path}")
                expected = local_header(path, bytes_, crc, here)
                f.seek(here)
                found = f.read(len(expected))
                lengths = struct.unpack("<HH", found[26:30]) if len(found) >= 30 else (0, 0)
                is_aligned = (here + 30 + sum(lengths)) % 64 == 0
                rule = "K03" if not is_aligned else "K04" if found[:26] == expected[:26] else "K02"
                require(found == expected, rule, f"the local header of {path}")
                entries[path] = (here + len(expected), bytes_, crc)
                here += len(expected) + bytes_
                require(here <= at, "K01", f"{path} goes beyond the central directory")
            directory.finish()
            require(here == at, "K01", "bytes before the central directory")
        folders = {p[:i] for p in entries for i, c in enumerate(p) if c == "/"}
        require(not folders & set(entries), "K06", "a path is a folder of another")
        first = next(iter(entries), None)
        require(first == "manifest.json", "K11", f"the first entry is {first}")
        require(64 + entries[first][1] <= 16384, "K12", "the manifest ends beyond 16,384 bytes")
        return entries


# Sections 6 to 8: index, textures, tables -------------------------------------------------------------


def read_head(data, magic, version, letter):
    head = Cursor(data, letter + "03" if letter == "I" else letter + "02", magic.decode())
    require(head.raw(4) == magic, letter + "01", "magic")
    found = head.get("HH")
    require(found[0] == 2, "W03", f"{magic.decode()}: version {found[0]}")
    require(found == version, "R01", f"{magic.decode()}: version {found}")
    return head


def plane_of(path):
    found = re.fullmatch(r"texture/(0|[1-9]\d*)/(tables|r\d\d|r[1-9]\d\d+)\.pack", path)
    return int(found[1]) if found else MAX32


def read_index(data, m):
    head = read_head(data, b"TXMX", (m["version"]["major"], m["version"]["minor"]), "I")
    count, total = head.get("II")
    require(1 <= count <= (len(data) - 16) // 44, "I03", "number of pages")
    pages = [(*head.get("III"), head.raw(32)) for _ in range(count)]
    require(head.at == m["index"]["headBytes"], "R02", "headBytes of the index")
    require(sha(data[: head.at]) == m["index"]["headSha256"], "R02", "headSha256 of the index")
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
        page.finish()
    head.finish()
    places = sorted(index.values())
    require(all(a[0] + a[1] < b[0] for a, b in zip(places, places[1:])), "I07", "entries overlap")
    return index


def read_tables(data, m, textures):
    """Per plane a dict of arrays, as section 8 names them."""
    head = read_head(data, b"TXMT", (m["version"]["major"], m["version"]["minor"]), "T")
    count, zero = head.get("II")
    require(zero == 0, "T01", "reserved bytes of the head")
    require(count == m["planeCount"], "R04", "number of planes in tables.bin")
    sections = [(head.get("I"), head.raw(32)) for _ in range(count)]
    require(head.at == m["tables"]["headBytes"], "R02", "headBytes of the tables")
    require(sha(data[: head.at]) == m["tables"]["headSha256"], "R02", "headSha256 of the tables")
    planes = []
    for p, (size, digest) in enumerate(sections):
        body = head.raw(size)
        require(hashlib.sha256(body).digest() == digest, "T02", f"digest of section {p}")
        planes.append(read_section(Cursor(body, "T03", f"section {p}"), textures[p], m))
    head.finish()
    return planes


def read_section(c, texture, m):
    columns, rows, n, r, ws, wf, allocation, flags, k, zero = c.get("IIBBBBBBBB")
    fragments = columns * rows
    require((columns, rows) == (texture["columns"], texture["rows"]), "R08", "grid")
    require(n == len(m["scales"]["scale"]), "R11", f"{n} rows")
    require(1 <= r <= 100 and 1 <= ws <= 4 and 1 <= wf <= 3, "T03", "counts and widths")
    require(allocation <= 2, "T13", f"allocation {allocation}")
    require(flags <= 1 and zero == 0, "W05", "reserved bits")
    require((flags == 1) == (texture["codec"] == "jpeg-progressive"), "R10", "incremental")
    floats = c.array("<f4", 4)
    width, log_width, low, high = floats.tolist()
    require(np.isfinite(floats).all() and 0 <= width <= 100 and 0 <= log_width <= 4 and 1 <= low <= high <= 100,
            "T04", "parameters of the allocation")
    listed = c.get("I")
    require(listed <= fragments, "T03", f"{listed} listed fragments")
    rest = 2 * listed + r * 5 + k * 3 + r * listed * (ws + 12) + listed * 10 + n * listed * wf + n * 4
    require(len(c.data) == c.at + rest, "T03", f"a section of {len(c.data)} bytes")
    t = {"incremental": flags == 1, "order": c.array("<u2", listed), "quality": c.array("u1", r),
         "tables": c.array("<u4", r), "knots": c.array("u1", k), "positions": c.array("<u2", k)}
    t["size"] = c.whole(ws, r * listed).reshape(r, listed)
    t["digest"] = c.array("u1", r * listed * 8).reshape(r, listed, 8)
    halves = {"mse": (r, listed), "dssim": (r, listed), "preview": (listed,)}
    for name, shape in halves.items():
        bits = c.array("<u2", int(np.prod(shape))).reshape(shape)
        t[name] = bits.view("<f2").astype(np.float64)
        require((bits <= 0x7BFF).all() and (t[name] <= (65025 if name == "mse" else 2)).all(), "T04", name)
    t["covered"], t["surface"] = c.array("<u4", listed), c.array("<f4", listed)
    t["features"] = c.whole(wf, n * listed).reshape(n, listed)
    t["middle"] = c.array("<f4", n)
    c.finish()
    require(listed == len(set(t["order"].tolist())) and (t["order"] < fragments).all(), "T05", "order")
    require((t["size"] > 0).all(), "T06", "a size of 0")
    for values, most in ((t["surface"], 1), (t["middle"], 100)):
        require(np.isfinite(values).all() and (values >= 0).all() and (values <= most).all(), "T04", "a float")
    require(t["quality"].tolist() == texture["rungQuality"], "R09", "rung qualities")
    for values, w in ((t["size"], ws), (t["features"], wf)):
        largest = int(values.max(initial=0))
        require(w == max(1, (largest.bit_length() + 7) // 8), "T08", "width of numbers")
    check_knots(t["knots"].tolist(), t["positions"].tolist(), t["quality"].tolist())
    texels = texture["fragmentWidthPx"] * texture["fragmentHeightPx"]
    require(((t["covered"] > 0) & (t["covered"] <= texels)).all(), "T11", "covered texels")
    require(float(t["surface"].sum(dtype=np.float64)) <= 1.001, "T11", "surface")
    check_order(t)
    return t


def check_knots(knots, positions, qualities):
    require(rises(knots) and all(qualities[0] < q < qualities[-1] and q not in qualities for q in knots), "T08", "knots")
    between = [sum(rung < q for rung in qualities) for q in knots]
    for a in range(1, len(knots)):
        require(between[a] != between[a - 1] or positions[a] >= positions[a - 1], "T08", "positions of knots")


def check_order(t):
    features = t["features"][0].astype(np.float64)
    spread = features.max(initial=0) - features.min(initial=features.max(initial=0))
    eta = np.float32((features - features.min(initial=features.max(initial=0))) / spread) if spread else features * 0
    keys = list(zip(-eta, -t["surface"], t["order"].tolist()))
    require(keys == sorted(keys), "T12", "order of importance")


# Section 9: fragments ---------------------------------------------------------------------------------


class Textures:
    """Planes, tables and packs of a package, and the pictures that they make."""

    def __init__(self, package, index, textures, tables):
        self.package, self.index, self.textures, self.tables = package, index, textures, tables

    def pack(self, plane, name, rule, expected):
        data = self.package.read(f"texture/{plane}/{name}.pack")
        require(len(data) == expected, rule, f"{name}.pack of plane {plane} has {len(data)} bytes")
        return data

    def files(self, plane, rung):
        """(fragment, complete file) of every listed fragment; digests are checked."""
        t, codec = self.tables[plane], self.textures[plane]["codec"]
        heads = self.table_streams(plane)
        rungs = range(rung + 1) if t["incremental"] else [rung]
        streams = []
        for r in rungs:
            data = self.pack(plane, f"r{r:02}", "R13", int(t["size"][r].sum()))
            streams.append(cut(data, t["size"][r]))
            for k, stream in enumerate(streams[-1]):
                good = hashlib.sha256(stream).digest()[:8] == t["digest"][r, k].tobytes()
                require(good, "F03", f"digest of fragment {t['order'][k]} at rung {r} of plane {plane}")
        for k, fragment in enumerate(t["order"].tolist()):
            parts = [s[k] for s in streams]
            if codec == "jpeg":
                good = parts[0][:2] == b"\xff\xd8" and parts[0][-2:] == b"\xff\xd9"
                good = good and heads[rung][:2] == b"\xff\xd8" and heads[rung][-2:] == b"\xff\xd9"
                require(good, "F05", f"fragment {fragment}: no SOI or EOI")
                yield fragment, heads[rung][:-2] + parts[0][2:]
            elif codec == "jpeg-progressive":
                require(heads[0][:2] == b"\xff\xd8" and parts[-1][-1:] != b"\xff", "F06", "no SOI, or a stream that ends with FF")
                yield fragment, heads[0][:-2] + b"".join(parts) + b"\xff\xd9"
            else:
                require(parts[0][:4] == b"RIFF" and parts[0][8:12] == b"WEBP", "F07", f"fragment {fragment}: no WebP")
                yield fragment, parts[0]

    def table_streams(self, plane):
        t = self.tables[plane]
        return cut(self.pack(plane, "tables", "R12", int(t["tables"].sum(dtype=np.int64))), t["tables"])

    def preview(self, plane):
        t = self.textures[plane]
        data = self.package.read(f"preview/{t.get('base', plane):03}.jpg")
        return decode_image(data, t["previewWidthPx"], t["previewHeightPx"], t["channels"], "F16", "preview")

    def fragments(self, plane, rung):
        t = self.textures[plane]
        for fragment, file in self.files(plane, rung):
            yield fragment, decode_image(file, t["fragmentWidthPx"], t["fragmentHeightPx"], t["channels"], "F08",
                                         f"fragment {fragment} at rung {rung} of plane {plane}")

    def picture(self, plane, rung):
        """The plane at a rung; the preview where nothing is listed."""
        t = self.textures[plane]
        w, h = t["fragmentWidthPx"], t["fragmentHeightPx"]
        whole = self.preview(plane).resize((t["widthPx"], t["heightPx"]), Image.BILINEAR)
        for fragment, image in self.fragments(plane, rung):
            row, column = divmod(fragment, t["columns"])
            whole.paste(image, (column * w, row * h))
        return whole


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


def decode_source(data, t, plane):
    formats = {"jpg": "JPEG", "png": "PNG", "tif": "TIFF", "webp": "WEBP"}
    if t["source"] in formats:  # Pillow does not read EXR
        try:
            image = Image.open(io.BytesIO(data), formats=(formats[t["source"]],))
            require(image.size == (t["widthPx"], t["heightPx"]), "O02", f"source of plane {plane}: {image.size}")
            image.load()
        except (OSError, SyntaxError, ValueError) as error:
            raise Refused(f"O02: source of plane {plane}: {error}") from error


# Commands ---------------------------------------------------------------------------------------------


class Model:
    """A package with its documents, each checked."""

    def __init__(self, name):
        self.package = p = Package(name)
        data = p.read("manifest.json")
        self.id, self.manifest = sha(data), read_manifest(data)
        m = self.manifest
        index = p.read("index.bin")
        require((len(index), sha(index)) == (m["index"]["bytes"], m["index"]["sha256"]), "R03", "digest of index.bin")
        self.index = read_index(index, m)
        self.check_references()
        self.textures = read_textures(self.entry("textures.json"), m)
        for path in needed_paths(m, self.textures):
            rule = "R07" if path.startswith(("texture/", "preview/", "source/")) else "E01"
            require(path in p.entries and (path in self.index or path == "index.bin"), rule, f"no entry {path}")
        self.tables = read_tables(self.entry("tables.bin"), m, self.textures)
        self.pictures = Textures(p, self.index, self.textures, self.tables)

    def entry(self, path):
        """An entry, whose digest is that of the index."""
        data = self.package.read(path)
        require(sha(data) == self.index[path][2], "I08", f"digest of {path}")
        crc = self.package.entries[path][2]
        require(crc is None or crc == zlib.crc32(data), "K07", f"CRC-32 of {path}")
        return data

    def check_references(self):
        m, columns = self.manifest, self.manifest["scales"]
        stream = m.get("stream")
        named = {path: m[name] for name, path in (FIXED | OPTIONAL).items() if name in m}
        for s, at, size, digest in zip(*(columns[c] for c in ("scale", "offset", "bytes", "sha256"))):
            if not stream or at != stream["offset"]:
                named[f"mesh/s{s:02}.glb"] = {"offset": at, "bytes": size, "sha256": digest}
        proxies = m.get("proxies", {"offset": [], "bytes": [], "sha256": []})
        for path, *ref in zip(proxy_paths(m), *(proxies[c] for c in ("offset", "bytes", "sha256"))):
            named[path] = dict(zip(("offset", "bytes", "sha256"), ref))
        for path, ref in named.items():
            require(path in self.index, "R03", f"{path} is not in the index")
            expected = self.index[path]
            found = (ref["offset"], ref["bytes"], ref.get("sha256", expected[2]))
            require(found == expected, "R03", f"the manifest's {path}")

    def stream(self):
        require("stream" in self.manifest, "E01", "no split stream in this package")
        data, ref = self.entry("mesh/stream.bin"), self.manifest["stream"]
        head = read_stream_head(data)
        require(head["bytes"] == ref["headBytes"], "S08", "headBytes of the stream")
        require(sha(data[: head["bytes"]]) == ref["headSha256"], "R02", "headSha256 of the stream")
        return Splits(head), data

    def verify(self):
        p, m = self.package, self.manifest
        places = {"manifest.json": None, "index.bin": None, CREDENTIAL: None}
        for path, (offset, size, crc) in p.entries.items():
            require(path in self.index or path in places, "I08", f"{path} is not in the index")
            if path in self.index and offset is not None:
                require((offset, size) == self.index[path][:2], "I08", f"place of {path}")
            data = p.read(path)
            require(crc in (None, zlib.crc32(data)), "K07", f"CRC-32 of {path}")
            require(path not in self.index or sha(data) == self.index[path][2], "I08", f"digest of {path}")
        for path in self.index:
            require(path in p.entries, "I08", f"no entry {path}")
        known = set(needed_paths(m, self.textures)) | set(places)
        for path in p.entries:
            require(path in known or m["version"]["minor"] > 0, "E03", f"unknown entry {path}")
        if not p.is_tree:
            check_entry_order(list(p.entries), m, self.textures)
        read_quality(p.read("quality.json"), m, self.textures)
        read_about(p.read("about.json"), m)
        parse_json(p.read("provenance.json"), 64 << 20, "provenance.json")
        if "thesis" in m:
            check_thesis(p.read("thesis.bin"), m, self.textures, self.tables)
        if "poster" in m:
            decode_image(p.read("poster.jpg"), m["poster"]["widthPx"], m["poster"]["heightPx"], 3, "O01", "poster")
        for plane, t in enumerate(self.textures):
            if "mip" not in t:
                check_jpeg_head(p.read(f"preview/{plane:03}.jpg"), f"preview {plane}")
                self.pictures.preview(plane)
            if "source" in t:
                decode_source(p.read(f"source/{plane:03}.{t['source']}"), t, plane)
            if t["codec"] != "webp":
                streams = self.pictures.table_streams(plane)
                for stream in streams:
                    check_jpeg_head(stream, f"table stream of plane {plane}")
                if t.get("sourceRung"):
                    check_source_rung(t, streams, plane)
            for rung in range(len(t["rungQuality"])):
                for _ in self.pictures.fragments(plane, rung):
                    pass
        coarsest = f"mesh/s{m['scales']['scale'][-1]:02}.glb"
        for path, triangles in zip(proxy_paths(m), m.get("proxies", {}).get("triangles", [])):
            check_proxy(p.read(path), path, triangles)
        glbs = {}
        for path in (path for path in self.index if path.endswith(".glb") and path.startswith("mesh/")):
            glbs[int(path[6:8])] = check_glb(p.read(path), path, path == coarsest, self.textures, p.read)
        if "stream" in m:
            self.verify_stream(len(glbs[0].get("materials", [])))
        check_shared(glbs, m)

    def verify_stream(self, materials):
        columns, (splits, data) = self.manifest["scales"], self.stream()
        last = self.manifest["stream"]["headBytes"] + sum(sum(b["parts"]) for b in splits.head["blocks"])
        require(last == len(data), "S08", "the last block does not end with the stream")
        require(all(g[0] < max(1, materials) for g in splits.head["groups"]), "S23", "a material that the GLBs lack")
        for end in splits.scale_ends(data):
            require(end["scale"] in columns["scale"], "S21", f"scale {end['scale']} of the stream")
            k = columns["scale"].index(end["scale"])
            require(end["triangles"] == columns["triangles"][k], "S21", f"triangles of scale {end['scale']}")
            if columns["offset"][k] == self.manifest["stream"]["offset"]:
                require(columns["vertices"][k] == end["wedges"], "M16", f"vertices of scale {end['scale']}")
                require(columns["bytes"][k] == end["bytes"], "M20", f"prefix of scale {end['scale']}")
                require(columns["sha256"][k] == sha(data[: end["bytes"]]), "M17", f"prefix of scale {end['scale']}")


def show_info(model):
    m = model.manifest
    print(f"format {m['version']['major']}.{m['version']['minor']}, id {model.id}")
    print(f"title {m['title']!r}, {len(model.package.entries)} entries")
    for k, s in enumerate(m["scales"]["scale"]):
        print(f"scale {s}: {m['scales']['triangles'][k]} triangles, {m['scales']['bytes'][k]} bytes")
    for p, (t, tables) in enumerate(zip(model.textures, model.tables)):
        print(f"plane {p}: {t['role']}, {t['widthPx']} x {t['heightPx']} px, {len(tables['order'])} fragments")
        for r, quality in enumerate(t["rungQuality"]):
            print(f"  rung {r}: quality {quality}, {tables['size'][r].sum()} bytes")
    for path, (offset, size, digest) in model.index.items():
        print(f"{digest} {offset} {size} {path}")


def write_mesh(model, scale, raw, file):
    splits, data = model.stream()
    splits.decode(data, scale)
    if raw:
        for place in splits.places:
            print("p", *place, file=file)
        for point, values in zip(splits.wedge_point, splits.values):
            print("w", point, *(number for value in values for number in value), file=file)
        for face, group in zip(splits.faces, splits.face_group):
            print("f", *face, group, file=file)
        return
    kinds = [a["kind"] for a in splits.head["attributes"]]
    colours = splits.attribute(kinds.index(3)) if 3 in kinds else None
    positions = splits.positions()[splits.wedge_point]
    for w, place in enumerate(positions):
        print("v", *(f"{x:.9g}" for x in place), *(f"{x:.9g}" for x in ([] if colours is None else colours[w, :3])),
              file=file)
    if 0 in kinds:
        for u, v in splits.attribute(kinds.index(0)):
            print(f"vt {u:.9g} {1 - float(v):.17g}", file=file)  # v of OBJ grows upwards
    if 2 in kinds:
        for normal in splits.attribute(kinds.index(2)):
            print("vn", *(f"{x:.9g}" for x in normal), file=file)
    form = "{0}" + ("/{0}" if 0 in kinds else "/" if 2 in kinds else "") + ("/{0}" if 2 in kinds else "")
    before = None
    for f in sorted(splits.triangles(), key=lambda f: splits.face_group[f]):
        if splits.face_group[f] != before:
            before = splits.face_group[f]
            print(f"g material{splits.head['groups'][before][0]}_part{splits.head['groups'][before][1]}", file=file)
        print("f", *(form.format(w + 1) for w in splits.faces[f]), file=file)


def verify(names):
    """Whether no package breaks a rule."""
    good = True
    for name in names:
        try:
            Model(name).verify()
            print(f"{name}: no rule broken")
        except Refused as refused:
            print(f"{name}: refused: {refused}")
            good = False
    return good


def run(options):
    model = Model(options.package[0])
    if options.command == "info":
        return show_info(model)
    if options.command == "mesh":
        with open(options.output, "w", encoding="ascii") as file:
            return write_mesh(model, options.scale, options.raw, file)
    if not 0 <= options.plane < len(model.textures):
        sys.exit(f"the package has {len(model.textures)} planes")
    rungs = len(model.textures[options.plane]["rungQuality"])
    rung = rungs - 1 if options.rung is None else options.rung
    if not -1 <= rung < rungs:
        sys.exit(f"the plane has {rungs} rungs")
    shown = model.pictures.preview(options.plane) if rung < 0 else model.pictures.picture(options.plane, rung)
    return shown.save(options.output, format="PNG")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=("info", "verify", "picture", "mesh"))
    parser.add_argument("package", nargs="+")
    parser.add_argument("--plane", type=int, default=0)
    parser.add_argument("--rung", type=int, help="default: the highest; -1: the preview alone")
    parser.add_argument("--scale", type=int, default=0)
    parser.add_argument("--raw", action="store_true", help="whole numbers of points, wedges and faces")
    parser.add_argument("-o", "--output")
    options = parser.parse_args()
    if options.command in ("picture", "mesh") and not options.output:
        parser.error("-o OUTPUT is missing")
    try:
        if options.command == "verify":
            sys.exit(0 if verify(options.package) else 1)
        run(options)
    except Refused as refused:
        sys.exit(f"{options.package[0]}: refused: {refused}")
    except OSError as error:
        sys.exit(f"{error}")


if __name__ == "__main__":
    main()
