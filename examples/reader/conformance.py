#!/usr/bin/env python3
"""Rules of format/SPEC.md over every byte: the container, documents field by field, what GLBs and heads of JPEGs say.

  conformance.py PACKAGE...      says of each package which rule the package breaks first, by the rule's name
"""
import io
import json
import os
import re
import struct
import sys
import zlib

import numpy as np
from PIL import Image

from texmesh_reader import MAX32, PATH, Cursor, Model, Refused, decode_image, parse_json, require, rises, sha

MAX16 = 0xFFFF
CREDENTIAL = "META-INF/content_credential.c2pa"
CODEC_FEATURE = {"jpeg": None, "jpeg-progressive": "codec-jpeg-progressive", "webp": "codec-webp"}
GROUPS = ("colour", "normal", "data")


# Section 2: container and tree ------------------------------------------------------------------------


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


def list_tree(root):
    """{path: (None, bytes, None)}"""
    entries = {}
    for folder, _, files in os.walk(root):
        for file in files:
            full = os.path.join(folder, file)
            path = os.path.relpath(full, root).replace(os.sep, "/")
            if path != "fragments.json" and not re.fullmatch(r"texture/\d+/r\d\d+/\d+\.(jpg|webp)", path):
                entries[path] = (None, os.path.getsize(full), None)
    return entries


def list_container(name):
    """{path: (offset, bytes, CRC-32)}; every byte outside of entries is what it must be."""
    size = os.path.getsize(name)
    with open(name, "rb") as f:
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
            require(path == CREDENTIAL or PATH.fullmatch(path), "K05", f"path {path!r}")
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


# Section 4: JSON --------------------------------------------------------------------------------------


def parse_strictly(data, most, what, free=()):
    def unique(pairs):
        names = [name for name, _ in pairs]
        require(len(set(names)) == len(names), "J10", f"{what}: a name twice")
        return dict(pairs)

    def walk(value, depth, is_free):
        require(depth <= 64, "J10", f"{what}: more than 64 levels")
        if isinstance(value, str) and not is_free:
            require(not re.search(r"[\x00-\x1f\x7f]", value), "J03", f"{what}: a control character")
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            require(abs(value) <= 2**53 if isinstance(value, int) else np.isfinite(value), "J02", f"{what}: {value}")
        elif isinstance(value, dict):
            for name, member in value.items():
                walk(name, depth, is_free)
                walk(member, depth + 1, is_free or name in ("extensions", "extras", *free))
        elif isinstance(value, list):
            for member in value:
                walk(member, depth + 1, is_free)

    document = parse_json(data, most, what)
    json.loads(data, object_pairs_hook=unique, parse_constant=lambda name: require(False, "J01", name))
    walk(document, 1, False)
    return document


def check(value, name, kind, low=0, high=2**53, rule="J04"):
    """`value`, if it is of the kind and in the range; of texts and lists the range is the length's."""
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    good = {
        "int": lambda: isinstance(value, int) and not isinstance(value, bool) and low <= value <= high,
        "number": lambda: number and low <= value <= high,
        "text": lambda: isinstance(value, str) and low <= len(value.encode()) <= high,
        "bool": lambda: isinstance(value, bool),
        "list": lambda: isinstance(value, list) and low <= len(value) <= high,
        "object": lambda: isinstance(value, dict),
        "digest": lambda: isinstance(value, str) and re.fullmatch("[0-9a-f]{64}", value) is not None,
    }[kind]()
    shown = str(value)
    require(good, "J07" if kind == "digest" else rule, f"{name}: {shown if len(shown) < 60 else shown[:60] + '...'}")
    return value


def take(document, name, kind, low=0, high=2**53, rule="J04"):
    require(isinstance(document, dict) and name in document, "J04", f"{name} is missing")
    return check(document[name], name, kind, low, high, rule)


# Section 5: manifest ----------------------------------------------------------------------------------


def check_manifest(m):
    version = take(m, "version", "object", rule="M01")
    take(version, "major", "int", rule="M01")
    take(version, "minor", "int", rule="M01")
    for name in take(m, "requiredFeatures", "list", 0, 100):
        require(name in CODEC_FEATURE.values() and name, "M02", f"unknown feature {name}")
    take(m, "title", "text", 0, 200)
    bounds = take(m, "bounds", "object")
    for vector in (take(m, "origin", "list", 3, 3), take(bounds, "min", "list", 3, 3), take(bounds, "max", "list", 3, 3)):
        for x in vector:
            check(x, "a vector", "number", -1e300, 1e300)
    extents = [b - a for a, b in zip(bounds["min"], bounds["max"])]
    require(min(extents) >= 0, "M03", "bounds")
    height = take(m, "objectHeight", "number", 0, 1e300)
    require(abs(height - max(extents)) <= 1e-5 * max(height, max(extents)), "M04", "objectHeight")
    take(m, "surfaceArea", "number", 0, 1e300)
    take(m, "jnd", "number", 0, 1)
    take(m, "planeCount", "int", 0, 10000)
    for name in ("index", "tables", "textures", "quality", "provenance", "about", "stream", "thesis", "poster"):
        if name in m or name not in ("stream", "thesis", "poster"):
            check_reference(take(m, name, "object"), name)
    check_scales(m)
    check_steps(m)
    if "proxies" in m:
        check_proxies(take(m, "proxies", "object"))


