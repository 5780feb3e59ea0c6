import type { Mode } from "../drawer";
import { TINT_OPACITY, DIM_GREY } from "../drawStyle";
import { GUTTER } from "./textures";

/** What a program is made for; each combination is compiled when it is first drawn. */
export interface ShaderVariant {
  readonly mode: Mode;
  readonly masked: boolean;
  readonly highlight: boolean;
  /** Objects are not all shown as they are. */
  readonly styled: boolean;
  /** The layer with shadows, if any. */
  readonly shadow: "sun" | "sun16" | null;
  readonly occlusion: boolean;
  /** Takes part in a picture that several layers make by depth. */
  readonly combined: boolean;
  /** Light comes from the shares that were found for the whole picture. */
  readonly estimatedLight: boolean;
}

export const variantName = (v: ShaderVariant): string =>
  [v.mode, v.masked && "masked", v.highlight && "highlight", v.styled && "finish", v.shadow, v.occlusion && "ao", v.combined && "combined", v.estimatedLight && "shaded"].filter(Boolean).join("+");

export function makeFragmentShader({ mode, masked, highlight, styled, shadow, occlusion, combined, estimatedLight }: ShaderVariant): string {
  const names = [`MODE_${mode === "picture" ? "COLOR" : mode.toUpperCase()}`, masked && "MASKED", highlight && "HIGHLIGHT", styled && "FINISH", shadow && `SHADOW_${shadow.toUpperCase()}`, occlusion && "OCCLUSION", combined && "COMBINED", estimatedLight && "SHADED"];
  const defines = names.filter(Boolean).map((name) => `#define ${String(name)}`);
  return ["#version 300 es", ...defines, HEAD, ID_LOOKUP, DEPTH, SHADED, COLOR, FALSE_COLOR, HIGHLIGHT, COMBINED, MAIN].join("\n");
}

const HEAD = `
#define GUTTER ${String(GUTTER)}
precision highp float;
precision highp int;
precision highp usampler2D;
precision highp sampler2D;
uniform float u_height;   // of the screen
uniform vec2 u_origin;    // of the tile
uniform float u_scale;    // texels a pixel
uniform ivec4 u_bounds;   // texels that may be read, the gutter's among them where it is filled
uniform int u_size;       // texels a side
uniform float u_opacity;
uniform vec3 u_sun;       // unit, towards the light
uniform vec3 u_sky;       // linear light that is everywhere
uniform vec3 u_beam;      // and of the sun on a surface that faces it
uniform vec2 u_range;     // depth
uniform sampler2D u_color;
uniform sampler2D u_normal;
uniform usampler2D u_id;
uniform usampler2D u_depth;
out vec4 o_color;

vec3 linear(vec3 c) { return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c)); }
vec3 srgb(vec3 c) { return mix(c * 12.92, 1.055 * pow(max(c, 0.0031308), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c)); }
ivec2 inside(ivec2 at) { return clamp(at, ivec2(0), ivec2(u_size - 1)) + GUTTER; }
`;

/** Tables of ids with open addressing: R is the id, G its word; an empty place ends the search. */
const ID_LOOKUP = `
#if defined(HIGHLIGHT) || defined(FINISH)
/** one: the only id and its word; id 0: see the table. mask: places − 1. */
uint find(usampler2D table, uint id, uint mask, int probes, uvec2 one) {
  if (id == 0u) return 0u;
  if (one.x != 0u) return one.x == id ? one.y : 0u;
  uint width = uint(textureSize(table, 0).x);
  uint place = (id * 2654435769u >> 7) & mask;
  for (int k = 0; k < probes; k++) {
    uvec2 entry = texelFetch(table, ivec2(place % width, place / width), 0).rg;
    if (entry.x == id) return entry.y;
    if (entry.x == 0u) return 0u;
    place = (place + 1u) & mask;
  }
  return 0u;
}

vec3 rgbOf(uint word) { return vec3(uvec3(word, word >> 8, word >> 16) & 255u) / 255.0; }
#endif

#ifdef FINISH
uniform usampler2D u_finishes;
uniform uint u_finishMask;
uniform int u_finishProbes;
uniform uvec2 u_finishOne;
uniform uint u_others;    // of ids that are not in the table

vec4 finished(vec4 c, uint id) {
  uint word = find(u_finishes, id, u_finishMask, u_finishProbes, u_finishOne);
  uint kind = (word == 0u && id != 0u ? u_others : word) >> 24;
  if (kind == 1u) c.rgb = mix(c.rgb, rgbOf(word), ${String(TINT_OPACITY)});
  else if (kind == 3u) c.rgb = mix(vec3(dot(c.rgb, vec3(0.2126, 0.7152, 0.0722))), vec3(${String(DIM_GREY[0])}), ${String(DIM_GREY[1])});
  else if (kind == 4u) c.a = 0.0;
  return c;
}
#endif
`;

