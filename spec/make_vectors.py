"""Writes spec/vectors/*.json from the formulas of the spec's pages and nothing else, and the kinds of layers into the manifest's schema.

Deterministic; run by `make bless`."""

import base64
import json
import math
import random
import re
import struct
from pathlib import Path

import data_tile

HERE = Path(__file__).parent / "vectors"
EXACT = {0: (1.0, 0.0), 90: (0.0, 1.0), 180: (-1.0, 0.0), 270: (0.0, -1.0)}
HALF = {
    30: (None, 0.5),
    150: (None, 0.5),
    210: (None, -0.5),
    330: (None, -0.5),
    60: (0.5, None),
    300: (0.5, None),
    120: (-0.5, None),
    240: (-0.5, None),
}


def cos_sin(deg):
    deg %= 360
    if deg in EXACT:
        return EXACT[deg]
    c, s = HALF.get(deg, (None, None))
    rad = math.radians(deg)
    return (math.cos(rad) if c is None else c, math.sin(rad) if s is None else s)


def axes(look_at, pitch):
    ca, sa = cos_sin(look_at)
    cp, sp = cos_sin(pitch)
    return (ca, sa, 0.0), (-sp * sa, sp * ca, cp), (-cp * sa, cp * ca, -sp)


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def view_id(look_at, pitch):
    def short(v):
        return str(int(v)) if v == int(v) else repr(float(v))

    return f"{short(look_at)}-{short(pitch)}"


def pin(lo, hi, tile_px, res_m, views, window=None):
    c = [(a + b) / 2 for a, b in zip(lo, hi, strict=True)]
    h = [(b - a) / 2 * 1.05 for a, b in zip(lo, hi, strict=True)]
    h[2] = max(h[2], (hi[2] - lo[2]) / 2 + 100.0)
    flat = math.hypot(h[0], h[1])
    extent = 2 * flat
    for _, pitch in views:
        cp, sp = cos_sin(pitch)
        extent = max(extent, 2 * (sp * flat + cp * h[2]))
    if window is not None:
        extent = window[2]
    zmax = 0
    while tile_px * res_m * 2**zmax < extent:
        zmax += 1
    size = tile_px * res_m * 2**zmax
    half_diagonal = math.sqrt(h[0] ** 2 + h[1] ** 2 + h[2] ** 2)
    m = c if window is None else [window[0], window[1], c[2]]
    out = []
    for look_at, pitch in views:
        r, u, d = axes(look_at, pitch)
        out.append(
            {
                "id": view_id(look_at, pitch),
                "look_at_deg": look_at,
                "pitch_deg": pitch,
                "u0_m": dot(r, m) - size / 2,
                "v0_m": dot(u, m) + size / 2,
                "d0_m": dot(d, c) - half_diagonal - 1000,
            }
        )
    return {"zmax": zmax, "size_m": size, "views": out}


def views_vectors():
    rows = []
    for a, p in [(0, 45), (45, 22.5), (90, 10), (180, 90), (270, 45), (37.5, 60), (330, 30), (359.9, 0.5)]:
        r, u, d = axes(a, p)
        points = []
        for x in [(0, 0, 0), (100, 0, 0), (0, 100, 0), (0, 0, 100), (-1234.5, 678.25, 41.125)]:
            points.append({"local": x, "uvd": [dot(r, x), dot(u, x), dot(d, x)]})
        rows.append({"look_at_deg": a, "pitch_deg": p, "id": view_id(a, p), "right": r, "up": u, "forward": d, "points": points})
    return rows


def frames_vectors():
    rows = []
    for lo, hi, tile_px, res, views in [
        ([-120, -80, 0], [130, 90, 22.5], 256, 0.2, [(0, 45), (90, 45), (180, 45), (270, 45)]),
        ([0, 0, 0], [1, 1, 1], 512, 1.0, [(45, 22.5)]),
        ([-3500, -3500, -5], [3500, 3500, 180], 256, 0.1, [(0, 10), (0, 90)]),
    ]:
        rows.append({"box": [lo, hi], "tile_px": tile_px, "res_m": res, "views_deg": views, "pinned": pin(lo, hi, tile_px, res, views)})
    return rows


