"""Joins images side by side, with captions."""

from collections.abc import Sequence
from typing import Final

from PIL import Image, ImageDraw, ImageFont

GAP_PX: Final = 8
CAPTION_PX: Final = 16
TEXT_COLOR: Final = (38, 40, 43)


def sheet(panels: Sequence[Image.Image], captions: Sequence[str] = ()) -> Image.Image:
    """Joins panels of equal height from left to right, each above its caption."""
    height = panels[0].height + (2 * CAPTION_PX if captions else 0)
    whole = Image.new("RGB", (sum(panel.width + GAP_PX for panel in panels) - GAP_PX, height), "white")
    draw, font = ImageDraw.Draw(whole), ImageFont.load_default(CAPTION_PX)
    left_px = 0
    for number, panel in enumerate(panels):
        whole.paste(panel, (left_px, 0))
        if captions:
            draw.text((left_px + 2, panel.height + CAPTION_PX), captions[number], TEXT_COLOR, font, anchor="lm")
        left_px += panel.width + GAP_PX
    return whole