const DEPTH = `
#if defined(COMBINED) || defined(SHADED)
uniform vec2 u_depths;    // share of the range at value 0, and a value more
const uint NONE = 0xffffffffu;
uniform uint u_steep;     // values by which neighbours on one surface differ at most
uint depthAt(ivec2 texel) { return texelFetch(u_depth, clamp(texel, u_bounds.xy, u_bounds.zw) + GUTTER, 0).r; }

/** Between the four nearest texels where they are of one surface. Of a pixel that is covered in part but has no depth: that of the nearest around it. */
float shareOf(vec2 texel) {
  ivec2 at = ivec2(floor(texel - 0.5));
  vec2 f = texel - 0.5 - vec2(at);
  uvec4 four = uvec4(depthAt(at), depthAt(at + ivec2(1, 0)), depthAt(at + ivec2(0, 1)), depthAt(at + 1));
  uint d = min(min(four.x, four.y), min(four.z, four.w));
  vec4 more = vec4(four - d);
  if (max(max(four.x, four.y), max(four.z, four.w)) - d > u_steep || d == NONE) {
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
 * Shares of light that were found for CSS pixels (see draw/shade.ts): of the four around, those at the same depth count.
 * As with light itself, half comes from the pixel and an eighth from each neighbour: colours at edges are mixed.
 */
const SHADED = `
#ifdef SHADED
uniform sampler2D u_shares;
uniform vec4 u_onto;      // pixels of the shares a pixel, where the left top corner lies in them, their height
uniform float u_same;     // share of the range that counts as the same depth
uniform bvec2 u_found;    // which of the two are used
vec2 g_reach;

vec2 nearest(vec2 at, vec2 pixels) {
  return texelFetch(u_shares, clamp(ivec2(round(at + pixels * u_onto.x)), ivec2(0), textureSize(u_shares, 0) - 1), 0).rg;
}

vec2 reachOf(float depth) {
  vec2 down = vec2(gl_FragCoord.x, u_height - gl_FragCoord.y) * u_onto.x + u_onto.yz;
  vec2 at = vec2(down.x, u_onto.w - down.y) - 0.5;
  ivec2 corner = ivec2(floor(at)), last = textureSize(u_shares, 0) - 1;
  if (any(lessThan(at, vec2(-1.0))) || any(greaterThan(at, vec2(last + 1)))) return vec2(1.0);
  vec2 f = at - vec2(corner), sum = vec2(0.0);
  float weights = 0.0;
  for (int k = 0; k < 4; k++) {
    ivec2 step = ivec2(k & 1, k >> 1);
    vec4 shares = texelFetch(u_shares, clamp(corner + step, ivec2(0), last), 0);
    float apart = abs((shares.b * 65280.0 + shares.a * 255.0) / 65535.0 - depth) / u_same;
    float weight = (step.x == 1 ? f.x : 1.0 - f.x) * (step.y == 1 ? f.y : 1.0 - f.y) / (0.01 + apart * apart) + 1e-9;
    sum += weight * shares.rg;
    weights += weight;
  }
  vec2 around = nearest(at, vec2(1.0, 0.0)) + nearest(at, vec2(-1.0, 0.0)) + nearest(at, vec2(0.0, 1.0)) + nearest(at, vec2(0.0, -1.0));
  return mix(vec2(1.0), 0.5 * sum / weights + 0.125 * around, vec2(u_found));
}
#endif
`;

/**
 * Colour is averaged premultiplied, and in linear light when it is lit: shade first, filter then.
 *
 * Colours of a tile are averages over pixels, its normals are those of the pixels' centres: lit by its own normal
 * alone, a pixel on the edge of a bright shaded wall shines. So light is spread a little, half from the pixel and an
 * eighth from each neighbour; against pictures lit before they are averaged this gains 2 to 3 dB at edges.
 */
const COLOR = `
#if defined(MODE_LIT) || defined(MODE_COLOR)
ivec2 stored(ivec2 texel) { return clamp(texel, u_bounds.xy, u_bounds.zw) + GUTTER; }

