"""Combines pictures side by side on white, with captions."""

from collections.abc import Sequence
from typing import Final

from PIL import Image, ImageDraw, ImageFont

GAP_PX: Final = 8
WORDS_PX: Final = 16
INK: Final = (38, 40, 43)


def sheet(panels: Sequence[Image.Image], words: Sequence[str] = ()) -> Image.Image:
    """Returns panels of equal height from left to right, each with its caption, if any."""
    height = panels[0].height + (2 * WORDS_PX if words else 0)
    whole = Image.new("RGB", (sum(panel.width + GAP_PX for panel in panels) - GAP_PX, height), "white")
    draw, font = ImageDraw.Draw(whole), ImageFont.load_default(WORDS_PX)
    left_px = 0
    for number, panel in enumerate(panels):
        whole.paste(panel, (left_px, 0))
        if words:
            draw.text((left_px + 2, panel.height + WORDS_PX), words[number], INK, font, anchor="lm")
        left_px += panel.width + GAP_PX
    return whole
