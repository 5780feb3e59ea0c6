import type { Mode } from "../drawer";
import { TINT_OPACITY, DIM_GREY } from "../drawStyle";
import { GUTTER } from "./textures";

/** A combination of features; each has a program, compiled when it is first used. */
export interface ShaderVariant {
  readonly mode: Mode;
  readonly masked: boolean;
  readonly highlight: boolean;
  /** Whether objects have styles. */
  readonly styled: boolean;
  /** The layer with shadows, if any. */
  readonly shadow: "sun" | "sun16" | null;
  readonly occlusion: boolean;
  /** Whether the pass is combined with others by depth. */
  readonly combined: boolean;
  /** GLSL that reads estimated light (see `LightEstimator`); empty: all light was rendered. */
  readonly estimate: string;
}

export const variantName = (v: ShaderVariant): string =>
  [
    v.mode,
    v.masked && "masked",
    v.highlight && "highlight",
    v.styled && "styled",
    v.shadow,
    v.occlusion && "ao",
    v.combined && "combined",
    v.estimate && "estimated",
  ]
    .filter(Boolean)
    .join("+");

export function makeFragmentShader({ mode, masked, highlight, styled, shadow, occlusion, combined, estimate }: ShaderVariant): string {
  const names = [
    `MODE_${mode === "picture" ? "COLOR" : mode.toUpperCase()}`,
    masked && "MASKED",
    highlight && "HIGHLIGHT",
    styled && "STYLED",
    shadow && `SHADOW_${shadow.toUpperCase()}`,
    occlusion && "OCCLUSION",
    combined && "COMBINED",
    estimate && "ESTIMATED",
  ];
  const defines = names.filter(Boolean).map((name) => `#define ${String(name)}`);
  return ["#version 300 es", ...defines, HEAD, ID_LOOKUP, DEPTH, estimate, COLOR, FALSE_COLOR, HIGHLIGHT, COMBINED, MAIN].join("\n");
}

const HEAD = `
#define GUTTER ${String(GUTTER)}
precision highp float;
precision highp int;
precision highp usampler2D;
precision highp sampler2D;
uniform float u_height;   // of the screen
uniform vec2 u_origin;    // of the tile
uniform float u_scale;    // texels per pixel
uniform ivec4 u_bounds;   // texels that may be read, including the filled parts of the gutter
uniform int u_size;       // texels per side
uniform float u_opacity;
uniform vec3 u_sun;       // unit vector towards the light
uniform vec3 u_sky;       // linear ambient light
uniform vec3 u_beam;      // linear sunlight on a surface that faces it
uniform vec2 u_range;     // depth
uniform sampler2D u_color;
uniform sampler2D u_normal;
uniform usampler2D u_id;
uniform usampler2D u_depth;
out vec4 o_color;

vec3 linear(vec3 c) { return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c)); }
vec3 srgb(vec3 c) { return mix(c * 12.92, 1.055 * pow(max(c, 0.0031308), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c)); }
ivec2 clampToTile(ivec2 at) { return clamp(at, ivec2(0), ivec2(u_size - 1)) + GUTTER; }
`;

/** Lookup in tables of ids with open addressing: R is the id, G its value; an empty slot ends the search. */
const ID_LOOKUP = `
#if defined(HIGHLIGHT) || defined(STYLED)
/** mask: number of slots − 1. */
uint find(usampler2D table, uint id, uint mask, int probes) {
  if (id == 0u) return 0u;
  uint width = uint(textureSize(table, 0).x);
  uint slot = (id * 2654435769u >> 7) & mask;
  for (int k = 0; k < probes; k++) {
    uvec2 entry = texelFetch(table, ivec2(slot % width, slot / width), 0).rg;
    if (entry.x == id) return entry.y;
    if (entry.x == 0u) return 0u;
    slot = (slot + 1u) & mask;
  }
  return 0u;
}

vec3 rgbOf(uint word) { return vec3(uvec3(word, word >> 8, word >> 16) & 255u) / 255.0; }
#endif

#ifdef STYLED
uniform usampler2D u_styles;
uniform uint u_styleMask;
uniform int u_styleProbes;
uniform uint u_others;    // style of ids that are not in the table

vec4 applyStyle(vec4 c, uint id) {
  uint word = find(u_styles, id, u_styleMask, u_styleProbes);
  uint kind = (word == 0u && id != 0u ? u_others : word) >> 24;
  if (kind == 1u) c.rgb = mix(c.rgb, rgbOf(word), ${String(TINT_OPACITY)});
  else if (kind == 3u) c.rgb = mix(vec3(dot(c.rgb, vec3(0.2126, 0.7152, 0.0722))), vec3(${String(DIM_GREY[0])}), ${String(DIM_GREY[1])});
  else if (kind == 4u) c.a = 0.0;
  return c;
}
#endif
`;

