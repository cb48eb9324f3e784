"""Layouts, rules and schemas that are data. Nothing in this file knows texmesh: what a package is stands in
format/rules.txt, whose head says how to read it, in schemas/, and in what texmesh_reader.py does with them."""
import hashlib
import json
import math
import os
import re
import sys

import numpy as np

ROOT = os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "..")
MAX32 = 0xFFFFFFFF


class Refused(Exception):
    """A rule that is broken."""


class Record(dict):
    __getattr__ = dict.__getitem__


def require(good, rule, what):
    if not good:
        raise Refused(f"{rule}: {what}")


def rises(values):
    return all(a < b for a, b in zip(values, values[1:]))


def clamp(x, low, high):
    return min(max(x, low), high)


def within(values, low, high):
    return bool(((np.asarray(values) >= low) & (np.asarray(values) <= high)).all())


def joined(digits):
    """Whole numbers of little-endian bytes, which are the last axis."""
    return (digits.astype(np.int64) << 8 * np.arange(digits.shape[-1])).sum(axis=-1)


def width_of(values):
    """Bytes that hold the largest value, at least 1."""
    return max(1, int(values.max(initial=0)).bit_length() + 7 >> 3)


def sha(data):
    return hashlib.sha256(data).hexdigest()


def cut(data, sizes):
    """Pieces of these sizes, one after the other."""
    ends = np.cumsum(sizes, dtype=np.int64).tolist()
    return [data[end - int(size) : end] for end, size in zip(ends, sizes)]


class Cursor:
    """Fields of binary data, one after the other; what is missing breaks `rule`."""

    def __init__(self, data, rule, what):
        self.data, self.at, self.rule, self.what = data, 0, rule, what

    def raw(self, count):
        require(count <= len(self.data) - self.at, self.rule, f"{self.what} ends early")
        self.at += count
        return self.data[self.at - count : self.at]

    def varint(self):
        digits = [self.raw(1)[0]]
        while digits[-1] > 127 and len(digits) < 6:
            digits.append(self.raw(1)[0])
        value, is_shortest = sum((d & 127) << 7 * k for k, d in enumerate(digits)), 0 < digits[-1] < 128
        require(value <= MAX32 and (is_shortest or digits == [0]), "S06", "a varint in its shortest form")
        return value

    def field(self, kind, shape):
        """A number where there is no shape, a list of whole numbers, or an array."""
        if kind == "bytes":
            return self.raw(shape)
        if kind == "varint":
            return self.varint() if shape is None else [self.varint() for _ in range(shape)]
        kind, shape = np.dtype(kind), shape if isinstance(shape, tuple) else () if shape is None else (shape,)
        values = np.frombuffer(self.raw(kind.itemsize * math.prod(shape)), kind).reshape(shape)
        return values.tolist() if len(shape) < 2 and kind.kind != "f" else values

    def finish(self):
        require(self.at == len(self.data), self.rule, f"{self.what} has further bytes")


class Rules:
    """A file of rules. Its section "constants" holds for all others."""

    def __init__(self, path):
        self.helpers, self.sections, lines = Record(np=np, re=re), {}, []
        self.helpers |= {helper.__name__: helper for helper in (rises, within, joined, width_of, sha)}
        with open(os.path.join(ROOT, path), encoding="utf-8") as file:
            for text in (line.rstrip() for line in file if line.strip() and line[0] != "#"):
                if text[0] == "[":
                    lines = self.sections[text[1 : text.index("]")]] = []
                    continue
                name, rest = text.split(None, 1)
                kind, _, value = (None, "", rest) if re.fullmatch(r"[A-Z]\d\d", name) else rest.partition(" ")
                value = value.strip()
                lines.append((name, kind, compile(value, f"{path}: {text}", "eval") if value else None, value))
        self.helpers = self.follow("constants")

    def follow(self, section, cursor=None, **names):
        """Fields and names of a section, beside `names`; refuses what breaks its rules."""
        known = Record(self.helpers, **names)
        for name, kind, code, text in self.sections[section]:
            value = eval(code, known) if code else None
            if kind is None:
                require(value, name, f"{cursor.what if cursor else section}: not {text}")
            else:
                known[name] = value if kind == "=" else cursor.field(kind, value)
        return known


TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int, "number": (int, float)}
LIMITS = {"array": "Items", "string": "Length", "integer": "imum", "number": "imum"}


def validate(value, schema, what, rule="J04", root=None):
    """A value of a JSON document against its JSON schema; it refuses by the nearest "x-rule". Lengths count bytes."""
    root = root or schema
    if "$ref" in schema:
        return validate(value, root["definitions"][schema["$ref"].rpartition("/")[2]], what, rule, root)
    rule, kind = schema.get("x-rule", rule), schema.get("type")
    is_typed = kind is None or isinstance(value, TYPES[kind]) and isinstance(value, bool) == (kind == "boolean")
    require(is_typed and value in schema.get("enum", [schema.get("const", value)]), rule, f"{what}: {value!r:.60}")
    if kind in LIMITS:
        measure = len(value.encode()) if kind == "string" else len(value) if kind == "array" else value
        low, high = (schema.get(end + LIMITS[kind], measure) for end in ("min", "max"))
        good = low <= measure <= high and value != schema.get("exclusiveMinimum")
        good = good and ("multipleOf" not in schema or value % schema["multipleOf"] == 0)
        good = good and ("pattern" not in schema or re.search(schema["pattern"], value))
        require(good, rule, f"{what}: {value!r:.60}")
    for k, item in enumerate(value if kind == "array" and "items" in schema else ()):
        items = schema["items"]
        validate(item, items[k] if isinstance(items, list) else items, f"{what}[{k}]", rule, root)
    for name, member in schema.get("properties", {}).items():
        require(name in value or name not in schema.get("required", ()), "J04", f"{what}: no {name}")
        if name in value:
            validate(value[name], member, f"{what}/{name}", rule, root)


def follow_schema(document, name, what):
    """The document, which follows the schema of that name, if there is a name."""
    if name:
        with open(os.path.join(ROOT, "schemas", name + ".schema.json"), encoding="utf-8") as file:
            validate(document, json.load(file), what)
    return document


def major_of(manifest):
    """The major version; 2 where there is none, which the schema refuses."""
    version = manifest.get("version")
    return version.get("major", 2) if isinstance(version, dict) else 2


def parse_json(data, most, what, free=()):
    """A document; texts below members that are named in `free` may hold control characters."""
    def pairs(members):
        require(len(dict(members)) == len(members), "J10", f"{what}: a name twice")
        return Record(members)

    def no_constant(name):
        raise ValueError(name)

    def walk(value, depth, is_free):
        require(depth <= 64 or not isinstance(value, (dict, list)), "J10", f"{what}: more than 64 levels")
        if isinstance(value, str):
            require(is_free or not re.search(r"[\x00-\x1f\x7f]", value), "J03", f"{what}: a control character")
        elif isinstance(value, (int, float)):
            most = 2**53 if isinstance(value, int) else sys.float_info.max
            require(abs(value) <= most, "J02", f"{what}: {value}")
        elif isinstance(value, dict):
            for name, member in value.items():
                walk(name, depth, is_free)
                walk(member, depth + 1, is_free or name in ("extensions", "extras", *free))
        elif isinstance(value, list):
            for member in value:
                walk(member, depth + 1, is_free)

    require(len(data) <= most, "L09", f"{what}: more than {most} bytes")
    try:
        document = json.loads(data.decode("utf-8"), object_pairs_hook=pairs, parse_constant=no_constant)
    except (ValueError, RecursionError) as error:
        raise Refused(f"J01: {what}: {error}") from error
    require(isinstance(document, dict), "J01", f"{what}: not an object")
    walk(document, 1, False)
    return document
