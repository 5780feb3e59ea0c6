"""Draws line plots as small SVG files."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import escape

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 640, 360, 64, 16, 36, 48
COLORS = ("#1b6ca8", "#c8553d", "#4c8c4a", "#7d5ba6")
Point = tuple[float, float]


def plot(path: Path, title: str, x_label: str, y_label: str, lines: Mapping[str, Sequence[Point]]) -> None:
    """Draws a plot with a logarithmic x axis and y from 0."""
    points = [point for line in lines.values() for point in line]
    x_low, x_high = min(x for x, _ in points), max(x for x, _ in points)
    step = _step(max(y for _, y in points))
    y_high = step * math.ceil(max(y for _, y in points) / step)

    def at(x: float, y: float) -> tuple[float, float]:
        share = 0.5 if x_high == x_low else math.log(x / x_low) / math.log(x_high / x_low)
        return LEFT + share * (WIDTH - LEFT - RIGHT), HEIGHT - BOTTOM - y / y_high * (HEIGHT - TOP - BOTTOM)

    parts = [_text(WIDTH / 2, 22, title, "middle", 15), _text((LEFT + WIDTH) / 2, HEIGHT - 10, x_label, "middle"), _text(8, TOP - 8, y_label)]
    for k in range(round(y_high / step) + 1):
        _, y = at(x_low, k * step)
        parts.append(f'<path d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>')
        parts.append(_text(LEFT - 6, y + 4, f"{k * step:g}", "end"))
    for x in sorted({x for x, _ in points}):
        parts.append(_text(at(x, 0)[0], HEIGHT - BOTTOM + 18, f"{x:.3g}", "middle"))
    for number, (name, line) in enumerate(lines.items()):
        color, places = COLORS[number % len(COLORS)], [at(x, y) for x, y in line]
        parts.append(f'<polyline points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in places)}" fill="none" stroke="{color}" stroke-width="2"/>')
        parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{color}"/>' for x, y in places]
        if len(lines) > 1:
            parts.append(_text(WIDTH - RIGHT, HEIGHT - BOTTOM - 10 - 18 * (len(lines) - 1 - number), name, "end", color=color))
    body = "\n".join(parts)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif">\n'
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>\n{body}\n</svg>\n'
    )


def _step(high: float) -> float:
    """Returns 1, 2 or 5 times a power of ten, for four to ten steps."""
    power = 10.0 ** math.floor(math.log10(high / 4))
    return max(power * factor for factor in (1, 2, 5) if power * factor <= high / 4)


def _text(x: float, y: float, text: str, anchor: str = "start", size: int = 12, color: str = "#333") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}" fill="{color}">{escape(text)}</text>'