const DEPTH = `
#if defined(COMBINED) || defined(ESTIMATED)
uniform vec2 u_depths;    // fraction of the range at depth value 0, and per value
const uint NONE = 0xffffffffu;
uniform uint u_maxStep;     // largest difference of values between neighbours on one surface
uint depthAt(ivec2 texel) { return texelFetch(u_depth, clamp(texel, u_bounds.xy, u_bounds.zw) + GUTTER, 0).r; }

/** Interpolates between the four nearest texels if they are on one surface. A partly covered pixel without a depth takes the nearest one around it. */
float depthFraction(vec2 texel) {
  ivec2 at = ivec2(floor(texel - 0.5));
  vec2 f = texel - 0.5 - vec2(at);
  uvec4 four = uvec4(depthAt(at), depthAt(at + ivec2(1, 0)), depthAt(at + ivec2(0, 1)), depthAt(at + 1));
  uint d = min(min(four.x, four.y), min(four.z, four.w));
  vec4 more = vec4(four - d);
  if (max(max(four.x, four.y), max(four.z, four.w)) - d > u_maxStep || d == NONE) {
    at = ivec2(floor(texel));
    d = depthAt(at);
    if (d == NONE) for (int k = 0; k < 9; k++) d = min(d, depthAt(at + ivec2(k % 3 - 1, k / 3 - 1)));
    more = vec4(0.0);
  }
  return d == NONE ? 1.0 : u_depths.x + (float(d) + mix(mix(more.x, more.y, f.x), mix(more.z, more.w, f.x), f.y)) * u_depths.y;
}
#endif
`;

/**
 * Averages colour premultiplied, and in linear light when lit: shades first, filters then.
 *
 * A tile's colours are averages over pixels, but its normals are those of the pixels' centres: lit by its own normal
 * alone, a pixel at the edge of a bright shaded wall shines. Therefore light is spread, half from the pixel and an
 * eighth from each neighbour; compared with pictures lit before averaging, this gains 2 to 3 dB at edges.
 */