def check_offset(offset):
    check(offset, "offset", "int", 64, 2**53, "M05")
    require(offset % 64 == 0, "M05", f"offset {offset}")


def check_reference(ref, name):
    check_offset(take(ref, "offset", "int"))
    size = take(ref, "bytes", "int", 1)
    if name != "stream":
        take(ref, "sha256", "digest")
    if name in ("index", "tables", "stream"):
        take(ref, "headBytes", "int", 16, size)
        take(ref, "headSha256", "digest")
    if name == "poster":
        require(size <= 1000000, "O01", "poster of more than 1,000,000 bytes")
        take(ref, "widthPx", "int", 1, 4096, "O01")
        take(ref, "heightPx", "int", 1, 4096, "O01")


def check_scales(m):
    columns = take(m, "scales", "object")
    n = len(take(columns, "scale", "list", 1, 100))
    kinds = {"scale": ("int", 0, 99), "triangles": ("int", 1, MAX32), "vertices": ("int", 1, MAX32),
             "offset": ("int",), "bytes": ("int", 1), "sha256": ("digest",), "major": ("bool",),
             "floor": ("text", 0, 100)}
    kinds |= {name: ("number", 0, 1e300) for name in ("errorMax", "errorRms", "p95", "p99")}
    for name in ("Jnd", "Error", "Edge", "Flip"):
        kinds["displayPx" + name] = ("number", 0, 1e9, "M11")
    for name, kind in kinds.items():
        for value in take(columns, name, "list", n, n, "M10"):
            check(value, name, *kind)
    require(columns["scale"][0] == 0 and rises(columns["scale"]), "M10", "scale numbers")
    require(columns["displayPxFlip"][0] == 1e9, "M12", "displayPxFlip of S_0")
    lengths = [columns[name] for name in kinds if name.startswith(("error", "p9", "displayPx"))]
    require(not any(columns[name][0] for name in ("errorMax", "errorRms", "p95", "p99")), "M12", "errors of S_0")
    numbers = [m["surfaceArea"], *(x for column in lengths for x in column)]
    require(all(float(f"{x:.6g}") == x for x in numbers), "M07", "more than six significant digits")
    for k in range(n):
        check_offset(columns["offset"][k])
        require(columns["errorRms"][k] <= columns["errorMax"][k], "M12", f"errorRms of element {k}")
    stream = m.get("stream")
    prefixes = [k for k in range(n) if stream and columns["offset"][k] == stream["offset"]]
    require(not {0, n - 1} & set(prefixes), "M18", "the first and the last scale have a GLB")
    sizes = [columns["bytes"][k] for k in reversed(prefixes)]
    if sizes:
        require(stream["headBytes"] < sizes[0] and sizes[-1] <= stream["bytes"] and rises(sizes), "M19", "prefixes")


def check_proxies(columns):
    n, sizes = len(take(columns, "bytes", "list", 1, 8, "M23")), take(columns, "sizesPx", "list", 1, 8, "M23")
    kinds = {"offset": ("int",), "bytes": ("int", 1), "sha256": ("digest",), "triangles": ("int", 1, MAX32),
             "vertices": ("int", 1, MAX32), "texturePx": ("int", 0, 8192)}
    for name, kind in kinds.items():
        for value in take(columns, name, "list", n, n, "M23"):
            check(value, name, *kind)
    for name in ("flip", "flipP95"):
        for losses in take(columns, name, "list", n, n, "M23"):
            check(losses, name, "list", len(sizes), len(sizes), "M23")
            for loss in losses:
                check(loss, name, "number", 0, 1)
    for size in sizes:
        check(size, "sizesPx", "number", 1, 65536)
    for offset in columns["offset"]:
        check_offset(offset)
    require(rises(sizes), "M23", "sizesPx")
    require(rises(columns["bytes"]), "M24", "bytes of proxies")


def proxy_paths(m):
    return [f"proxies/{k:02}.glb" for k in range(len(m.get("proxies", {}).get("bytes", [])))]


