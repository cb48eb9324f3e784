"""Decodes mesh/stream.bin, section 11 of format/SPEC.md. Names are those of that text, written small."""
import hashlib

import numpy as np

from texmesh_rules import MAX32, Cursor, require

COMPONENTS = (2, 2, 2, 4)  # of the attribute kinds


def read_head(data):
    c = Cursor(data, "S08", "the head of the stream")
    require(c.raw(4) == b"TXMS", "S01", "magic")
    major, _, bits, attributes, scales, zero = c.get("HHBBBB")
    require(major == 2, "S01", f"version {major} of the stream")
    require(zero == 0, "S02", "a reserved byte")
    groups, blocks = c.get("II")
    require(1 <= bits <= 24, "S03", f"{bits} bits")
    require(1 <= groups <= 65536 and 1 <= scales <= 100, "S05", "number of groups or scales")
    head = {"bits": bits, "grid": read_grid(c, 3), "attributes": []}
    for _ in range(attributes):
        kind, bits, zero = c.get("BBH")
        kinds = [a["kind"] for a in head["attributes"]]
        require(kind <= 3 and all(k < kind for k in kinds), "S03", f"attribute kind {kind}")
        require((2 if kind == 2 else 1) <= bits <= 24, "S03", f"{bits} bits of kind {kind}")
        require(zero == 0, "S02", "reserved bytes")
        head["attributes"].append({"kind": kind, "bits": bits, "grid": read_grid(c, 2) if kind < 2 else None})
    head["groups"] = [tuple(c.get("HH")) for _ in range(groups)]
    head["scales"] = read_scales(c, scales, blocks)
    head["models"] = [list(c.raw(117)) for _ in range(attributes + 1)]
    require(blocks <= len(data) // (attributes + 11), "S08", f"{blocks} blocks")
    head["blocks"] = []
    for _ in range(blocks):
        code = c.varint()
        parts = [c.varint() for _ in range(attributes + 2)]
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
        if self.code < bound:
            self.range, bit = bound, 1
        else:
            self.code -= bound
            self.range -= bound
            bit = 0
        while self.range < 1 << 24:
            byte = self.data[self.at] if self.at < len(self.data) else 0
            self.at += 1
            self.range <<= 8
            self.code = (self.code << 8 | byte) & MAX32
        return bit

    def bit(self, model, limit):
        p, n = model
        bit = self.decide(min(max(p >> 4, 1), 4095))
        w = 65535 // (n + 2)
        model[0] = p + ((65535 - p) * w >> 16) if bit else p - (p * w >> 16)
        model[1] = min(n + 1, limit)
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
        if data:
            self.models = [[256 * s, 24] for s in start]
            self.mean = [2 * data[0]] * 4

    def residual(self, c):
        if not self.bits:
            return 0
        mean, bit = self.mean[c], self.bits.bit
        quarter, middle = 20 * (mean >> 2 & 3), mean >> 4

        def longer(length):
            return bit(self.models[quarter + min(max(length - middle + 10, 0), 19)], 60)

        at = min(max(middle - 2, 0), 25)
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
        return [(min(max(guess[c], 0), most) + self.residual(c)) & most for c in range(count)]


def models(*shape):
    return [models(*shape[1:]) for _ in range(shape[0])] if shape else [32768, 0]


class Corner:
    __slots__ = ("face", "corner", "a", "b", "wedge", "moves", "target")

    def __init__(self, face, corner, a, b, wedge):
        self.face, self.corner, self.a, self.b, self.wedge, self.moves = face, corner, a, b, wedge, False


def clamp(x, low, high):
    return min(max(x, low), high)


class Splits:
    """The decoder: points, wedges, faces of the mesh so far."""

    def __init__(self, head):
        self.head = head
        self.places, self.corners_of = [], []
        self.wedge_point, self.values, self.pending = [], [], []
        self.faces, self.face_group = [], []
        self.last, self.steps, self.child, self.parent = 0, 0, None, None
        self.fresh, self.corners, self.fans = [], [], []
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
        require(len(self.places) < self.head["scales"][-1]["points"], "S19", "too many points")
        self.places.append([0, 0, 0])
        self.corners_of.append([])
        return len(self.places) - 1

    def new_wedge(self, point, pending=True):
        require(len(self.wedge_point) < self.head["scales"][-1]["wedges"], "S19", "too many wedges")
        self.wedge_point.append(point)
        self.values.append([[0] * COMPONENTS[a["kind"]] for a in self.head["attributes"]])
        self.pending.append(pending)
        if pending:
            self.fresh.append(len(self.wedge_point) - 1)
        return len(self.wedge_point) - 1

    def new_face(self, wedges, group):
        require(len(self.faces) < self.head["scales"][-1]["faces"], "S19", "too many faces")
        self.faces.append(list(wedges))
        self.face_group.append(group)
        for c, w in enumerate(wedges):
            self.corners_of[self.wedge_point[w]].insert(0, (len(self.faces) - 1, c))
        return len(self.faces) - 1

    def degree(self, point):
        return len(self.corners_of[point])

    def w(self, face, corner):
        return self.faces[face][corner % 3]

    def p(self, face, corner):
        return self.wedge_point[self.faces[face][corner % 3]]

    def gather(self, v):
        loose = [Corner(f, c, self.p(f, c + 1), self.p(f, c + 2), self.w(f, c)) for f, c in self.corners_of[v]]
        by_a, ends = {}, {x.b for x in loose}
        for x in reversed(loose):
            by_a.setdefault(x.a, []).append(x)  # popped from the back: in order of the list
        taken = set()
        self.corners, self.fans = [], []
        for only_starts in (True, False):
            for x in loose:
                if x in taken or (only_starts and x.a in ends):
                    continue
                begin = len(self.corners)
                while x:
                    taken.add(x)
                    self.corners.append(x)
                    follow = by_a.get(x.b, [])
                    while follow and follow[-1] in taken:
                        follow.pop()
                    x = follow[-1] if follow else None
                fan = self.corners[begin:]
                self.fans.append((fan, fan[0].a == fan[-1].b))

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
                size = sum(block["parts"])
                data = stream[at : at + size]
                require(len(data) == size, "S08", "a block ends early")
                require(hashlib.sha256(data).digest()[:8] == block["digest"], "S09", "digest of a block")
                at += size
                self.decode_block(block, data)
            done = s["blocks"]
            found = len(self.places), len(self.wedge_point), len(self.faces), len(self.faces) - len(self.triangles())
            expected = s["points"], s["wedges"], s["faces"], s["hidden"]
            require(found == expected, "S19", f"scale {s['scale']}: {found} instead of {expected}")
            yield {"scale": s["scale"], "triangles": s["faces"] - s["hidden"], "wedges": s["wedges"], "bytes": at}

    def decode_block(self, block, data):
        ends = np.cumsum(block["parts"]).tolist()
        parts = [data[end - n : end] for end, n in zip(ends, block["parts"])]
        self.connectivity = Bits(parts[0])
        self.parts = [Part(part, start) for part, start in zip(parts[1:], self.head["models"])]
        if block["patch"]:
            self.gates, end = [], len(self.faces) + block["count"]
            while len(self.faces) < end:
                self.at_gate(*self.gates.pop()) if self.gates else self.seed()
            return
        left = block["count"]
        while left:
            v = self.ask()
            self.step(1)
            asked = self.m["ask"][min(self.degree(v), 13)][self.refusals.get(v, 0)][self.has_split.get(v, 0)]
            self.last = self.bit(asked[self.last])
            if not self.last:
                self.refusals[v] = min(self.refusals.get(v, 0) + 1, 3)
                continue
            self.refusals[v], self.has_split[v], self.progress = 0, 1, 1
            for point in (v, self.split(v)):
                self.enqueue(point)
            for x in self.corners:
                self.enqueue(x.a)
                self.enqueue(x.b)
            left -= 1

    def enqueue(self, point):
        if point not in self.queued:
            self.queued.add(point)
            self.queue.append(point)

    def ask(self):
        if self.next == len(self.queue):
            require(self.progress, "S19", "no point splits")
            self.progress, self.next, self.queue = 0, 0, list(range(len(self.places)))
            self.queued = set(self.queue)
        self.next += 1
        self.queued.discard(self.queue[self.next - 1])
        return self.queue[self.next - 1]

    # 11.7

    def split(self, v):
        self.step(self.degree(v))
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
        self.places[u] = self.parts[0].value(self.child_guess(), 3, self.head["bits"])
        self.fresh_wedges()
        self.parent = self.child = None
        return u

    def moves(self, fan, is_open, later):
        side = turns = run = 0
        n = len(fan)
        for i, x in enumerate(fan):
            turn, valence = 0, clamp(self.degree(x.a), 4, 8) - 4
            if i == 0:
                side = self.bit(self.m["first"][min(n, 11)][later])
            elif turns == 0:
                turn = self.bit(self.m["turn"][is_open][side][min(n - i, 11)][valence])
            elif turns == 1:
                ring = self.m["turn_back"][is_open][side][min(run, 7) - 1]
                turn = self.bit(ring[clamp(n, 3, 10) - 3][valence])
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
            for w in self.targets:
                if (not known or w != self.mapped[x.wedge]) and self.bit(self.m["listed"]):
                    x.target = w
                    break
        if x.target is None:
            lost = 0 if any(not y.moves and y.wedge == x.wedge for y in self.corners) else 1
            copied = self.bit(self.m["target_copied"][lost])
            x.target = self.new_wedge(self.child, not copied)
            if copied:
                self.values[x.target] = [list(value) for value in self.values[x.wedge]]
            self.targets.append(x.target)
        if not known:
            self.mapped[x.wedge] = x.target

    def edge(self, last, following):
        one = following or last
        x = following.a if following else last.b
        kind = (1 if last.moves != following.moves else 0) if last and following else 3 if one.moves else 2
        made = 0
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
        expected = self.m["corner_expected"]
        wv = self.wedge(expected_v, expected[0][seam], self.parent)
        wu = self.wedge(expected_u, expected[1][seam], self.child)
        wx = self.wedge(expected_x, expected[2][seam], x)
        group = self.group(beside)
        self.new_face((wv, wx, wu) if forward else (wv, wu, wx), group)

    def wedge(self, expected, model, p):
        if expected is not None and self.bit(model):
            return expected
        lists = [x.wedge for x in self.corners] if p == self.parent else []
        if p == self.child:
            lists += self.targets
        else:
            self.step(self.degree(p))
            lists += [self.w(f, c) for f, c in self.corners_of[p]]
        offered = {expected}
        for w in lists:
            if w not in offered:
                offered.add(w)
                if self.bit(self.m["listed"]):
                    return w
        w = self.new_wedge(p)
        if p == self.child:
            self.targets.append(w)
        return w

    def group(self, beside):
        if beside is not None and self.bit(self.m["same_group"]):
            return self.face_group[beside]
        return self.index(len(self.head["groups"]))

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
                guess = self.places[before] if self.places else [0, 0, 0]
                points.append(self.placed_point(guess))
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
        self.step(self.degree(point))
        self.gather(point)
        return next(fan for fan in self.fans if any(x.face == face for x in fan[0]))

    def at_gate(self, f, c):
        a, b, d = self.p(f, c), self.p(f, c + 1), self.p(f, c + 2)
        fan, closed = self.fan_with(a, f)
        if closed or fan[0].face != f:
            return
        l, sl = fan[-1], min(len(fan), 8) - 1
        fan, _ = self.fan_with(b, f)
        r, sr = fan[0], min(len(fan), 8) - 1
        if not self.bit(self.m["gate_open"][sl][sr]):
            return
        self.fresh = []
        wb = self.wedge(self.w(f, c + 1), self.m["patch_expected"][0], b)
        wa = self.wedge(self.w(f, c), self.m["patch_expected"][1], a)
        self.add((wb, wa, self.third(a, b, d, l, sl, r, sr)), f)

    def third(self, a, b, d, l, sl, r, sr):
        if self.bit(self.m["third_new"][sl][sr]):
            pa, pb, pd = self.places[a], self.places[b], self.places[d]
            return self.new_wedge(self.placed_point([pa[k] + pb[k] - pd[k] for k in range(3)]))
        if l.b != b and self.bit(self.m["third_left"][sl][sr]):
            return self.wedge(self.w(l.face, l.corner + 2), self.m["patch_expected"][2], l.b)
        if r.a != a and r.a != l.b and self.bit(self.m["third_right"]):
            return self.wedge(self.w(r.face, r.corner + 1), self.m["patch_expected"][3], r.a)
        p = self.index(len(self.places))
        require(p not in (a, b), "S22", "a face with a point twice")
        return self.wedge(None, None, p)

    # 11.9

    def child_guess(self):
        points = [self.places[self.p(f, c + k)] for f, c in self.corners_of[self.child] for k in (1, 2)]
        return mean(points) if points else self.places[self.parent]

    def fresh_wedges(self):
        for w in self.fresh:
            p, twin, beside = self.wedge_point[w], None, []
            self.step(self.degree(p))
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
        def place(w):
            return tuple(self.places[self.wedge_point[w]])
        return [f for f, face in enumerate(self.faces) if len({place(w) for w in face}) == 3]

    def positions(self):
        return on_grid(self.places, self.head["grid"], self.head["bits"])

    def attribute(self, k):
        a, numbers = self.head["attributes"][k], [v[k] for v in self.values]
        if a["kind"] < 2:
            return on_grid(numbers, a["grid"], a["bits"])
        if a["kind"] == 3:
            return np.float32(numbers) / np.float32((1 << a["bits"]) - 1)
        x = np.float32([octahedron(u, v, a["bits"]) for u, v in numbers])
        length = np.sqrt(x[:, 0] * x[:, 0] + x[:, 1] * x[:, 1] + x[:, 2] * x[:, 2])
        up = np.float32([0, 0, 1])
        return np.where(length[:, None] > 0, x / np.where(length > 0, length, np.float32(1))[:, None], up)


def on_grid(numbers, grid, bits):
    step = grid[-1] / np.float32((1 << bits) - 1)
    return np.float32(numbers) * step + grid[:-1]


def mean(values):
    n = len(values)
    return [(2 * sum(column) + n) // (2 * n) for column in zip(*values)]


def octahedron(u, v, bits):
    c = (1 << (bits - 1)) - 1
    x, y = u - c, v - c
    z = c - abs(x) - abs(y)
    if z < 0:
        x, y = fold(x, y, c)
    return x, y, z


def fold(x, y, c):
    return (c - abs(y)) * (-1 if x < 0 else 1), (c - abs(x)) * (-1 if y < 0 else 1)


def mean_normal(values, bits):
    c = (1 << (bits - 1)) - 1
    x, y, z = (sum(column) for column in zip(*(octahedron(u, v, bits) for u, v in values)))
    total = abs(x) + abs(y) + abs(z)
    if total == 0:
        return c, c
    x, y = ((abs(s) * c // total) * (-1 if s < 0 else 1) for s in (x, y))
    if z < 0:
        x, y = fold(x, y, c)
    return x + c, y + c
