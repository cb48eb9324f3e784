"""Takes a package apart and lays it out again with other bytes: places, sizes and digests follow. For make_invalid."""
import copy
import hashlib
import json
import struct
import zipfile
import zlib

DOCUMENTS = {"index": "index.bin", "tables": "tables.bin", "textures": "textures.json", "quality": "quality.json",
             "about": "about.json", "provenance": "provenance.json", "thesis": "thesis.bin", "poster": "poster.jpg",
             "stream": "mesh/stream.bin", "annotations": "annotations.json", "gltf": "gltf/index.bin"}
CREDENTIAL = "META-INF/content_credential.c2pa"


def sha(data):
    return hashlib.sha256(data).hexdigest()


def dump(document):
    return json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode()


def plane_of(path):
    parts = path.split("/")
    return int(parts[1]) if parts[0] == "texture" else 0xFFFFFFFF


def glb_of(gltf, binary):
    text = dump(gltf)
    text = text.ljust(-(-len(text) // 4) * 4)
    parts = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<III", 0x46546C67, 2, 12 + len(parts)) + parts


def counts_of(glb):
    """Triangles and vertices of a GLB."""
    gltf = json.loads(glb[20 : 20 + struct.unpack("<I", glb[12:16])[0]])
    primitives = [p for m in gltf["meshes"] for p in m["primitives"]]
    counts = [[gltf["accessors"][p["indices"]]["count"] // 3, gltf["accessors"][p["attributes"]["POSITION"]]["count"]]
              for p in primitives]
    return [sum(column) for column in zip(*counts)]


def triangle_glb(low, high):
    """One triangle between two corners of a box, without material."""
    places = [low, [high[0], low[1], high[2]], high]
    binary = struct.pack("<9f3I", *[x for place in places for x in place], 0, 1, 2)
    low, high = ([pick(p[axis] for p in places) for axis in range(3)] for pick in (min, max))
    return glb_of({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                   "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
                   "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3, "min": low, "max": high},
                                 {"bufferView": 1, "componentType": 5125, "type": "SCALAR", "count": 3}],
                   "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12}],
                   "buffers": [{"byteLength": 48}]}, binary)


class Layout:
    """A container under way. `headers` may change a header: headers(path, is_central, header) -> header."""

    def __init__(self, headers=None):
        self.data, self.central, self.count = bytearray(), bytearray(), 0
        self.headers = headers or (lambda path, is_central, header: header)

    def place(self, path):
        """Where the data of the next entry begin."""
        at = len(self.data) + 30 + len(path)
        gap = -at % 64
        return at + gap + (64 if 0 < gap < 6 else 0)

    def add(self, path, data, pad=None):
        at, crc = len(self.data), zlib.crc32(data)
        gap = self.place(path) - at - 30 - len(path) if pad is None else pad
        extra = struct.pack("<HHH", 0xD935, gap - 4, 64) + bytes(gap - 6) if gap else b""
        name = path.encode()
        fields = (0, 0, 0, 0x21, crc, len(data), len(data), len(name))
        self.data += self.headers(path, False, struct.pack("<IHHHHHIIIHH", 0x04034B50, 10, *fields, len(extra)) + name + extra)
        self.data += data
        self.central += self.headers(path, True, struct.pack("<IHHHHHHIIIHHHHHII", 0x02014B50, 10, 10, *fields,
                                                             0, 0, 0, 0, 0, at) + name)
        self.count += 1

    def finish(self, before_end=b""):
        at, size, few = len(self.data), len(self.central), min(self.count, 0xFFFF)
        if few == 0xFFFF:
            before_end += struct.pack("<IQHHIIQQQQ", 0x06064B50, 44, 45, 45, 0, 0, self.count, self.count, size, at)
            before_end += struct.pack("<IIQI", 0x07064B50, 0, at + size, 1)
        end = struct.pack("<IHHHHIIH", 0x06054B50, 0, 0, few, few, size, at, 0)
        return bytes(self.data + self.central + before_end + end)


class Parts:
    """Entries of a package in order, and its documents. Change them, then call pack()."""

    def __init__(self, file):
        with zipfile.ZipFile(file) as z:
            self.entries = {info.filename: z.read(info) for info in z.infolist()}
        self.manifest = json.loads(self.entries["manifest.json"])
        self.slot = len(self.entries["manifest.json"])
        stream = self.manifest.get("stream", {}).get("offset")
        self.prefixes = {k for k, at in enumerate(self.manifest["scales"]["offset"]) if at == stream}
        # What breaks rules on the way:
        self.edit_index = lambda records: records            # [offset, bytes, digest, path] in container order
        self.edit_index_bytes = lambda data: data            # digests of pages are not made anew
        self.edit_manifest = lambda manifest: None
        self.layout = Layout
        self.fields = struct.unpack("<HH", self.entries["index.bin"][4:8])

    def document(self, path):
        return json.loads(self.entries[path])

    def store(self, path, document):
        self.entries[path] = dump(document)

    def write_index(self, places, own="index.bin"):
        records = [[places[p], len(d), hashlib.sha256(d).digest(), p] for p, d in self.entries.items()
                   if p not in ("manifest.json", own, CREDENTIAL) and p.startswith("gltf/") == own.startswith("gltf/")]
        pages = {0xFFFFFFFF: []}
        records = self.edit_index(records)
        for plane in sorted({plane_of(r[3]) for r in records} - {0xFFFFFFFF}):
            pages[plane] = []
        for offset, size, digest, path in records:
            pages[plane_of(path)].append(struct.pack("<QQ", offset, size) + digest + bytes([len(path)]) + path.encode())
        head = b"TXMX" + struct.pack("<HHII", *self.fields, len(pages), len(records))
        for plane, page in pages.items():
            body = b"".join(page)
            head += struct.pack("<III", plane, len(page), len(body)) + hashlib.sha256(body).digest()
        return self.edit_index_bytes(head + b"".join(b"".join(page) for page in pages.values()))

    def refer(self, places):
        """The manifest's places and digests."""
        m = self.manifest
        for name, path in DOCUMENTS.items():
            if name not in m or path not in self.entries:
                continue
            data, ref = self.entries[path], m[name]
            ref["offset"], ref["bytes"] = places[path], len(data)
            if "sha256" in ref:
                ref["sha256"] = sha(data)
            if name in ("index", "tables"):
                ref["headBytes"] = 16 + (44 if name == "index" else 36) * struct.unpack("<I", data[8:12])[0]
            if "headBytes" in ref:
                ref["headSha256"] = sha(data[: ref["headBytes"]])
        proxies = m.get("proxies", {"bytes": []})
        for k in range(len(proxies["bytes"])):
            path = f"proxies/{k:02}.glb"
            if path in self.entries:
                data = self.entries[path]
                proxies["offset"][k], proxies["bytes"][k], proxies["sha256"][k] = places[path], len(data), sha(data)
        columns = m["scales"]
        for k, scale in enumerate(columns["scale"]):
            path = "mesh/stream.bin" if k in self.prefixes else f"mesh/s{scale:02}.glb"
            if path not in self.entries:
                continue
            data = self.entries[path]
            columns["offset"][k] = places[path]
            columns["bytes"][k] = columns["bytes"][k] if k in self.prefixes else len(data)
            columns["sha256"][k] = sha(data[: columns["bytes"][k]])

    def add_proxies(self, glbs, flip, sizes=(128, 512), texture_px=0):
        """These proxies and no others, smallest first, at their places in the order; `flip` by proxy and size, P95 is three times that."""
        coarsest = f"mesh/s{self.manifest['scales']['scale'][-1]:02}.glb"
        proxies = {f"proxies/{k:02}.glb": glb for k, glb in enumerate(glbs)}
        first, *larger = proxies
        mesh, places = self.entries.pop(coarsest), {}
        for path, data in self.entries.items():
            if path.startswith("proxies/"):
                continue
            places[path] = data
            places |= {first: proxies[first]} if path == "manifest.json" else {}
            places |= {coarsest: mesh, **{p: proxies[p] for p in larger}} if path == "tables.bin" else {}
        self.entries = places
        counts = [counts_of(glb) for glb in glbs]
        n = len(glbs)
        self.manifest["proxies"] = {
            "sizesPx": list(sizes), "offset": [64] * n, "bytes": [1] * n, "sha256": ["0" * 64] * n,
            "triangles": [t for t, _ in counts], "vertices": [v for _, v in counts], "texturePx": [texture_px] * n,
            "flip": [list(f) for f in flip], "flipP95": [[min(1, 3 * x) for x in f] for f in flip]}

    def add_proxy(self):
        """A proxy of one triangle."""
        bounds = self.manifest["bounds"]
        self.add_proxies([triangle_glb(bounds["min"], bounds["max"])], [[0.1, 0.2]])

    def pack(self):
        while True:
            self.entries["manifest.json"] = bytes(self.slot)
            for _ in range(2):  # places follow from the index's size
                layout, places = self.layout(), {}
                for path, data in self.entries.items():
                    places[path] = layout.place(path)
                    layout.add(path, data)
                for own in {"index.bin", "gltf/index.bin"} & set(self.entries):
                    self.entries[own] = self.write_index(places, own)
            self.refer(places)
            manifest = copy.deepcopy(self.manifest)
            self.edit_manifest(manifest)
            text = dump(manifest)
            if len(text) <= self.slot:
                break
            self.slot = len(text)
        self.entries["manifest.json"] = text.ljust(self.slot)
        layout = self.layout()
        for path, data in self.entries.items():
            layout.add(path, data)
        return layout.finish()
