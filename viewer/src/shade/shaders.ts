/** Samples on a disc, and turns of their spiral. */
const SAMPLES = 16;
const TURNS = 7;
/** Steps of a ray towards the sun, and their growth factor. */
const STEPS = 56;
const GROWTH = 1.115;

export const VERTEX = `#version 300 es
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }`;

const HEAD = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
out vec4 o_shares;
`;

/**
 * Positions are in metres along right, up and forward. Occlusion uses the estimator of McGuire, Mara and Luebke, "Scalable Ambient Obscurance" (2012).
 * Shadows come from ray marching the depth image towards the sun. Hidden objects cast no shadow; visible ones count as u_thick metres thick.
 */
export const SHARES = `${HEAD}
uniform sampler2D u_depth;
uniform float u_px;       // metres per pixel
uniform float u_span;     // metres from depth 0 to 1
uniform vec3 u_sun;       // unit vector towards the sun; 0 disables shadows
uniform float u_radius;   // metres; 0 disables occlusion
uniform float u_thick;    // metres

float depthAt(ivec2 at) { return texelFetch(u_depth, clamp(at, ivec2(0), textureSize(u_depth, 0) - 1), 0).r; }
vec3 placeOf(ivec2 at, float depth) { return vec3(vec2(at) * u_px, depth * u_span); }

/** Change of D per pixel: the smaller one of both sides. */
float slope(float before, float here, float after) {
  float a = here - before, b = after - here;
  return (abs(a) < abs(b) ? a : b) * u_span / u_px;
}

/** Dither pattern: each value from 0 to 15 once per 4 × 4 pixels. */
float pattern(ivec2 at) {
  ivec2 p = at & 3;
  return float((p.x ^ p.y) & 1) * 8.0 + float(p.x & 1) * 4.0 + float(((p.x ^ p.y) >> 1) & 1) * 2.0 + float((p.x >> 1) & 1);
}

float skyOf(ivec2 at, vec3 place, vec3 normal, float turn) {
  float reach = clamp(u_radius / u_px, 5.0, 128.0), radius = reach * u_px, least = 0.012 * radius, sum = 0.0;
  for (int k = 0; k < ${String(SAMPLES)}; k++) {
    float far = (float(k) + 0.5) / ${String(SAMPLES)}.0, angle = 6.2831853 * (far * ${String(TURNS)}.0 + turn);
    ivec2 there = at + ivec2(round(vec2(cos(angle), sin(angle)) * max(1.0, far * reach)));
    vec3 way = placeOf(there, depthAt(there)) - place;
    float square = dot(way, way), near = max(0.0, 1.0 - square / (radius * radius));
    sum += near * near * near * max(0.0, dot(way, normal) - least) / (square / radius + least);
  }
  return max(0.0, 1.0 - sum * 3.5 / ${String(SAMPLES)}.0);
}

