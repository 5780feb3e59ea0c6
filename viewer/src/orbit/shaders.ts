/** Side of a warped cell in texels; each cell is two triangles. */
export const STEP = 2;

/**
 * Warps the cells of an image by their depth; with parallel projection, one matrix transforms all cells. A cell whose corners differ much in depth is torn:
 * it gets the colour of its farthest corner and is drawn behind all other cells, so that it only fills gaps.
 */
export const WARP_VERTEX = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
uniform sampler2D u_depth;
uniform ivec2 u_size;
uniform int u_columns;    // cells in a row
uniform mat3 u_turn;      // from U, V, D of the image to U, V, D of the view; about the pivot
uniform vec3 u_grid;      // U and V of the first texel's centre, about the pivot; metres per texel
uniform vec2 u_range;     // D at depth 0, about the pivot; metres per unit of depth
uniform float u_tear;     // depth difference above which a cell is torn
uniform vec4 u_place;     // clip units per metre; the pivot in clip space
uniform vec2 u_deep;      // depth of the pivot in the view; depth per metre
out vec2 v_texel;

ivec2 inside(ivec2 at) { return min(at, u_size - 1); }
float depthAt(ivec2 at) { return texelFetch(u_depth, inside(at), 0).r; }

vec3 turned(ivec2 at, float depth) {
  return u_turn * vec3(u_grid.xy + u_grid.z * vec2(inside(at)), u_range.x + depth * u_range.y);
}

void main() {
  int cell = gl_VertexID / 6, k = gl_VertexID % 6;
  ivec2 first = ${String(STEP)} * ivec2(cell % u_columns, cell / u_columns);
  ivec2 corner = ivec2(k == 1 || k == 4 || k == 5, k == 2 || k == 3 || k == 5);
  ivec2 at = first + ${String(STEP)} * corner;
  vec4 d = vec4(depthAt(first), depthAt(first + ivec2(${String(STEP)}, 0)), depthAt(first + ivec2(0, ${String(STEP)})), depthAt(first + ${String(STEP)}));
  float far = max(max(d.x, d.y), max(d.z, d.w)), near = min(min(d.x, d.y), min(d.z, d.w));
  v_texel = vec2(at) + 0.5;
  if (far == 1.0) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
  vec3 place = turned(at, depthAt(at));
  float share = u_deep.x + place.z * u_deep.y;
  bool torn = far - near > u_tear;
  if (torn) {
    ivec2 back = first + ${String(STEP)} * ivec2(d.y == far || (d.w == far && d.x != far && d.z != far), d.x != far && d.y != far);
    v_texel = vec2(back) + 0.5;
    share = u_deep.x + turned(back, far).z * u_deep.y;
  }
  share = clamp(share, 0.0, 0.999);
  gl_Position = vec4(place.xy * u_place.xy + u_place.zw, (torn ? 0.5 + 0.5 * share : 0.5 * share) * 2.0 - 1.0, 1.0);
}`;

export const WARP_FRAGMENT = `#version 300 es
precision highp float;
uniform sampler2D u_color;
in vec2 v_texel;
out vec4 o_color;
void main() { o_color = texture(u_color, v_texel / vec2(textureSize(u_color, 0))); }`;

export const MIX_VERTEX = `#version 300 es
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }`;

/** Blends both images where they show the same surface; elsewhere shows the nearer one. Torn cells only fill gaps. */
export const MIX_FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D u_colorA, u_colorB, u_depthA, u_depthB;
uniform float u_share;    // weight of B
uniform float u_tie;      // largest depth difference on the same surface
uniform vec2 u_pixel;     // size of a pixel, as a fraction of the screen
out vec4 o_color;
void main() {
  vec2 at = gl_FragCoord.xy * u_pixel;
  float da = texture(u_depthA, at).r, db = texture(u_depthB, at).r;
  vec4 a = texture(u_colorA, at), b = texture(u_colorB, at);
  bool wholeA = da < 0.5, wholeB = db < 0.5;
  if (wholeA && wholeB) o_color = abs(da - db) < u_tie ? mix(a, b, u_share) : da < db ? a : b;
  else if (wholeA || wholeB) o_color = wholeA ? a : b;
  else if (da < 1.0 && db < 1.0) o_color = mix(a, b, u_share);
  else o_color = da < 1.0 ? a : db < 1.0 ? b : vec4(0.0);
}`;