vec4 colorAt(ivec2 texel) {
  ivec2 at = stored(texel);
  vec4 c = texelFetch(u_color, at, 0);
#ifdef MASKED
  c.a = texelFetch(u_id, at, 0).r == 0u ? 0.0 : 1.0;
#endif
#ifdef FINISH
  c = finished(c, texelFetch(u_id, at, 0).r);
#endif
  return c;
}

#ifdef MODE_LIT
#ifdef OCCLUSION
uniform sampler2D u_ao;
#endif
#ifdef SHADOW_SUN
uniform sampler2D u_shadow;
float unshaded(ivec2 at) { return texelFetch(u_shadow, at, 0).r; }
#endif
#ifdef SHADOW_SUN16
uniform usampler2D u_shadow;
uniform uvec2 u_suns;     // numbers of the two suns
uniform float u_share;    // of the second
float unshaded(ivec2 at) {
  uvec2 lit = uvec2(texelFetch(u_shadow, at, 0).r) >> u_suns & uvec2(1u);
  return mix(float(lit.x), float(lit.y), u_share);
}
#endif

/** Shares of the sky's and the sun's light; negative where there is no normal. */
vec2 lambert(ivec2 texel) {
  ivec2 at = stored(texel);
  vec3 n = texelFetch(u_normal, at, 0).rgb;
  if (n == vec3(0.0)) return vec2(-1.0);
  vec2 light = vec2(1.0, max(0.0, dot(normalize(n * 2.0 - 1.0), u_sun)));
#ifdef OCCLUSION
  light.x = texelFetch(u_ao, at, 0).r;
#endif
#if defined(SHADOW_SUN) || defined(SHADOW_SUN16)
  light.y *= unshaded(at);
#endif
#ifdef SHADED
  light *= g_reach;
#endif
  return light;
}

vec2 known(vec2 light, vec2 own) { return light.x < 0.0 ? own : light; }

vec2 spread(vec2 own, vec2 left, vec2 right, vec2 above, vec2 below) {
  if (own.x < 0.0) return vec2(1.0, 0.5);
  return 0.5 * own + 0.125 * (known(left, own) + known(right, own) + known(above, own) + known(below, own));
}

vec4 lit(ivec2 texel, vec2 light) {
  vec4 c = colorAt(texel);
  return vec4(linear(c.rgb) * (light.x * u_sky + light.y * u_beam) * c.a, c.a);
}

vec4 exact(ivec2 at) {
  return lit(at, spread(lambert(at), lambert(at - ivec2(1, 0)), lambert(at + ivec2(1, 0)), lambert(at - ivec2(0, 1)), lambert(at + ivec2(0, 1))));
}

/** Of the 2 × 2 texels from at; their light comes from 4 × 4 without the corners. */
vec4 between(ivec2 at, vec2 f) {
  vec2 n0 = lambert(at + ivec2(0, -1)), n1 = lambert(at + ivec2(1, -1));
  vec2 w0 = lambert(at + ivec2(-1, 0)), a = lambert(at), b = lambert(at + ivec2(1, 0)), e0 = lambert(at + ivec2(2, 0));
  vec2 w1 = lambert(at + ivec2(-1, 1)), c = lambert(at + ivec2(0, 1)), d = lambert(at + 1), e1 = lambert(at + ivec2(2, 1));
  vec2 s0 = lambert(at + ivec2(0, 2)), s1 = lambert(at + ivec2(1, 2));
  vec4 top = mix(lit(at, spread(a, w0, b, n0, c)), lit(at + ivec2(1, 0), spread(b, a, e0, n1, d)), f.x);
  vec4 bottom = mix(lit(at + ivec2(0, 1), spread(c, w1, d, a, s0)), lit(at + 1, spread(d, c, e1, b, s1)), f.x);
  return mix(top, bottom, f.y);
}
#else
vec4 exact(ivec2 at) {
  vec4 c = colorAt(at);
  return vec4(c.rgb * c.a, c.a);
}