float sunOf(ivec2 at, vec3 place, vec3 normal, float jitter) {
  ivec2 size = textureSize(u_depth, 0);
  vec3 from = place + normal * u_px;
  float far = u_px * (0.6 + jitter);
  for (int k = 0; k < ${String(STEPS)}; k++, far *= ${String(GROWTH)}) {
    vec3 on = from + u_sun * far;
    ivec2 there = ivec2(round(on.xy / u_px));
    if (any(lessThan(there, ivec2(0))) || any(greaterThanEqual(there, size))) return 1.0;
    float behind = on.z - texelFetch(u_depth, there, 0).r * u_span;
    if (behind > 1.5 * u_px && behind < u_thick + 0.1 * far) return 0.0;
  }
  return 1.0;
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float depth = depthAt(at);
  float whole = floor(depth * 65535.0 + 0.5), high = floor(whole / 256.0);
  o_shares = vec4(1.0, 1.0, high / 255.0, (whole - 256.0 * high) / 255.0);
  if (depth == 1.0) return;
  float across = slope(depthAt(at - ivec2(1, 0)), depth, depthAt(at + ivec2(1, 0)));
  float along = slope(depthAt(at - ivec2(0, 1)), depth, depthAt(at + ivec2(0, 1)));
  vec3 place = placeOf(at, depth), normal = normalize(vec3(across, along, -1.0));
  float jitter = pattern(at) / 16.0;
  if (u_radius > 0.0) o_shares.r = skyOf(at, place, normal, jitter);
  if (u_sun != vec3(0.0) && dot(normal, u_sun) > 0.0) o_shares.g = sunOf(at, place, normal, jitter);
}`;

/** Averages pixels of similar depth over 4 × 4 pixels, which contain each value of the pattern once. */
export const SMOOTH = `${HEAD}
uniform sampler2D u_shares;
uniform float u_same;     // largest depth change per pixel on one surface, as a fraction of the range
float depthIn(vec4 shares) { return (shares.b * 65280.0 + shares.a * 255.0) / 65535.0; }
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy), last = textureSize(u_shares, 0) - 1;
  vec4 own = texelFetch(u_shares, at, 0);
  float depth = depthIn(own), weights = 1.0;
  vec2 sum = own.rg;
  for (int k = 0; k < 16; k++) {
    ivec2 step = ivec2(k & 3, k >> 2) - 2;
    if (step == ivec2(0)) continue;
    vec4 other = texelFetch(u_shares, clamp(at + step, ivec2(0), last), 0);
    float weight = abs(depthIn(other) - depth) <= u_same * (1.0 + length(vec2(step))) ? 1.0 : 0.0;
    sum += weight * other.rg;
    weights += weight;
  }
  o_shares = vec4(sum / weights, own.ba);
}`;

/**
 * Reads the light estimated per CSS pixel from the four nearest estimates, weighted by likeness of depth.
 * Like light itself, half comes from the pixel and an eighth from each neighbour: colours at edges are mixed.
 */
export const READ = `
uniform sampler2D u_estimate;
uniform vec4 u_estimateMap;      // scale to the estimate's pixels, top left corner in them, their height
uniform float u_tolerance;     // fraction of the range that counts as the same depth
uniform bvec2 u_estimated;    // whether skylight and sunlight are estimated

vec2 e_nearest(vec2 at, vec2 pixels) {
  return texelFetch(u_estimate, clamp(ivec2(round(at + pixels * u_estimateMap.x)), ivec2(0), textureSize(u_estimate, 0) - 1), 0).rg;
}

vec2 e_read(float depth) {
  vec2 down = vec2(gl_FragCoord.x, u_height - gl_FragCoord.y) * u_estimateMap.x + u_estimateMap.yz;
  vec2 at = vec2(down.x, u_estimateMap.w - down.y) - 0.5;
  ivec2 corner = ivec2(floor(at)), last = textureSize(u_estimate, 0) - 1;
  if (any(lessThan(at, vec2(-1.0))) || any(greaterThan(at, vec2(last + 1)))) return vec2(1.0);
  vec2 f = at - vec2(corner), sum = vec2(0.0);
  float weights = 0.0;
  for (int k = 0; k < 4; k++) {
    ivec2 step = ivec2(k & 1, k >> 1);
    vec4 estimate = texelFetch(u_estimate, clamp(corner + step, ivec2(0), last), 0);
    float difference = abs((estimate.b * 65280.0 + estimate.a * 255.0) / 65535.0 - depth) / u_tolerance;
    float weight = (step.x == 1 ? f.x : 1.0 - f.x) * (step.y == 1 ? f.y : 1.0 - f.y) / (0.01 + difference * difference) + 1e-9;
    sum += weight * estimate.rg;
    weights += weight;
  }
  vec2 around = e_nearest(at, vec2(1.0, 0.0)) + e_nearest(at, vec2(-1.0, 0.0)) + e_nearest(at, vec2(0.0, 1.0)) + e_nearest(at, vec2(0.0, -1.0));
  return mix(vec2(1.0), 0.5 * sum / weights + 0.125 * around, vec2(u_estimated));
}
`;
