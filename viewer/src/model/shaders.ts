/** Converts linear light to sRGB at the end, as for images. Partly covered pixels get the nearest depth around them. */
export const FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D u_color; // linear, premultiplied
uniform sampler2D u_depth;
uniform ivec2 u_corner;   // bottom left
uniform bool u_soft;
out vec4 o_color;

vec3 srgb(vec3 c) { return mix(c * 12.92, 1.055 * pow(max(c, 0.0031308), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c)); }
float depthAt(ivec2 at) { return texelFetch(u_depth, clamp(at, ivec2(0), textureSize(u_depth, 0) - 1), 0).r; }

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy) - u_corner;
  vec4 c = texelFetch(u_color, at, 0);
  if (c.a == 0.0 || (c.a > 0.998) != !u_soft) discard;
  float d = depthAt(at);
  if (d == 1.0) for (int k = 0; k < 9; k++) d = min(d, depthAt(at + ivec2(k % 3 - 1, k / 3 - 1)));
  gl_FragDepth = d;
  o_color = vec4(srgb(clamp(c.rgb / c.a, 0.0, 1.0)) * c.a, c.a);
}`;
