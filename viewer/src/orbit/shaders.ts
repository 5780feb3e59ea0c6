/** Texels of a side of the cells that are moved; each is two triangles. */
export const STEP = 2;

/**
 * Moves the cells of a picture by their depth: parallel projection makes it one matrix for all. Cells whose corners lie far apart in depth are torn: they
 * get the colour of the farthest corner and lie behind all that is whole, so that they show only where no picture knows better.
 */
export const WARP_VERTEX = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
uniform sampler2D u_depth;
uniform ivec2 u_size;
uniform int u_columns;    // cells in a row
uniform mat3 u_turn;      // U, V, D there from U, V, D here; about the pivot
uniform vec3 u_grid;      // U and V of the first texel's middle, about the pivot; metres a texel
uniform vec2 u_range;     // D at depth 0, about the pivot, and D a unit
uniform float u_tear;     // difference of depths in a torn cell
uniform vec4 u_place;     // clip units a metre; the pivot in clip space
uniform vec2 u_deep;      // share at D 0 about the pivot there, and a metre
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

/** Where both pictures show the same surface they are mixed; else the nearer is seen, and what is torn only where nothing is whole. */
export const MIX_FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D u_colorA, u_colorB, u_depthA, u_depthB;
uniform float u_share;    // of B
uniform float u_tie;      // difference of depths of one surface
uniform vec2 u_pixel;     // shares of the screen
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