vec4 between(ivec2 at, vec2 f) {
  return mix(mix(exact(at), exact(at + ivec2(1, 0)), f.x), mix(exact(at + ivec2(0, 1)), exact(at + 1), f.x), f.y);
}
#endif

vec4 surface(vec2 texel) {
  vec2 corner = floor(texel - 0.5), f = texel - 0.5 - corner;
  ivec2 at = ivec2(corner);
  f = mix(f, round(f), lessThan(abs(f - round(f)), vec2(0.004)));
#if !defined(MODE_LIT) && !defined(MASKED) && !defined(FINISH)
  // Where all four are whole, the texture unit mixes as well as we do, in a quarter of the time.
  if (all(greaterThanEqual(at, u_bounds.xy)) && all(lessThan(at, u_bounds.zw)) && f != vec2(0.0) && f != vec2(1.0)) {
    vec4 mixed = texture(u_color, (texel + float(GUTTER)) / vec2(textureSize(u_color, 0)));
    if (mixed.a == 1.0) return mixed;
  }
#endif
  vec4 c = f == vec2(0.0) || f == vec2(1.0) ? exact(at + ivec2(f)) : between(at, f);
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
vec4 surface(vec2 texel) {
  vec3 n = texelFetch(u_normal, inside(ivec2(floor(texel))), 0).rgb;
  return vec4(n, n == vec3(0.0) ? 0.0 : 1.0);
}
#endif
#ifdef MODE_ID
vec4 surface(vec2 texel) {
  uint id = texelFetch(u_id, inside(ivec2(floor(texel))), 0).r;
  uint h = id * 2654435769u;
  vec3 hue = 0.5 + 0.5 * cos(6.2831853 * (float(h >> 22) / 1024.0 + vec3(0.0, 0.33, 0.67)));
  return vec4(mix(vec3(0.5 + 0.4 * float(h >> 12 & 1023u) / 1023.0), hue, 0.34), id == 0u ? 0.0 : 1.0);
}
#endif
#ifdef MODE_DEPTH
vec4 surface(vec2 texel) {
  ivec2 at = inside(ivec2(floor(texel)));
#if defined(FINISH) && defined(COMBINED)
  if (finished(vec4(1.0), texelFetch(u_id, at, 0).r).a == 0.0) return vec4(0.0);
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
uniform uvec2 u_one;
uniform float u_rim;      // texels

uint idAt(vec2 texel) {
  ivec2 at = clamp(ivec2(floor(texel)), u_bounds.xy, u_bounds.zw);
  return texelFetch(u_id, at + GUTTER, 0).r;
}

vec4 highlighted(vec4 color, vec2 texel) {
  uint id = texelFetch(u_id, inside(ivec2(floor(texel))), 0).r;
  uint packed = find(u_table, id, u_mask, u_probes, u_one);
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

/** Pixels that are covered all are drawn first, with their depth; edges then, which let through what lies behind them. */
const COMBINED = `
#ifdef COMBINED
uniform bool u_soft;      // edges are drawn
bool isSolid(float alpha) { return alpha > 0.998; }

#if defined(MODE_LIT) || defined(MODE_COLOR)
/** Known before any light is: all pixels that the colour is mixed of are covered. */
bool surelySolid(vec2 texel) {
  ivec2 at = ivec2(floor(texel - 0.5));
  return isSolid(min(min(colorAt(at).a, colorAt(at + ivec2(1, 0)).a), min(colorAt(at + ivec2(0, 1)).a, colorAt(at + 1).a)));
}
#else
bool surelySolid(vec2 texel) { return false; }
#endif
#endif
`;

const MAIN = `
void main() {
  vec2 texel = (vec2(gl_FragCoord.x, u_height - gl_FragCoord.y) - u_origin) * u_scale;
#ifdef SHADED
  g_reach = reachOf(shareOf(texel));
#endif
#ifdef COMBINED
  bool whole = u_opacity == 1.0;
  if (whole && u_soft && surelySolid(texel)) discard;
#endif
  vec4 color = surface(texel);
#ifdef HIGHLIGHT
  color = highlighted(color, texel);
#endif
#ifdef COMBINED
  if (color.a == 0.0 || (whole && isSolid(color.a) == u_soft)) discard;
  gl_FragDepth = clamp(shareOf(texel), 0.0, 1.0);
#endif
  color.a *= u_opacity;
  o_color = vec4(color.rgb * color.a, color.a);
}`;