const COLOR = `
#if defined(MODE_LIT) || defined(MODE_COLOR)
ivec2 withGutter(ivec2 texel) { return clamp(texel, u_bounds.xy, u_bounds.zw) + GUTTER; }

vec4 colorAt(ivec2 texel) {
  ivec2 at = withGutter(texel);
  vec4 c = texelFetch(u_color, at, 0);
#ifdef MASKED
  c.a = texelFetch(u_id, at, 0).r == 0u ? 0.0 : 1.0;
#endif
#ifdef STYLED
  c = applyStyle(c, texelFetch(u_id, at, 0).r);
#endif
  return c;
}

#ifdef MODE_LIT
#ifdef OCCLUSION
uniform sampler2D u_ao;
#endif
#ifdef SHADOW_SUN
uniform sampler2D u_shadow;
float sunFraction(ivec2 at) { return texelFetch(u_shadow, at, 0).r; }
#endif
#ifdef SHADOW_SUN16
uniform usampler2D u_shadow;
uniform uvec2 u_suns;     // indices of the two suns
uniform float u_share;    // weight of the second
float sunFraction(ivec2 at) {
  uvec2 lit = uvec2(texelFetch(u_shadow, at, 0).r) >> u_suns & uvec2(1u);
  return mix(float(lit.x), float(lit.y), u_share);
}
#endif

#ifdef ESTIMATED
vec2 g_estimate;
#endif

/** Fractions of skylight and sunlight; negative where there is no normal. */
vec2 lambert(ivec2 texel) {
  ivec2 at = withGutter(texel);
  vec3 n = texelFetch(u_normal, at, 0).rgb;
  if (n == vec3(0.0)) return vec2(-1.0);
  vec2 light = vec2(1.0, max(0.0, dot(normalize(n * 2.0 - 1.0), u_sun)));
#ifdef OCCLUSION
  light.x = texelFetch(u_ao, at, 0).r;
#endif
#if defined(SHADOW_SUN) || defined(SHADOW_SUN16)
  light.y *= sunFraction(at);
#endif
#ifdef ESTIMATED
  light *= g_estimate;
#endif
  return light;
}

vec2 orOwn(vec2 light, vec2 own) { return light.x < 0.0 ? own : light; }

vec2 spread(vec2 own, vec2 left, vec2 right, vec2 above, vec2 below) {
  if (own.x < 0.0) return vec2(1.0, 0.5);
  return 0.5 * own + 0.125 * (orOwn(left, own) + orOwn(right, own) + orOwn(above, own) + orOwn(below, own));
}

vec4 lit(ivec2 texel, vec2 light) {
  vec4 c = colorAt(texel);
  return vec4(linear(c.rgb) * (light.x * u_sky + light.y * u_beam) * c.a, c.a);
}

vec4 shadeTexel(ivec2 at) {
  return lit(at, spread(lambert(at), lambert(at - ivec2(1, 0)), lambert(at + ivec2(1, 0)), lambert(at - ivec2(0, 1)), lambert(at + ivec2(0, 1))));
}

/** Interpolates 2 × 2 texels from at; their light comes from 4 × 4 without the corners. */
vec4 interpolate(ivec2 at, vec2 f) {
  vec2 n0 = lambert(at + ivec2(0, -1)), n1 = lambert(at + ivec2(1, -1));
  vec2 w0 = lambert(at + ivec2(-1, 0)), a = lambert(at), b = lambert(at + ivec2(1, 0)), e0 = lambert(at + ivec2(2, 0));
  vec2 w1 = lambert(at + ivec2(-1, 1)), c = lambert(at + ivec2(0, 1)), d = lambert(at + 1), e1 = lambert(at + ivec2(2, 1));
  vec2 s0 = lambert(at + ivec2(0, 2)), s1 = lambert(at + ivec2(1, 2));
  vec4 top = mix(lit(at, spread(a, w0, b, n0, c)), lit(at + ivec2(1, 0), spread(b, a, e0, n1, d)), f.x);
  vec4 bottom = mix(lit(at + ivec2(0, 1), spread(c, w1, d, a, s0)), lit(at + 1, spread(d, c, e1, b, s1)), f.x);
  return mix(top, bottom, f.y);
}
#else
vec4 shadeTexel(ivec2 at) {
  vec4 c = colorAt(at);
  return vec4(c.rgb * c.a, c.a);
}

vec4 interpolate(ivec2 at, vec2 f) {
  return mix(mix(shadeTexel(at), shadeTexel(at + ivec2(1, 0)), f.x), mix(shadeTexel(at + ivec2(0, 1)), shadeTexel(at + 1), f.x), f.y);
}
#endif

vec4 surfaceColor(vec2 texel) {
  vec2 corner = floor(texel - 0.5), f = texel - 0.5 - corner;
  ivec2 at = ivec2(corner);
  f = mix(f, round(f), lessThan(abs(f - round(f)), vec2(0.004)));
#if !defined(MODE_LIT) && !defined(MASKED) && !defined(STYLED)
  // Where all four texels are opaque, the texture unit interpolates as well, in a quarter of the time.
  if (all(greaterThanEqual(at, u_bounds.xy)) && all(lessThan(at, u_bounds.zw)) && f != vec2(0.0) && f != vec2(1.0)) {
    vec4 mixed = texture(u_color, (texel + float(GUTTER)) / vec2(textureSize(u_color, 0)));
    if (mixed.a == 1.0) return mixed;
  }
#endif
  vec4 c = f == vec2(0.0) || f == vec2(1.0) ? shadeTexel(at + ivec2(f)) : interpolate(at, f);
  if (c.a == 0.0) return vec4(0.0);
#ifdef MODE_LIT
  return vec4(srgb(clamp(c.rgb / c.a, 0.0, 1.0)), c.a);
#else
  return vec4(c.rgb / c.a, c.a);
#endif
}
#endif
`;