def check_steps(m):
    steps, scales = take(m, "steps", "list", 1, 100, "M21"), m["scales"]
    for step in steps:
        check(step, "step", "list", 2, 2, "M21")
        check(step[0], "upToPx", "number", 0, 1e9, "M21")
        require(step[1] in scales["scale"], "M21", f"step to scale {step[1]}")
        flip = scales["displayPxFlip"][scales["scale"].index(step[1])]
        require(step[0] <= flip * (1 + 1e-5), "M22", f"step up to {step[0]} px")
    require(rises([s[0] for s in steps]) and rises([-s[1] for s in steps]), "M21", "steps")
    require(steps[-1][0] == 1e9 and steps[-1][1] == 0, "M21", "the last step")


# Section 7: textures ---------------------------------------------------------------------------------


def check_planes(textures, m):
    check(textures, "textures", "list", 0, 10000)
    full, before = [], (-1, 0)
    for p, t in enumerate(textures):
        check(t, "texture", "object")
        take(t, "image", "int", 0, MAX32)
        for name, most in (("role", 100), ("name", 1000), ("gridReason", 1000)):
            take(t, name, "text", 0, most)
        require(take(t, "colourSpace", "text") in ("srgb", "linear"), "X03", t["colourSpace"])
        require(take(t, "codec", "text") in CODEC_FEATURE, "X03", f"codec {t['codec']}")
        feature = CODEC_FEATURE[t["codec"]]
        require(feature is None or feature in m["requiredFeatures"], "R05", f"{feature} is not required")
        for name in ("width", "height", "fragmentWidth", "fragmentHeight", "previewWidth", "previewHeight"):
            take(t, name + "Px", "int", 1, 2**20)
        require(take(t, "channels", "int") in (1, 3), "J04", "channels")
        for side, cells in (("Width", "columns"), ("Height", "rows")):
            whole, part, n = t[side.lower() + "Px"], t[f"fragment{side}Px"], take(t, cells, "int", 1, 65535)
            require(part % 16 == 0, "X04", f"fragment{side}Px {part}")
            require((n - 1) * part < whole <= n * part, "X05", f"{cells} of plane {p}")
        require(t["columns"] * t["rows"] <= 65535, "X05", f"fragments of plane {p}")
        qualities = take(t, "rungQuality", "list", 1, 100)
        require(rises([check(q, "rungQuality", "int", 1, 100) for q in qualities]), "J04", "rungQuality rises")
        top, source = t.get("sourceRung", False), t.get("source")
        check(top, "sourceRung", "bool")
        require(source in (None, "jpg", "png", "tif", "webp", "exr"), "X03", f"source {source}")
        if source:
            take(t, "sourceColours", "bool")
        if "mip" not in t:
            require(before == (-1, 0), "X06", f"full-size plane {p} behind mips")
            full.append(t)
            require(not top or t["codec"] == "jpeg", "X11", f"sourceRung of plane {p}")
            continue
        here = (take(t, "base", "int", 0, len(full) - 1, "X06"), take(t, "mip", "int", 1, 20))
        require(before < here, "X06", f"order of mip {p}")
        require(not top and not source, "X11", f"sourceRung or source of mip {p}")
        base, before = full[here[0]], here
        require(all(t[s] == -(-base[s] >> here[1]) for s in ("widthPx", "heightPx")), "X07", f"sides of mip {p}")
        same = ("image", "role", "channels", "colourSpace", "previewWidthPx", "previewHeightPx")
        require(all(t[s] == base[s] for s in same), "X07", f"mip {p} and its base")
    images = [(t["image"], t["role"] == "alpha", t.get("mip", 0)) for t in textures]
    require(len(set(images)) == len(images), "X08", "two planes of one image")


def group_of(role):
    return "normal" if role == "normal" else "data" if role in ("data", "occlusion-roughness-metallic") else "colour"


# Section 8: tables ------------------------------------------------------------------------------------