def windows_vectors():
    rows = []
    for lo, hi, tile_px, res, views, window in [
        ([-120, -80, 0], [130, 90, 22.5], 256, 0.2, [(0, 45), (37.5, 60)], [10, -20, 51.2]),
        ([-3500, -3500, -5], [3500, 3500, 180], 256, 0.0625, [(0, 45), (180, 90)], [-12.5, 800, 4096]),
        ([0, 0, 0], [1000, 1000, 10], 512, 0.1, [(45, 22.5)], [500, 500, 3]),
    ]:
        pinned = pin(lo, hi, tile_px, res, views, window)
        rows.append({"box": [lo, hi], "tile_px": tile_px, "res_m": res, "views_deg": views, "window": window, "pinned": pinned})
    return rows


def morton(x, y):
    return sum(((x >> i) & 1) << 2 * i | ((y >> i) & 1) << 2 * i + 1 for i in range(26))


def tiles_vectors():
    frame = frames_vectors()[0]["pinned"]
    rows = []
    for z, x, y, i, j in [(0, 0, 0, 0, 0), (3, 1, 6, 255, 0), (frame["zmax"], 3, 2, 17, 200), (1, 1, 1, 128, 128)]:
        px = frame["size_m"] / (256 * 2**z)
        v = frame["views"][1]
        rows.append(
            {
                "tile": [z, x, y],
                "pixel": [i, j],
                "u": v["u0_m"] + (x * 256 + i + 0.5) * px,
                "v": v["v0_m"] - (y * 256 + j + 0.5) * px,
                "morton": morton(x, y),
                "parent": [z - 1, x // 2, y // 2] if z else None,
            }
        )
    return {"frame": frame, "view": 1, "tile_px": 256, "rows": rows}


def occupancy(zmax, base):
    """base: set of occupied (x, y) at level zmax."""
    levels = [set() for _ in range(zmax + 1)]
    levels[zmax] = set(base)
    for z in range(zmax, 0, -1):
        levels[z - 1] = {(x // 2, y // 2) for x, y in levels[z]}
    bits = [1 if levels[0] else 0]
    for z in range(zmax):
        for x, y in sorted(levels[z], key=lambda t: morton(*t)):
            bits += [int((2 * x + dx, 2 * y + dy) in levels[z + 1]) for dy in (0, 1) for dx in (0, 1)]
    data = bytearray((len(bits) + 7) // 8)
    for k, bit in enumerate(bits):
        data[k // 8] |= bit << (k % 8)
    return base64.b64encode(bytes(data)).decode()


def occupancy_vectors():
    cases = [(0, []), (0, [(0, 0)]), (2, [(0, 0), (3, 3), (1, 2)]), (3, [(x, y) for x in range(8) for y in range(8) if (x * 7 + y * 3) % 5 == 0])]
    return [{"zmax": z, "occupied": sorted(b, key=lambda t: morton(*t)), "base64": occupancy(z, b)} for z, b in cases]


def data_vectors():
    ids = [0, 1, 255, 256, 65536, 0x01020304, 0xFFFFFFFF]
    normals = [(0, 0, 1), (1, 0, 0), (0, -1, 0), (-0.6, 0, 0.8)]
    return {
        "uint32": [{"value": v, "rgba": list(v.to_bytes(4, "little"))} for v in ids],
        "normal": [{"n": n, "rgb": [math.floor((c + 1) / 2 * 255 + 0.5) for c in n]} for n in normals],
    }


def slanted(width, height, faces, right, down):
    """Columns of `faces` objects in turn, each on a plane of its own; the last one has no surface."""
    tile = {"width": width, "height": height, "normal": [], "id": [], "depth": []}
    for y in range(height):
        for x in range(width):
            k = x * faces // width
            is_empty = k == faces - 1
            tile["normal"].append(0 if is_empty else (0x80FF80, 0x8080FF)[k % 2])
            tile["id"].append(0 if is_empty else 1000 + k // 2)
            tile["depth"].append(0xFFFFFFFF if is_empty else 70000 * (k + 1) + (right * x + down * y) // 7)
    return tile


def noisy(width, height, seed, limit):
    """Random pixels with ids below 3 and depths below `limit`; some have no depth."""
    draw = random.Random(seed)
    count = width * height
    depths = [draw.choice((0xFFFFFFFF, draw.randrange(limit))) for _ in range(count)]
    return {
        "width": width,
        "height": height,
        "normal": [draw.choice((0, 0xFF8080, 0xFFFFFF)) for _ in range(count)],
        "id": [draw.choice((0, 1, 0xFFFFFFFF)) for _ in range(count)],
        "depth": depths,
    }


def filled(width, height, normal, id_, depth):
    values = {"normal": normal, "id": id_, "depth": depth}
    return {"width": width, "height": height, **{key: [value] * (width * height) for key, value in values.items()}}


def data_tile_vectors():
    """Tiles with their pixels, and bytes that readers refuse."""
    bumpy = slanted(20, 12, 3, -90, 333)
    bumpy["depth"] = [depth if depth == 0xFFFFFFFF else depth + k * k % 5 for k, depth in enumerate(bumpy["depth"])]
    tiles = {
        "one pixel": data_tile.encode(filled(1, 1, 0x8080FF, 7, 123456)),
        "nothing": data_tile.encode(filled(5, 3, 0, 0, 0xFFFFFFFF)),
        "planes": data_tile.encode(slanted(33, 9, 6, 700, -55)),
        "planes without slopes": data_tile.encode(slanted(8, 9, 3, 30, 2), flat=True),
        "bumps on planes": data_tile.encode(bumpy),
        "bumps, rough": data_tile.encode(bumpy, rough=True),
        "noise": data_tile.encode(noisy(11, 7, 1, 0xFFFFFFFF)),
        "small noise, rough": data_tile.encode(noisy(9, 9, 2, 300), rough=True, flat=True),
        "long runs": data_tile.encode(slanted(700, 2, 2, 70, 9)),
        "largest numbers": data_tile.encode(filled(3, 2, 0xFFFFFF, 0xFFFFFFFF, 0xFFFFFFFE)),
    }
    rows = [{"name": name, "base64": text64(data), **data_tile.decode(data)} for name, data in tiles.items()]
    return {"tiles": rows, "refused": [{"why": why, "base64": text64(data)} for why, data in refused_data_tiles(tiles).items()]}


def refused_data_tiles(tiles):
    """Bytes that break one rule of spec/data-tile.md each."""
    one, planes = tiles["one pixel"], tiles["planes"]

    def tile(codes, lengths=(), labels=1, shapes=(1,), starts=(2 << 14,), fours=b"", residuals=0, rest=b"", width=2, height=1):
        label_columns = bytes(4 * labels) + bytes(3 * labels) + bytes(shapes)
        body = bytes(codes) + data_tile.column(lengths, 2) + label_columns + data_tile.column(starts, 6) + fours + rest
        return data_tile.pack(width, height, body, len(codes), labels, residuals)

    data_tile.decode(tile([6], [4]))
    data_tile.decode(tile([6, 0], [4], height=2))
    rows = {
        "no bytes": b"",
        "half a header": one[:20],
        "another magic": b"N" + one[1:],
        "version 2": one[:3] + b"\x02" + one[4:],
        "no width": one[:4] + b"\0\0" + one[6:],
        "too high": one[:6] + struct.pack("<H", 1025) + one[8:],
        "a body too large": one[:8] + struct.pack("<I", 32) + one[12:],
        "more runs than pixels": one[:12] + struct.pack("<I", 2) + one[16:],
        "no labels": one[:16] + struct.pack("<I", 0) + one[20:],
        "more residuals than pixels": one[:20] + struct.pack("<I", 2) + one[24:],
        "no stream": one[:24],
        "a truncated stream": planes[:-9],
        "a wrong checksum": planes[:-1] + bytes([planes[-1] ^ 1]),
        "a body longer than the header says": one[:8] + struct.pack("<I", struct.unpack("<I", one[8:12])[0] - 1) + one[12:],
        "a body shorter than the header says": one[:8] + struct.pack("<I", struct.unpack("<I", one[8:12])[0] + 1) + one[12:],
        "an unknown bit in a code": tile([22], [4]),
        "source 3": tile([7], [4]),
        "no run above": tile([0]),
        "no second run above": tile([6, 1], [4], height=2),
        "a run without pixels": tile([6, 6], [0, 4], 2, (1, 1), (0, 0)),
        "a run before its start": tile([6], [3]),
        "a run beyond its row": tile([6], [6]),
        "too few runs": tile([6], [2]),
        "too many runs": tile([6, 6], [4, 4], 2, (1, 1), (0, 0)),
        "too few labels": tile([6, 6], [2, 2]),
        "too many labels": tile([6, 0], [4], 2, (1, 1), (0, 0), height=2),
        "an unknown shape": tile([6], [4], shapes=(9,)),
        "rough without depths": tile([6], [4], shapes=(4,)),
        "no slopes to share": tile([6], [4], shapes=(3,)),
        "a start below 0": tile([6], [4], starts=(1,)),
        "a start too large": tile([6], [4], starts=(1 << 47,)),
        "residuals without depths": tile([14], [4], shapes=(0,), starts=(), fours=b"\x11", residuals=2),
        "too few residuals": tile([14], [4], fours=b"\x01", residuals=1),
        "too many residuals": tile([6], [4], fours=b"\x01", residuals=1),
        "four bits too many": tile([14, 6], [2, 2], 2, (1, 1), (0, 0), fours=b"\x11", residuals=1),
        "bytes too many": tile([6], [4], rest=b"\0"),
        "a residual without its byte": tile([14], [4], fours=b"\x1f", residuals=2),
        "a residual without its four bytes": tile([14], [4], fours=b"\x1f", residuals=2, rest=b"\xff\0\0\0"),
    }
    for why, data in rows.items():
        try:
            data_tile.decode(data)
        except ValueError:
            continue
        raise AssertionError(f"the reference reads a tile with {why}")
    return rows


def text64(data):
    return base64.b64encode(data).decode()


def depth_key(bits):
    return bits[3]


def parent_pixel(children):
    """children: four of (color4, normal3, id, depth) in order TL, TR, BL, BR; spec/pyramid.md §7."""
    color = [(sum(c[0][k] for c in children) + 2) // 4 for k in range(4)]
    ids = [c[2] for c in children]
    if ids.count(0) >= 3:
        return {"color": color, "normal": [0, 0, 0], "id": 0, "depth": 0xFFFFFFFF}
    seen = [i for i in dict.fromkeys(ids) if i]
    best = min(seen, key=lambda i: (-ids.count(i), min(c[3] for c in children if c[2] == i), ids.index(i)))
    mine = [c for c in children if c[2] == best]
    total = [sum(c[1][k] for c in mine) for k in range(3)]
    length = math.sqrt(sum(v * v for v in total))
    nearest = list(min(mine, key=depth_key)[1])
    unit = [math.floor(v / length * 32767 + 0.5) for v in total] if length > 0 else nearest
    normal = nearest if length < 1e-6 * 32767 * len(mine) else unit
    return {"color": color, "normal": normal, "id": best, "depth": min(c[3] for c in mine)}


def parent_vectors():
    none = ([0, 0, 0, 0], [0, 0, 0], 0, 0xFFFFFFFF)

    def px(v, n, i, d):
        return ([v, v // 2, v // 3, 65535], n, i, d)

    up, east, down = [0, 0, 32767], [32767, 0, 0], [0, 0, -32767]
    cases = [
        [none] * 4,
        [px(1000, up, 7, 50), none, none, none],
        [px(1000, up, 7, 50), px(2001, up, 7, 40), none, none],
        [px(1000, up, 7, 50), px(2000, east, 8, 40), px(3000, up, 7, 60), px(4000, east, 8, 45)],
        [px(1000, up, 7, 50), px(2000, east, 8, 50), none, none],
        [px(1, up, 9, 5), px(2, down, 9, 6), none, none],
        [px(65535, up, 3, 1), px(65535, east, 3, 2), px(65534, up, 3, 3), px(65535, up, 4, 0)],
    ]
    return [{"children": [{"color": c, "normal": n, "id": i, "depth": d} for c, n, i, d in case], "parent": parent_pixel(case)} for case in cases]


def blocks_vectors():
    """Root levels of the blocks of a pyramid, deepest first: (root level, levels held)."""
    rows = []
    for zmax in range(13):
        root = max(zmax - 3, 0)
        steps = [[root, zmax - root + 1, "base"]]
        while root > 0:
            above = max(root - 3, 0)
            steps.append([above, root - above, "reduce"])
            root = above
        rows.append({"zmax": zmax, "blocks": steps})
    return rows


def geographic_vectors():
    """Example polynomials with all terms of the second degree: positions and the values there."""
    row = {
        "local": [5.0, -3.5],
        "lon_lat": [179.9, -18.25],
        "unit_m": 2500.0,
        "unit_deg": 0.03125,
        "degree": 2,
        "error_m": 0.0,
        "to": [[0.0, 0.024, 0.0011, 2.5e-6, -7e-6, 3e-6], [1e-9, -0.0009, 0.022, -1.5e-6, 4e-6, -8e-6]],
        "back": [[0.001, 3255.0, -160.0, 0.4, 1.25, -0.75], [-0.002, 130.0, 3551.0, 0.3, -0.6, 1.5]],
    }

    def sums(terms, p, q):
        t = (1.0, p, q, p * p, p * q, q * q)
        return [sum(c * v for c, v in zip(row[terms][k], t, strict=True)) for k in (0, 1)]

    points = []
    for x, y in ((5.0, -3.5), (2505.0, -2503.5), (-812.5, 1330.25)):
        to = sums("to", (x - row["local"][0]) / row["unit_m"], (y - row["local"][1]) / row["unit_m"])
        lon_lat = [row["lon_lat"][k] + to[k] for k in (0, 1)]
        back = sums("back", *(to[k] / row["unit_deg"] for k in (0, 1)))
        points.append({"local": [x, y], "lon_lat": lon_lat, "back": [row["local"][k] + back[k] for k in (0, 1)]})
    return {"geographic": row, "points": points}


def search_vectors():
    """Texts and their search words, written by hand."""
    rows = {
        "": [],
        " ,.!? ": [],
        "DEBY_LOD2_4959457": ["deby", "lod2", "4959457"],
        "St. Martin (DEBY_1), Marktplatz 1a": ["st", "martin", "deby", "1", "marktplatz", "1a"],
        "Straße STRASSE ſ": ["strasse", "strasse", "ſ"],
        "Café Œuvre ÅNGSTRÖM": ["cafe", "œuvre", "angstrom"],
        "e\u0301cole": ["ecole"],
        "Rue de l'Église": ["rue", "de", "l", "eglise"],
        "ΟΔΟΣ Улица Ёлка": ["οδος", "улица", "елка"],
        "大通り 3-5": ["大通り", "3", "5"],
        "½ x²": ["½", "x²"],
        "\U00010400 \U0001f600": ["\U00010428"],
    }
    return [{"text": text, "words": words} for text, words in rows.items()]


def cameras_vectors():
    """Rows: a camera, pixel coordinates with a depth, and the local point there."""
    rows = []
    for kind, look_at, pitch, position, window in (
        ("orthographic", 30, 45, (10.0, 20.0, 300.0), (-64.0, 64.0, -48.0, 48.0)),
        ("orthographic", 200, 0, (-5.0, 1.5, 2.0), (-10.0, 30.0, -5.0, 25.0)),
        ("perspective", 0, 0, (0.0, -50.0, 1.7), (-1.0, 1.0, -0.75, 0.75)),
        ("perspective", 300, -60, (3.0, 4.0, -20.0), (-0.25, 0.5, 0.125, 0.875)),
    ):
        right, up, forward = axes(look_at, pitch)
        left, right_edge, bottom, top = window
        size = (1024, 768)
        points = []
        for x, y, depth in ((0.5, 0.5, 10.0), (512.0, 384.0, 250.0), (1000.25, 3.75, 1234.5)):
            a = left + x * (right_edge - left) / size[0]
            b = top - y * (top - bottom) / size[1]
            scale = depth if kind == "perspective" else 1.0
            local = [position[k] + (a * right[k] + b * up[k]) * scale + forward[k] * depth for k in range(3)]
            points.append({"pixel": [x, y], "depth": depth, "local": local})
        camera = {"projection": kind, "position": position, "right": right, "up": up, "forward": forward, "window": window, "size": size}
        rows.append({"camera": camera, "points": points})
    return rows


def write(name, value):
    text = json.dumps(value, indent=None if name == "data-tiles" else 1)
    (HERE / f"{name}.json").write_text(text + "\n")


def write_layers_of_schema():
    """Writes the kinds and formats of spec/layers.json into the manifest's schema."""
    path = HERE.parent / "manifest.schema.json"
    rows = json.loads((HERE.parent / "layers.json").read_text())
    formats = dict.fromkeys(one for row in rows for one in row["formats"])
    text = path.read_text()
    for field, values in [("kind", [row["kind"] for row in rows]), ("format", list(formats))]:
        text = re.sub(rf'"{field}": {{"enum": \[.*?\]}}', f'"{field}": {{"enum": {json.dumps(values)}}}', text)
    path.write_text(text)


def main():
    HERE.mkdir(exist_ok=True)
    write_layers_of_schema()
    for name, value in {
        "views": views_vectors(),
        "frames": frames_vectors(),
        "windows": windows_vectors(),
        "tiles": tiles_vectors(),
        "occupancy": occupancy_vectors(),
        "data": data_vectors(),
        "data-tiles": data_tile_vectors(),
        "parents": parent_vectors(),
        "blocks": blocks_vectors(),
        "geographic": geographic_vectors(),
        "search": search_vectors(),
        "cameras": cameras_vectors(),
    }.items():
        write(name, value)


if __name__ == "__main__":
    main()