const FALSE_COLOR = `
#ifdef MODE_NORMAL
vec4 surfaceColor(vec2 texel) {
  vec3 n = texelFetch(u_normal, clampToTile(ivec2(floor(texel))), 0).rgb;
  return vec4(n, n == vec3(0.0) ? 0.0 : 1.0);
}
#endif
#ifdef MODE_ID
vec4 surfaceColor(vec2 texel) {
  uint id = texelFetch(u_id, clampToTile(ivec2(floor(texel))), 0).r;
  uint h = id * 2654435769u;
  vec3 hue = 0.5 + 0.5 * cos(6.2831853 * (float(h >> 22) / 1024.0 + vec3(0.0, 0.33, 0.67)));
  return vec4(mix(vec3(0.5 + 0.4 * float(h >> 12 & 1023u) / 1023.0), hue, 0.34), id == 0u ? 0.0 : 1.0);
}
#endif
#ifdef MODE_DEPTH
vec4 surfaceColor(vec2 texel) {
  ivec2 at = clampToTile(ivec2(floor(texel)));
#if defined(STYLED) && defined(COMBINED)
  if (applyStyle(vec4(1.0), texelFetch(u_id, at, 0).r).a == 0.0) return vec4(0.0);
#endif
  uint d = texelFetch(u_depth, at, 0).r;
  float t = clamp((float(d) - u_range.x) / (u_range.y - u_range.x), 0.0, 1.0);
  vec3 near = vec3(0.99, 0.91, 0.70), middle = vec3(0.36, 0.62, 0.62), far = vec3(0.16, 0.18, 0.36);
  return vec4(t < 0.5 ? mix(near, middle, t * 2.0) : mix(middle, far, t * 2.0 - 1.0), d == 0xffffffffu ? 0.0 : 1.0);
}
#endif
`;

const HIGHLIGHT = `
#ifdef HIGHLIGHT
uniform usampler2D u_table;
uniform uint u_mask;
uniform int u_probes;
uniform float u_rim;      // texels

uint idAt(vec2 texel) {
  ivec2 at = clamp(ivec2(floor(texel)), u_bounds.xy, u_bounds.zw);
  return texelFetch(u_id, at + GUTTER, 0).r;
}

vec4 highlighted(vec4 color, vec2 texel) {
  uint id = texelFetch(u_id, clampToTile(ivec2(floor(texel))), 0).r;
  uint packed = find(u_table, id, u_mask, u_probes);
  if (packed == 0u) return color;
  vec3 tint = rgbOf(packed);
  float grey = dot(color.rgb, vec3(0.2126, 0.7152, 0.0722));
  bool rim = idAt(texel + vec2(u_rim, 0.0)) != id || idAt(texel - vec2(u_rim, 0.0)) != id
    || idAt(texel + vec2(0.0, u_rim)) != id || idAt(texel - vec2(0.0, u_rim)) != id;
  vec3 body = mix(color.rgb, tint * (0.5 + 0.65 * grey), 0.72);
  return vec4(clamp(rim ? tint : body, 0.0, 1.0), max(color.a, rim ? 0.9 : color.a));
}
#endif
`;

/** Draws opaque pixels first, with their depth; then edges, through which surfaces behind them are visible. */
const COMBINED = `
#ifdef COMBINED
uniform bool u_soft;      // draws edges
bool isOpaque(float alpha) { return alpha > 0.998; }

#if defined(MODE_LIT) || defined(MODE_COLOR)
/** Whether all pixels that the colour is mixed from are opaque, known before shading. */
bool isSurelyOpaque(vec2 texel) {
  ivec2 at = ivec2(floor(texel - 0.5));
  return isOpaque(min(min(colorAt(at).a, colorAt(at + ivec2(1, 0)).a), min(colorAt(at + ivec2(0, 1)).a, colorAt(at + 1).a)));
}
#else
bool isSurelyOpaque(vec2 texel) { return false; }
#endif
#endif
`;

const MAIN = `
void main() {
  vec2 texel = (vec2(gl_FragCoord.x, u_height - gl_FragCoord.y) - u_origin) * u_scale;
#ifdef ESTIMATED
  g_estimate = e_read(depthFraction(texel));
#endif
#ifdef COMBINED
  bool opaque = u_opacity == 1.0;
  if (opaque && u_soft && isSurelyOpaque(texel)) discard;
#endif
  vec4 color = surfaceColor(texel);
#ifdef HIGHLIGHT
  color = highlighted(color, texel);
#endif
#ifdef COMBINED
  if (color.a == 0.0 || (opaque && isOpaque(color.a) == u_soft)) discard;
  gl_FragDepth = clamp(depthFraction(texel), 0.0, 1.0);
#endif
  color.a *= u_opacity;
  o_color = vec4(color.rgb * color.a, color.a);
}`;