def check_section(t, texture):
    """What a viewer does not need of a section that texmesh_reader.py has read."""
    width, log_width, low, high = t["parameters"].tolist()
    require(0 <= width <= 100 and 0 <= log_width <= 4 and 1 <= low <= high <= 100, "T04", "parameters of the allocation")
    for name, most in (("mse", 65025), ("dssim", 2), ("preview", 2)):
        require((t[name] <= 0x7BFF).all() and (t[name].view("<f2") <= np.float32(most)).all(), "T04", name)
    for values, most in ((t["surface"], 1), (t["middle"], 100)):
        require(np.isfinite(values).all() and (values >= 0).all() and (values <= most).all(), "T04", "a float")
    require(t["quality"].tolist() == texture["rungQuality"], "R09", "rung qualities")
    for values, w in zip((t["size"], t["features"]), t["widths"]):
        require(w == max(1, (int(values.max(initial=0)).bit_length() + 7) // 8), "T08", "width of numbers")
    check_knots(t["knots"].tolist(), t["positions"].tolist(), t["quality"].tolist())
    texels = texture["fragmentWidthPx"] * texture["fragmentHeightPx"]
    require(((t["covered"] > 0) & (t["covered"] <= texels)).all(), "T11", "covered texels")
    require(float(t["surface"].sum(dtype=np.float64)) <= 1.001, "T11", "surface")
    check_order(t)


def check_knots(knots, positions, qualities):
    require(rises(knots) and all(qualities[0] < q < qualities[-1] and q not in qualities for q in knots), "T08", "knots")
    between = [sum(rung < q for rung in qualities) for q in knots]
    for a in range(1, len(knots)):
        require(between[a] != between[a - 1] or positions[a] >= positions[a - 1], "T08", "positions of knots")


def check_order(t):
    features = t["features"][0].astype(np.float64)
    spread = features.max(initial=0) - features.min(initial=features.max(initial=0))
    eta = np.float32((features - features.min(initial=features.max(initial=0))) / spread) if spread else features * 0
    if len(t["vqp"]):
        eta = t["vqp"] / 65535
    keys = list(zip(-eta, -t["surface"], t["order"].tolist()))
    require(keys == sorted(keys), "T12", "order of importance")


# Section 3: entries ----------------------------------------------------------------------------------


def needed_paths(m, textures):
    paths = ["index.bin", "tables.bin", "textures.json", "quality.json", "about.json", "provenance.json"]
    stream = m.get("stream", {}).get("offset")
    paths += [f"mesh/s{s:02}.glb" for s, at in zip(m["scales"]["scale"], m["scales"]["offset"]) if at != stream]
    paths += [path for name, path in OPTIONAL.items() if name in m] + proxy_paths(m)
    for p, t in enumerate(textures):
        paths += [f"preview/{p:03}.jpg"] if "mip" not in t else []
        paths += [f"source/{p:03}.{t['source']}"] if "source" in t else []
        paths += [f"texture/{p}/tables.pack"]
        paths += [f"texture/{p}/r{r:02}.pack" for r in range(len(t["rungQuality"]))]
    return paths


OPTIONAL = {"stream": "mesh/stream.bin", "thesis": "thesis.bin", "poster": "poster.jpg"}
FIXED = {"tables": "tables.bin", "textures": "textures.json", "quality": "quality.json", "about": "about.json",
         "provenance": "provenance.json"}


def check_entry_order(paths, m, textures):
    columns = m["scales"]
    coarsest = f"mesh/s{columns['scale'][-1]:02}.glb"
    glbs = [p for p in (f"mesh/s{s:02}.glb" for s in reversed(columns["scale"])) if p in paths and p != coarsest]
    meshes = [p for p in ["mesh/stream.bin"] + glbs if p in paths]
    planes = range(len(textures))
    most = max((len(t["rungQuality"]) for t in textures), default=0)
    ladder, done = [], 0
    for r in range(most):
        ladder += [f"texture/{p}/r{r:02}.pack" for p in planes if r < len(textures[p]["rungQuality"])]
        while done < len(meshes) and (r + 1) * len(meshes) >= (done + 1) * most:
            ladder.append(meshes[done])
            done += 1
    proxies = proxy_paths(m)
    order = ["manifest.json", *(proxies[:1] or [coarsest]), "index.bin", "textures.json", "quality.json"]
    order += [f"texture/{p}/tables.pack" for p in planes] + ["tables.bin"]
    order += [coarsest, *proxies[1:]] if proxies else []
    order += ["poster.jpg", "about.json"]
    order += [f"preview/{p:03}.jpg" for p in planes] + ladder + meshes[done:]
    others = set(paths) - set(order) - {"provenance.json", CREDENTIAL}
    order += sorted(others) + ["provenance.json", CREDENTIAL]
    there = set(paths)
    expected = [p for p in order if p in there]
    require(paths == expected, "E04", "order of entries")


# Sections 10, 12 to 14: meshes and the other documents ------------------------------------------------


def jpeg_segments(data):
    """(marker, bytes) of what stands in front of the first scan."""
    at, found = 2, []
    while data[at : at + 1] == b"\xff" and data[at + 1 : at + 2] not in (b"\xda", b"\xd9"):
        size = int.from_bytes(data[at + 2 : at + 4], "big")
        require(size >= 2, "F08", "a segment of a JPEG")
        found.append((data[at + 1], data[at + 4 : at + 2 + size]))
        at += 2 + size
    return found


def check_jpeg_head(data, what):
    require(not {0xE1, 0xE2} & {marker for marker, _ in jpeg_segments(data)}, "F10", f"{what}: EXIF or a colour profile")


def check_source_rung(t, streams, plane):
    frames = []
    for stream in streams:
        frame = next((body for marker, body in jpeg_segments(stream) if marker in (0xC0, 0xC1, 0xC2)), b"")
        frames.append([(f >> 4, f & 15) for f in frame[7::3]])
    factors = [f for pair in frames[-1] for f in pair]
    require(all(f in (1, 2, 4) for f in factors) and all(f == frames[-1] for f in frames), "F13", f"plane {plane}")
    require(0xDD not in {marker for marker, _ in jpeg_segments(streams[-1])}, "F12", f"restarts in plane {plane}")
    for side, k in (("fragmentWidthPx", 0), ("fragmentHeightPx", 1)):
        most = max((pair[k] for pair in frames[-1]), default=1)
        require(t[side] % (8 * most) == 0, "F12", f"{side} of plane {plane}")


def read_gltf(data, name):
    """The JSON of a GLB, and how many bytes of the file it takes."""
    c = Cursor(data, "G01", name)
    magic, version, length, size, kind = c.get("IIIII")
    require((magic, version, length, kind) == (0x46546C67, 2, len(data), 0x4E4F534A), "G01", f"the head of {name}")
    try:
        gltf = json.loads(c.raw(size).decode("utf-8"))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise Refused(f"G01: {name}: {error}") from error
    return gltf, size


def check_proxy(data, name, triangles):
    """The JSON of a proxy; meshes and pictures are not decoded."""
    gltf, _ = read_gltf(data, name)
    for part in ("buffers", "images"):
        require(all("uri" not in p for p in gltf.get(part, [])), "G13", f"{name}: a URI in {part}")
    draco = "KHR_draco_mesh_compression" in gltf.get("extensionsUsed", [])
    require(not draco or name != "proxies/00.glb", "G15", f"{name}: coded by Draco")
    views = [v.get("extensions", {}).get("EXT_meshopt_compression", {}) for v in gltf.get("bufferViews", [])]
    good = all(v.get("mode", "TRIANGLES") in ("ATTRIBUTES", "TRIANGLES") and v.get("filter", "NONE") == "NONE" for v in views)
    require(good, "G15", f"{name}: another mode or filter of meshopt")
    corners = [gltf["accessors"][p["indices"]]["count"] for m in gltf.get("meshes", []) for p in m["primitives"]]
    require(sum(corners) == 3 * triangles, "G14", f"{name}: triangles")


def check_glb(data, name, is_coarsest, textures, read):
    """The JSON and the pictures of a GLB; meshes are not decoded. `read` gives an entry."""
    gltf, size = read_gltf(data, name)
    require(all("uri" not in b for b in gltf.get("buffers", [])), "G06", f"{name}: a buffer with a URI")
    previews = {f"../preview/{t.get('base', p):03}.jpg" for p, t in enumerate(textures)}
    images = {t["image"] for t in textures}
    for image in gltf.get("images", []):
        found = re.fullmatch(r"texture/(\d+)", image.get("name", ""))
        require(found and int(found[1]) in images, "G04", f"{name}: image {image.get('name')}")
        uri = image.get("uri")
        require(uri is None or not is_coarsest, "G05", f"{name}: an image that is not embedded")
        require(uri is None or uri in previews, "G06", f"{name}: an image's URI")
        if is_coarsest and image.get("mimeType") == "image/jpeg":
            view = gltf["bufferViews"][image["bufferView"]]
            begin = 28 + size + view.get("byteOffset", 0)  # behind the head of the binary chunk
            plane = next(p for p, t in enumerate(textures) if t["image"] == int(found[1]) and t["role"] != "alpha")
            embedded = data[begin : begin + view["byteLength"]]
            require(embedded == read(f"preview/{plane:03}.jpg"), "G05", f"{name}: not preview {plane}")
    return gltf


def check_shared(glbs, m):
    """{scale: JSON}: what the GLBs of a package have in common, and their counts."""
    columns, first = m["scales"], next(iter(glbs.values()))
    for scale, g in glbs.items():
        require(all(g.get(key) == first.get(key) for key in ("materials", "textures", "samplers")), "G07", f"S_{scale}")
        names = [[node.get("name") for node in x.get("nodes", [])] for x in (g, first)]
        require(names[0] == names[1], "G09", f"names of S_{scale}'s nodes")
        for mesh in g["meshes"]:
            names = mesh.get("extras", {}).get("partNames")
            features = [p.get("extensions", {}).get("EXT_mesh_features", {}).get("featureIds", [{}])[0] for p in mesh["primitives"]]
            counts = names is None or all(f.get("featureCount") == len(names) for f in features)
            require(counts, "G10", f"S_{scale}: feature ids that do not count the parts")
        primitives = [p for mesh in g["meshes"] for p in mesh["primitives"]]
        points = sum(g["accessors"][p["attributes"]["POSITION"]]["count"] for p in primitives)
        corners = sum(g["accessors"][p["indices"]]["count"] for p in primitives)
        k = columns["scale"].index(scale)
        expected = columns["vertices"][k], 3 * columns["triangles"][k]
        require((points, corners) == expected, "G02", f"counts of S_{scale}: {points}, {corners}")


def check_losses(losses, count, low_first=False):
    for name in ("flip", "flipP95", "dssim"):
        values = take(losses, name, "list", count, count, "Q01")
        for value in values:
            check(value, name, "number", 0, 1, "Q01")
        require(not low_first or values[0] == 0, "Q02", "losses of S_0")


def read_quality(data, m, textures):
    q = parse_strictly(data, 4 << 20, "quality.json")
    take(q, "views", "int", 1, 10000, "Q01")
    sizes = take(q, "sizesPx", "list", 1, 8, "Q01")
    require(rises([check(s, "sizesPx", "int", 1, 65536, "Q01") for s in sizes]), "Q01", "sizesPx rise")
    take(q, "exponent", "number", 1, 4, "Q01")
    take(q, "error", "number", 0, 1e6, "Q01")
    require(take(q, "scales", "list", 1, 100, "Q01") == m["scales"]["scale"], "R14", "scales of quality.json")
    for losses in take(q, "geometry", "list", len(sizes), len(sizes), "Q01"):
        check_losses(losses, len(q["scales"]), True)
    present = {group_of(t["role"]) for t in textures}
    groups = take(q, "groups", "list", 0, 3, "Q01")
    for group in groups:
        require(take(group, "group", "text") in GROUPS, "W06", f"group {group['group']}")
        for losses in take(group, "sizes", "list", len(sizes), len(sizes), "Q01"):
            samples = take(losses, "texelDssim", "list", 1, 100, "Q01")
            require(rises([0] + [check(s, "texelDssim", "number", 0, 2, "Q01") for s in samples]), "Q01", "texelDssim")
            check_losses(take(losses, "coded", "object"), len(samples))
            check_losses(take(losses, "preview", "object"), 1)
            for name, least, most in (("finer", 1, 9), ("coarser", 0, 8)):
                mips = take(losses, name, "object")
                check_losses(mips, len(take(mips, "flip", "list", least, most, "Q01")))
    heights = m["scales"]["displayPxFlip"][1:]
    require(all(h <= sizes[-1] * (1 + 1e-5) for h in heights), "M13", "displayPxFlip beyond the pictures")
    names = [group["group"] for group in groups]
    require(names == [g for g in GROUPS if g in present] or set(names) != present, "Q03", "order of groups")
    require(set(names) == present, "R15", f"groups {names}")
    return q


ABOUT_TEXTS = {"title": 200, "description": 10000, "creator": 2000, "attribution": 2000, "licence": 2000,
               "licenceUrl": 2000, "sourceUrl": 2000, "capture": 2000}
ABOUT_PAIRS = {"identifiers": ("scheme", "value"), "dates": ("event", "text")}


def read_about(data, m):
    about = parse_strictly(data, 262144, "about.json", ("source",))
    for name, most in ABOUT_TEXTS.items():
        if name in about:
            check(about[name], name, "text", 1, most, "B01")
    for name in ("licenceUrl", "sourceUrl"):
        require(re.match("https?://", about.get(name, "http://")), "B02", name)
    for name, members in ABOUT_PAIRS.items():
        for item in check(about[name], name, "list", 1, 32, "B01") if name in about else []:
            for member, most in zip(members, (100, 500)):
                take(item, member, "text", 1, most, "B01")
    if "unit" in about:
        take(check(about["unit"], "unit", "object", rule="B01"), "metres", "number", 1e-12, 1e12, "B01")
        take(about["unit"], "name", "text", 1, 50, "B01")
    require(about.get("upAxis", "y") in ("x", "y", "z"), "B01", "upAxis")
    if "coordinateReference" in about:
        place = check(about["coordinateReference"], "coordinateReference", "object", rule="B01")
        require("text" in place or "epsg" in place, "B01", "coordinateReference")
        check(place.get("text", "-"), "text", "text", 1, 2000, "B01")
        check(place.get("epsg", 1), "epsg", "int", 1, 999999, "B01")
    check(about.get("source", {}), "source", "object", rule="B01")
    require(about.get("title", "") == m["title"], "B03", "title")
    return about


def check_perceptual(s, m):
    rows, *zeros = s.get("BBBB")
    require(zeros == [0, 0, 0], "W05", "reserved bytes of the perceptual table")
    require(1 <= rows <= 100, "O05", f"{rows} scales")
    scales = s.array("u1", rows).tolist()
    require(scales[0] == 0 and rises(scales) and scales[-1] < 100, "O05", "scale numbers")
    s.array("<u4", rows)
    require(s.array("<u4", rows)[0] == 0, "O05", "collapses of S_0")
    values, p95 = s.array("<f4", 4 * rows), s.array("<f4", rows * (rows - 1) // 2)
    for v in (values, p95, s.array("<f4", 3 * len(p95))):
        require(((v >= 0) & (v <= 1e30)).all(), "O05", "perceptual values")
    s.finish()
    columns = m["scales"]
    for k, scale in enumerate(columns["scale"]):
        require(scale in scales, "R16", f"scale {scale} in the perceptual table")
        row = scales.index(scale)
        require(k == 0 or abs(p95[row - 1] - columns["p95"][k]) <= 1e-5 * columns["p95"][k], "O06", f"p95 of scale {scale}")


def check_thesis(data, m, textures, tables=None):
    c = Cursor(data, "O04", "thesis.bin")
    require(c.raw(4) == b"TXTH", "O04", "magic")
    version = c.get("HH")
    require(version == (m["version"]["major"], m["version"]["minor"]), "R01", f"version {version} of thesis.bin")
    count, zero = c.get("II")
    require(zero == 0, "W05", "reserved bytes of thesis.bin")
    require(count <= len(data) // 12, "O04", "number of sections")
    directory = [c.get("III") for _ in range(count)]
    require(rises([s[:2] for s in directory]), "O04", "order of sections")
    for kind, plane, size in directory:
        s = Cursor(c.raw(size), "O05", f"section {kind} of plane {plane}")
        if kind == 4:
            require(plane == MAX32, "O05", f"a perceptual table of plane {plane}")
            check_perceptual(s, m)
        if kind not in (1, 2, 3):
            continue
        require(plane < len(textures), "R16", f"plane {plane}")
        fragments = textures[plane]["columns"] * textures[plane]["rows"]
        if kind == 1:
            require(s.get("I") == fragments, "R16", f"fragments of plane {plane}")
            s.array("<u2", 5 * fragments)
        elif kind == 2:
            require(s.get("I") == fragments, "R16", f"size models of plane {plane}")
            require((np.abs(s.array("<f4", 3 * fragments)) <= 1e30).all(), "O05", "size models")
        else:
            scales, width, zero = s.get("BBH")
            require(zero == 0, "W05", "reserved bytes of a section")
            require(1 <= scales <= 100 and 1 <= width <= 8, "O05", "counts of a section")
            require(scales > m["scales"]["scale"][-1], "R16", f"{scales} scales")
            middle = s.array("<f4", scales)
            stored = [middle[k] for k in m["scales"]["scale"]]
            require(tables is None or stored == tables[plane]["middle"].tolist(), "O06", f"Q of plane {plane}")
            require(((middle >= 0) & (middle <= 100)).all(), "O05", "Q")
            digits = s.array("u1", scales * 21, width).astype(np.uint64)
            totals = (digits << (8 * np.arange(width, dtype=np.uint64))).sum(axis=1, dtype=np.uint64)
            require(width == max(1, (int(totals.max()).bit_length() + 7) // 8), "O05", "width of D")
            require(totals.max() <= 2**53, "O05", "D")
        s.finish()
    c.finish()


def decode_source(data, t, plane):
    formats = {"jpg": "JPEG", "png": "PNG", "tif": "TIFF", "webp": "WEBP"}
    if t["source"] in formats:  # Pillow does not read EXR
        try:
            image = Image.open(io.BytesIO(data), formats=(formats[t["source"]],))
            require(image.size == (t["widthPx"], t["heightPx"]), "O02", f"source of plane {plane}: {image.size}")
            image.load()
        except (OSError, SyntaxError, ValueError) as error:
            raise Refused(f"O02: source of plane {plane}: {error}") from error


# Whole packages ---------------------------------------------------------------------------------------


class CheckedModel(Model):
    """Reads as texmesh_reader.py does, and checks everything on the way."""

    parse = staticmethod(parse_strictly)

    def __init__(self, name):
        self.listing = list_tree(name) if os.path.isdir(name) else list_container(name)
        require("index.bin" in self.listing, "E01", "no entry index.bin")
        super().__init__(name)
        for t, texture in zip(self.tables, self.textures):
            check_section(t, texture)

    def whole(self, path):
        """The bytes of an entry where the container has it."""
        require(path in self.listing, "E01", f"no entry {path}")
        return self.read(path, *self.listing[path][:2])

    def check(self, document):
        if document == "manifest":
            check_manifest(self.manifest)
        elif document == "index":
            self.check_references()
        else:
            self.check_textures()

    def check_textures(self):
        check_planes(self.textures, self.manifest)
        for path in needed_paths(self.manifest, self.textures):
            rule = "R07" if path.startswith(("texture/", "preview/", "source/")) else "E01"
            require(path in self.listing and (path in self.index or path == "index.bin"), rule, f"no entry {path}")

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

    def verify(self):
        m = self.manifest
        places = {"manifest.json": None, "index.bin": None, CREDENTIAL: None}
        for path, (offset, size, crc) in self.listing.items():
            require(path in self.index or path in places, "I08", f"{path} is not in the index")
            if path in self.index and offset is not None:
                require((offset, size) == self.index[path][:2], "I08", f"place of {path}")
            data = self.whole(path)
            require(crc in (None, zlib.crc32(data)), "K07", f"CRC-32 of {path}")
            require(path not in self.index or sha(data) == self.index[path][2], "I08", f"digest of {path}")
        for path in self.index:
            require(path in self.listing, "I08", f"no entry {path}")
        known = set(needed_paths(m, self.textures)) | set(places)
        for path in self.listing:
            require(path in known or m["version"]["minor"] > 0, "E03", f"unknown entry {path}")
        if not self.is_tree:
            check_entry_order(list(self.listing), m, self.textures)
        read_quality(self.whole("quality.json"), m, self.textures)
        read_about(self.whole("about.json"), m)
        parse_strictly(self.whole("provenance.json"), 64 << 20, "provenance.json")
        if "thesis" in m:
            check_thesis(self.whole("thesis.bin"), m, self.textures, self.tables)
        if "poster" in m:
            decode_image(self.whole("poster.jpg"), m["poster"]["widthPx"], m["poster"]["heightPx"], 3, "O01", "poster")
        for plane, t in enumerate(self.textures):
            if "mip" not in t:
                check_jpeg_head(self.whole(f"preview/{plane:03}.jpg"), f"preview {plane}")
                self.preview(plane)
            if "source" in t:
                decode_source(self.whole(f"source/{plane:03}.{t['source']}"), t, plane)
            if t["codec"] != "webp":
                streams = self.pack(plane, "tables", "R12", self.tables[plane]["tables"])
                for stream in streams:
                    check_jpeg_head(stream, f"table stream of plane {plane}")
                if t.get("sourceRung"):
                    check_source_rung(t, streams, plane)
            for rung in range(len(t["rungQuality"])):
                for _ in self.fragments(plane, rung):
                    pass
        coarsest = f"mesh/s{m['scales']['scale'][-1]:02}.glb"
        for path, triangles in zip(proxy_paths(m), m.get("proxies", {}).get("triangles", [])):
            check_proxy(self.whole(path), path, triangles)
        glbs = {}
        for path in (path for path in self.index if path.endswith(".glb") and path.startswith("mesh/")):
            glbs[int(path[6:8])] = check_glb(self.whole(path), path, path == coarsest, self.textures, self.whole)
        if "stream" in m:
            self.verify_stream(len(glbs[0].get("materials", [])))
        check_shared(glbs, m)

    def verify_stream(self, materials):
        columns, splits = self.manifest["scales"], self.stream()
        last = splits.head_bytes + sum(sum(sizes) for _, _, sizes, _ in splits.blocks)
        require(last == len(splits.data), "S08", "the last block does not end with the stream")
        require(all(g[0] < max(1, materials) for g in splits.groups), "S23", "a material that the GLBs lack")
        for end in splits.scale_ends():
            require(end["scale"] in columns["scale"], "S21", f"scale {end['scale']} of the stream")
            k = columns["scale"].index(end["scale"])
            require(end["triangles"] == columns["triangles"][k], "S21", f"triangles of scale {end['scale']}")
            if columns["offset"][k] == self.manifest["stream"]["offset"]:
                require(columns["vertices"][k] == end["wedges"], "M16", f"vertices of scale {end['scale']}")
                require(columns["bytes"][k] == end["bytes"], "M20", f"prefix of scale {end['scale']}")
                require(columns["sha256"][k] == sha(splits.data[: end["bytes"]]), "M17", f"prefix of scale {end['scale']}")


def verify(names):
    """Whether no package breaks a rule."""
    good = True
    for name in names:
        try:
            CheckedModel(name).verify()
            print(f"{name}: no rule broken")
        except Refused as refused:
            print(f"{name}: refused: {refused}")
            good = False
        except (KeyError, TypeError, ValueError) as error:
            print(f"{name}: refused: J04: {error!r}")
            good = False
    return good


if __name__ == "__main__":
    sys.exit(0 if verify(sys.argv[1:]) else 1)
