"""Reads and writes data tiles by the rules of spec/data-tile.md and nothing else: slow, plain, and independent of the core.

A tile is {"width", "height", "normal", "id", "depth"}: lists row by row, a normal as 0xBBGGRR.
"""

import struct
import zlib

NOTHING = 0xFFFFFFFF
WORD = 1 << 32
FRACTION = 1 << 14


def fold(n):
    return 2 * n if n >= 0 else -2 * n - 1


def unfold(n):
    return -(n + 1) // 2 if n & 1 else n // 2


def require(fact, why):
    if not fact:
        raise ValueError(why)


class Columns:
    """The columns of a body, read one after another."""

    def __init__(self, body):
        self.body, self.at = body, 0

    def take(self, count, size):
        require(self.at + count * size <= len(self.body), "the body is too short")
        part = self.body[self.at : self.at + count * size]
        self.at += count * size
        return [sum(part[k * count + i] << 8 * k for k in range(size)) for i in range(count)]


class Residuals:
    def __init__(self, count, columns):
        self.fours = [four for byte in columns.take((count + 1) // 2, 1) for four in (byte & 15, byte >> 4)]
        require(count % 2 == 0 or self.fours.pop() == 0, "the last four bits are not 0")
        self.rest = columns.body[columns.at :]
        self.done, self.at = 0, 0

    def _take(self, size):
        require(self.at + size <= len(self.rest), "the rest is too short")
        self.at += size
        return int.from_bytes(self.rest[self.at - size : self.at], "little")

    def next(self):
        require(self.done < len(self.fours), "too few residuals")
        n = self.fours[self.done]
        self.done += 1
        if n == 15:
            n += self._take(1)
        if n == 270:
            n += self._take(4)
        return unfold(n % WORD)

    def are_used(self):
        return self.done == len(self.fours) and self.at == len(self.rest)


def inflate(stream, size):
    inflater = zlib.decompressobj()
    try:
        body = inflater.decompress(stream, size + 1)
    except zlib.error as error:
        raise ValueError(f"the zlib stream is damaged: {error}") from error
    require(len(body) == size and inflater.eof and not inflater.unused_data, "the body has another size")
    return body


def decode(data):
    """Returns the tile; raises ValueError for everything that a reader refuses."""
    require(len(data) >= 24 and data[:3] == b"M3D", "not a data tile")
    require(data[3] == 1, f"version {data[3]}, this reader reads version 1")
    width, height, size, run_count, label_count, residual_count = struct.unpack("<HHIIII", data[4:24])
    pixels = width * height
    require(1 <= width <= 1024 and 1 <= height <= 1024 and size <= 31 * pixels, "a header out of range")
    require(height <= run_count <= pixels and 1 <= label_count <= run_count and residual_count <= pixels, "a header out of range")
    columns = Columns(inflate(data[24:], size))
    codes = columns.take(run_count, 1)
    require(all(code < 16 and code & 3 != 3 for code in codes), "an unknown code")
    lengths = iter(columns.take(sum(code >> 2 & 1 for code in codes), 2))
    labels = read_labels(columns, label_count)
    residuals = Residuals(residual_count, columns)
    tile = {"width": width, "height": height, "normal": [0] * pixels, "id": [0] * pixels, "depth": [0] * pixels}
    codes, begun, above = iter(codes), 0, []
    for y in range(height):
        x, row = 0, []
        while x < width:
            code = next(codes, None)
            require(code is not None, "too few runs")
            source = code & 3
            if source == 2:
                require(begun < label_count, "too few labels")
                label, end, begun = labels[begun], x, begun + 1
                begin(label, tile, x, y)
            else:
                at = next((k for k, (_, stop) in enumerate(above) if x < stop), len(above)) + source
                require(at < len(above), "no run above")
                label, end = above[at]
            end += unfold(next(lengths)) if code & 4 else 0
            require(x < end <= width, "a run out of its row")
            paint(tile, label, y, x, end, residuals if code & 8 else None)
            row.append((label, end))
            x = end
        above = row
    require(next(codes, None) is None and begun == label_count, "too many runs or labels")
    require(residuals.are_used(), "too many residuals")
    return tile


def read_labels(columns, count):
    ids, normals, shapes = columns.take(count, 4), columns.take(count, 3), columns.take(count, 1)
    require(all(shape < 8 and shape != 4 for shape in shapes), "an unknown shape")
    own = sum(shape & 3 == 2 for shape in shapes)
    right, down = columns.take(own, 4), columns.take(own, 4)
    starts = iter(columns.take(sum(shape != 0 for shape in shapes), 6))
    slopes = zip(map(unfold, right), map(unfold, down), strict=True)
    labels, before, known = [], 0, {}
    for id_, normal, shape in zip(ids, normals, shapes, strict=True):
        before ^= id_
        label = {"id": before, "normal": normal, "shape": shape, "right": 0, "down": 0, "offset": 0}
        if shape & 3 == 2:
            known[normal] = next(slopes)
        if shape & 3 >= 2:
            require(normal in known, "no slopes to share")
            label["right"], label["down"] = known[normal]
        if shape:
            label["step"] = unfold(next(starts))
        labels.append(label)
    return labels


def depth_near(tile, x, y):
    """The depth from which the start of a label at (x, y) counts."""
    at = y * tile["width"] + x
    near = tile["depth"][at - 1] if x > 0 else tile["depth"][at - tile["width"]] if y > 0 else 0
    return 0 if near == NOTHING else near


def begin(label, tile, x, y):
    label["x"], label["y"] = x, y
    if label["shape"]:
        label["start"] = label["step"] + FRACTION * depth_near(tile, x, y)
        require(0 <= label["start"] < 1 << 46, "a start out of range")


def plane(label, x, y):
    return (label["start"] + label["right"] * (x - label["x"]) + label["down"] * (y - label["y"])) // FRACTION


def paint(tile, label, y, x0, x1, residuals):
    require(label["shape"] or residuals is None, "residuals without depths")
    offset = label["offset"]
    for x in range(x0, x1):
        at = y * tile["width"] + x
        tile["id"][at], tile["normal"][at] = label["id"], label["normal"]
        if not label["shape"]:
            tile["depth"][at] = NOTHING
            continue
        offset = (offset if label["shape"] & 4 else 0) + (residuals.next() if residuals else 0)
        tile["depth"][at] = (plane(label, x, y) + offset) % WORD
        if x == x0 and label["shape"] & 4:
            label["offset"] = offset


# -- writing ----------------------------------------------------------------------------------------------------------------------


def split(tile):
    """Returns the runs of each row as [start, end, label, code, length], and the labels: pixels that touch from row to row and agree in id,
    normal and whether they have a depth."""
    width, labels, rows = tile["width"], [], []
    for y in range(tile["height"]):
        keys = [(tile["id"][at], tile["normal"][at], tile["depth"][at] == NOTHING) for at in range(y * width, (y + 1) * width)]
        above, row, x = rows[-1] if rows else [], [], 0
        while x < width:
            end = next((k for k in range(x, width) if keys[k] != keys[x]), width)
            first = next((k for k, run in enumerate(above) if x < run[1]), 0)
            source = next((k for k in (0, 1) if first + k < len(above) and above[first + k][0] < end and above[first + k][2]["key"] == keys[x]), 2)
            if source == 2:
                labels.append({"key": keys[x], "x": x, "y": y, "runs": []})
            label, expected = (labels[-1], x) if source == 2 else (above[first + source][2], above[first + source][1])
            run = [x, end, label, source | (4 if end != expected else 0), end - expected]
            label["runs"].append((y, x, end))
            row.append(run)
            x = end
        rows.append(row)
    return rows, labels


def fit(tile, label):
    """Returns slopes and start through the label's first pixel and the last ones of its first row and of its column."""
    at = label["y"] * tile["width"] + label["x"]
    first = tile["depth"][at]
    (_, x, end), (low, low_x, low_end) = label["runs"][0], label["runs"][-1]
    right = (tile["depth"][at + end - x - 1] - first) * FRACTION // max(end - x - 1, 1)
    middle = max(low_x, min(x, low_end - 1))
    fall = (tile["depth"][low * tile["width"] + middle] - first) * FRACTION - right * (middle - x)
    down = fall // max(low - label["y"], 1)
    return right, down, first * FRACTION + FRACTION // 2


def encode(tile, rough=False, flat=False):
    """Writes a tile. `rough`: makes all labels rough; `flat`: gives all labels zero slopes."""
    rows, labels = split(tile)
    known, own, starts, shapes, before, ids = {}, [], [], [], 0, []
    limit = 1 << 31
    for label in labels:
        id_, normal, nothing = label["key"]
        ids.append(id_ ^ before)
        before = id_
        label.update(id=id_, normal=normal, offset=0, shape=0, right=0, down=0)
        if not nothing:
            right, down, start = fit(tile, label)
            if flat or not (-limit <= right < limit and -limit <= down < limit):
                right, down = 0, 0
            shape = 1 if (right, down) == (0, 0) else 3 if known.get(normal) == (right, down) else 2
            if shape == 2:
                known[normal] = right, down
                own.append((right, down))
            label.update(right=right, down=down, start=start, shape=shape | (4 if rough else 0))
            starts.append(fold(start - FRACTION * depth_near(tile, label["x"], label["y"])))
        shapes.append(label["shape"])
    residuals = [n for y, row in enumerate(rows) for run in row for n in residuals_of(tile, run, y)]
    runs = [run for row in rows for run in row]
    fours, rest = [], b""
    for n in residuals:
        fours.append(min(n, 15))
        if n >= 15:
            rest += bytes([min(n - 15, 255)])
        if n >= 270:
            rest += struct.pack("<I", n - 270)
    fours += [0] * (len(fours) % 2)
    body = b"".join(
        [
            column([run[3] for run in runs], 1),
            column([fold(run[4]) for run in runs if run[3] & 4], 2),
            column(ids, 4),
            column([label["normal"] for label in labels], 3),
            column(shapes, 1),
            column([fold(right) for right, _ in own], 4),
            column([fold(down) for _, down in own], 4),
            column(starts, 6),
            bytes(low | high << 4 for low, high in zip(fours[::2], fours[1::2], strict=True)),
            rest,
        ]
    )
    return pack(tile["width"], tile["height"], body, len(runs), len(labels), len(residuals))


def residuals_of(tile, run, y):
    """Returns the folded residuals of a run, none if all are 0; sets bit 3 of its code."""
    x0, x1, label = run[:3]
    if not label["shape"]:
        return []
    offset, found = label["offset"], []
    for x in range(x0, x1):
        own = (tile["depth"][y * tile["width"] + x] - plane(label, x, y) + WORD // 2) % WORD - WORD // 2
        residual = (own - (offset if label["shape"] & 4 else 0) + WORD // 2) % WORD - WORD // 2
        found.append(fold(residual))
        offset = own
        if x == x0 and label["shape"] & 4:
            label["offset"] = own
    if not any(found):
        return []
    run[3] |= 8
    return found


def column(numbers, size):
    return bytes(n >> 8 * k & 255 for k in range(size) for n in numbers)


def pack(width, height, body, runs, labels, residuals, version=1):
    return b"M3D" + bytes([version]) + struct.pack("<HHIIII", width, height, len(body), runs, labels, residuals) + store(body)


def store(body):
    """Returns a zlib stream of stored blocks, which is the same with every library."""
    out = b"\x78\x01"
    parts = [body[at : at + 65535] for at in range(0, len(body), 65535)] or [b""]
    for k, part in enumerate(parts):
        out += bytes([k == len(parts) - 1]) + struct.pack("<HH", len(part), len(part) ^ 0xFFFF) + part
    return out + struct.pack(">I", zlib.adler32(body))
