"""Plain materials, and the repeating textures that all buildings share."""

from map3d_town.textures.noise_patterns import PackedImage, blend_grey, colorize, crop_noise, masonry_pattern, repeat_pattern

REPEATING_TEXTURE_PX = 256
DIFFUSE_COLORS: dict[str, tuple[float, float, float]] = {
    "ground": (0.45, 0.43, 0.40), "eaves": (0.43, 0.33, 0.25), "cheek": (0.56, 0.53, 0.50), "coping": (0.52, 0.47, 0.43),
    "concrete": (0.72, 0.71, 0.68), "balcony_0": (0.80, 0.80, 0.78), "balcony_1": (0.62, 0.68, 0.70), "block": (0.75, 0.72, 0.68),
    "marble": (0.90, 0.88, 0.82), "masonry": (0.74, 0.68, 0.57), "shed": (0.62, 0.56, 0.48), "felt": (0.38, 0.37, 0.36), "trunk": (0.36, 0.28, 0.21),
}  # fmt: skip


def draw_repeating_texture(name: str) -> PackedImage:
    """Draws a seamless texture, (256, 256) packed, for 4 m of wall or 2 m of a chimney."""
    px_per_m = REPEATING_TEXTURE_PX / 4.0
    base = crop_noise(1024, 1024, 0)[::4, ::4]
    if name == "brick_red":
        pattern = masonry_pattern(px_per_m, 0.125, 4.0 / 12, 42, 20)
        return colorize(blend_grey(repeat_pattern(pattern, REPEATING_TEXTURE_PX, REPEATING_TEXTURE_PX), base), (150, 84, 64), 0.6)
    if name == "stone":
        pattern = masonry_pattern(px_per_m, 0.5, 4.0 / 6, -36, 12)
        return colorize(blend_grey(repeat_pattern(pattern, REPEATING_TEXTURE_PX, REPEATING_TEXTURE_PX), base), (190, 178, 154), 0.55)
    return colorize(base, (214, 204, 186), 0.35)


REPEATING_TEXTURES = ("brick_red", "plaster", "stone")
