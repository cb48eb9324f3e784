"""What a checker looks at beside what reading a package shows: every entry, GLBs, heads of JPEGs, thesis.bin."""
import collections
import json
import re
import struct

from formal_rules import Cursor, Record, Refused, parse_json, require

VIEWERS = re.compile(r"gltf/(index\.bin|s(?P<scale>\d\d)\.glb|(?P<plane>\d{3,})-r(?P<rung>\d\d+)\.jpg)")
FORMATS = {"jpg": "JPEG", "png": "PNG", "tif": "TIFF", "webp": "WEBP"}  # of sources; Pillow does not read EXR


class Checks:
    """All that is left to check of a model that has been opened (texmesh_reader.Model)."""

    def __init__(self, model, rules, decode_image):
        self.model, self.follow, self.decode_image = model, rules.follow, decode_image
        self.known = dict(m=model.manifest, textures=model.textures)

    def run(self):
        model, m = self.model, self.model.manifest
        for path in model.entries:
            model.entry(path)
        self.follow("quality", q=model.document("quality.json", 4 << 20, "quality.v2"), **self.known)
        self.follow("about", about=model.document("about.json", 262144, "about.v2", ("source",)), m=m)
        model.document("provenance.json", 64 << 20)
        if "annotations" in m:
            notes = model.document("annotations.json", 4_000_000, "annotations.v2")
            self.follow("annotations", notes=notes, m=m)
        if "thesis" in m:
            self.check_thesis(Cursor(model.entry("thesis.bin"), "O04", "thesis.bin"))
        if "poster" in m:
            sides = m.poster.widthPx, m.poster.heightPx
            self.decode_image(model.entry("poster.jpg"), *sides, 3, "O01", "poster", ["JPEG"])
        for plane, t in enumerate(model.textures):
            self.check_plane(plane, t)
        for k, triangles in enumerate(m.get("proxies", {}).get("triangles", ())):
            name = f"proxies/{k:02}.glb"
            self.follow("proxy", g=self.glb(name)[0], name=name, triangles=triangles)
        materials = self.check_scales()
        if "stream" in m:
            self.check_stream(model.stream(), max(1, materials))

    def segments(self, data, what):
        """{marker: bytes} of what stands in front of the first scan of a JPEG."""
        c, found = Cursor(data, "F08", what), {}
        c.raw(2)
        while data[c.at : c.at + 1] == b"\xff" and data[c.at + 1] not in (0xDA, 0xD9):
            marker, size = struct.unpack(">xBH", c.raw(4))
            found[marker] = c.raw(max(2, size) - 2)
        self.follow("JPEG", segments=found)
        return found

    def check_plane(self, plane, t):
        model, what = self.model, f"plane {plane}"
        if "mip" not in t:
            self.segments(model.entry(f"preview/{plane:03}.jpg"), f"preview {plane}")
            model.preview(plane)
        if t.get("source") in FORMATS:
            data, kind = model.entry(f"source/{plane:03}.{t.source}"), [FORMATS[t.source]]
            self.decode_image(data, t.widthPx, t.heightPx, None, "O02", f"source of {what}", kind)
        heads = [head for head in model.pack(plane, "tables", "R12", model.tables[plane].tables) if head]
        segments = [self.segments(head, f"table stream of {what}") for head in heads]
        if t.get("sourceRung"):
            self.follow("source rung", t=t, segments=segments)
        for rung in range(len(t.rungQuality)):
            collections.deque(model.fragments(plane, rung), 0)

    def check_thesis(self, c):
        model = self.model
        known = dict(self.known, tables=model.tables, planes=len(model.textures))
        known["later"] = model.manifest.version.minor > 1
        for kind, plane, size in self.follow("thesis", c, **known).sections.tolist():
            body = Cursor(c.raw(size), "O05", f"section {kind} of plane {plane}")
            if kind in (1, 2, 3, 4):
                self.follow(f"thesis {kind}", body, plane=plane, **known)
                body.finish()
        c.finish()

    def glb(self, path):
        """The JSON of a GLB and its embedded JPEGs by name."""
        data = self.model.entry(path)
        head = self.follow("GLB", Cursor(data, "G01", path), whole=len(data))
        try:
            gltf = json.loads(head.text.decode("utf-8"), object_hook=Record)
        except (ValueError, RecursionError) as error:
            raise Refused(f"G01: {path}: {error}") from error
        pictures = {}
        for image in (i for i in gltf.get("images", ()) if i.get("mimeType") == "image/jpeg" and "bufferView" in i):
            view = gltf.bufferViews[image.bufferView]
            begin = 28 + head.size + view.get("byteOffset", 0)  # behind the head of the binary chunk
            pictures[image.get("name")] = data[begin : begin + view.byteLength]
        return gltf, pictures

    def check_scales(self):
        """Number of materials."""
        model, scales = self.model, self.model.manifest.scales.scale
        paths = {k: f"mesh/s{scale:02}.glb" for k, scale in enumerate(scales)}
        glbs = {k: self.glb(path) for k, path in paths.items() if path in model.index}
        previews = {f"texture/{t.image}": model.entry(f"preview/{p:03}.jpg")
                    for p, t in enumerate(model.textures) if "mip" not in t and t.role != "alpha"}
        for k, (g, pictures) in glbs.items():
            shared = dict(first=glbs[0][0], previews=previews, **self.known)
            self.follow("scale", g=g, k=k, pictures=pictures, **shared)
        for path in (p for p in model.index if p.startswith("gltf/")):
            kind = VIEWERS.fullmatch(path)
            if kind and kind["scale"]:
                g, scale = self.glb(path)[0], int(kind["scale"])
                self.follow("gltf scale", g=g, scale=scale, index=model.index, first=glbs[0][0], **self.known)
            elif kind and kind["plane"]:
                plane = self.follow("gltf picture", plane=int(kind["plane"]), rung=int(kind["rung"]), **self.known).t
                sides = plane.widthPx, plane.heightPx, plane.channels
                self.decode_image(model.entry(path), *sides, "H04", path, ["JPEG"])
        return len(glbs[0][0].get("materials", ()))

    def check_stream(self, splits, materials):
        last = splits.head_bytes + sum(sum(block.sizes) for block in splits.blocks)
        require(last == len(splits.data), "S08", "the last block does not end with the stream")
        require(all(material < materials for material, _ in splits.groups), "S23", "a material that the GLBs lack")
        for end in splits.scale_ends():
            self.follow("streamed scale", end=end, m=self.model.manifest, data=splits.data)


def write_raw(splits, file):
    """Whole numbers of points, wedges and faces, as tests compare them."""
    for place in splits.places:
        print("p", *place, file=file)
    for point, values in zip(splits.point_of, splits.values):
        print("w", point, *(number for value in values for number in value), file=file)
    for face in range(len(splits.groups_of)):
        print("f", *splits.wedge_of[3 * face : 3 * face + 3], splits.groups_of[face], file=file)
