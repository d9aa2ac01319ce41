// The two programs of the ray marcher. In world coordinates the longest side of the volume is 1 and its centre the origin; x
// points right, y up (slices have y downwards), z towards the first slice.

export const VERTEX = `#version 300 es
out vec2 at;
void main() {
  at = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0;
  gl_Position = vec4(at * 2.0 - 1.0, 0.0, 1.0);
}`;

/** Enlarges the small picture that is drawn during changes. */
export const COPY = `#version 300 es
precision highp float;
uniform sampler2D small;
uniform vec2 share;
in vec2 at;
out vec4 colour;
void main() { colour = texture(small, at * share); }`;

export const MARCH = `#version 300 es
precision highp float;
precision highp sampler3D;
uniform sampler3D volume;
uniform sampler2D ramp;      // colour and opacity of the 256 values
uniform bool coloured;       // voxels have colours
uniform vec3 halfSize;       // of the volume
uniform vec3 cutLow, cutHigh;// the box that remains, in world coordinates
uniform vec3 eye, right, up, ahead;
uniform vec2 aspect;
uniform int form;            // 0 cloud, 1 cube, 2 sphere, 3 torus
uniform float radius;        // half the side of the cube around the form
uniform float stride;        // between samples of the cloud
uniform float density;
uniform float voxelSize;
uniform float lens;
uniform bool fine;
in vec2 at;
out vec4 colour;

vec3 place(vec3 p) { vec3 q = p / (2.0 * halfSize) + 0.5; return vec3(q.x, 1.0 - q.y, 1.0 - q.z); }
vec4 voxel(vec3 p) { return texture(volume, place(p)); }
float luma(vec4 v) { return coloured ? dot(v.rgb, vec3(0.299, 0.587, 0.114)) : v.r; }
vec4 mapped(float value) { return texture(ramp, vec2(value * (255.0 / 256.0) + 0.5 / 256.0, 0.5)); }

// Where a ray enters and leaves a box; no intersection unless the first is less than the second.
vec2 span(vec3 from, vec3 along, vec3 low, vec3 high) {
  vec3 inverse = 1.0 / along;
  vec3 a = (low - from) * inverse, b = (high - from) * inverse;
  vec3 first = min(a, b), last = max(a, b);
  return vec2(max(max(first.x, first.y), first.z), min(min(last.x, last.y), last.z));
}

float boxed(vec3 p, vec3 half_) { vec3 q = abs(p) - half_; return length(max(q, 0.0)) + min(max(q.x, max(q.y, q.z)), 0.0); }

// The distance of a point from the form inside the cuts.
float formDistance(vec3 p) {
  float d;
  if (form == 1) d = boxed(p, vec3(radius * 0.9)) - radius * 0.02;
  else if (form == 2) d = length(p) - radius;
  else { vec3 q = vec3(p.x, p.z, p.y); d = length(vec2(length(q.xz) - radius * 0.66, q.y)) - radius * 0.34; }
  return max(d, boxed(p - (cutLow + cutHigh) * 0.5, (cutHigh - cutLow) * 0.5));
}

vec3 normalAt(vec3 p) {
  vec2 e = vec2(0.0008, -0.0008);
  return normalize(e.xyy * formDistance(p + e.xyy) + e.yyx * formDistance(p + e.yyx) + e.yxy * formDistance(p + e.yxy) + e.xxx * formDistance(p + e.xxx));
}

vec4 solid(vec3 along) {
  vec2 seen = span(eye, along, max(cutLow, vec3(-radius)), min(cutHigh, vec3(radius)));
  if (seen.x >= seen.y) return vec4(0.0);
  float t = max(seen.x, 0.0);
  for (int step_ = 0; step_ < 96; step_ += 1) {
    vec3 p = eye + along * t;
    float d = formDistance(p);
    if (d < 0.0006) {
      vec4 v = voxel(p);
      vec3 own = coloured ? v.rgb : mapped(v.r).rgb;
      vec3 n = normalAt(p), light = normalize(up * 0.7 - ahead * 0.8 - right * 0.5);
      float bright = 0.42 + 0.58 * max(dot(n, light), 0.0);
      return vec4(own * bright, 1.0);
    }
    t += d;
    if (t > seen.y) break;
  }
  return vec4(0.0);
}

vec4 cloud(vec3 along) {
  vec2 seen = span(eye, along, cutLow, cutHigh);
  seen.x = max(seen.x, 0.0);
  if (seen.x >= seen.y) return vec4(0.0);
  // Neighbouring rays start at different depths, so that the steps are not visible as rings.
  float jitter = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
  vec3 sum = vec3(0.0);
  float through = 1.0;
  vec3 light = normalize(up * 0.8 - ahead * 0.7 - right * 0.5);
  float h = 1.5 * voxelSize;
  for (float t = seen.x + stride * jitter; t < seen.y; t += stride) {
    vec3 p = eye + along * t;
    vec4 v = voxel(p);
    float value = luma(v);
    vec4 m = mapped(value);
    if (m.a > 0.002) {
      float alpha = 1.0 - exp(-m.a * m.a * density * stride);
      vec3 own = coloured ? v.rgb : m.rgb;
      // Light from the upper left: brighter where values decrease towards it.
      // Beyond a cut values count as 0, so that cut faces are lit too.
      vec3 lit = p + light * h;
      bool inside = all(greaterThan(lit, cutLow)) && all(lessThan(lit, cutHigh));
      float slope = 0.12 * (value - (inside ? luma(voxel(lit)) : 0.0)) / h;
      own *= 0.58 + 0.42 * slope / (1.0 + abs(slope));
      sum += through * alpha * own;
      through *= 1.0 - alpha;
      if (through < 0.015) break;
    }
  }
  return vec4(min(sum, vec3(1.0)), 1.0 - through);
}

vec4 seenAt(vec2 place) {
  vec2 screen = (place * 2.0 - 1.0) * aspect * lens;
  vec3 along = normalize(ahead + right * screen.x + up * screen.y);
  // No component may be 0, because span() divides by it.
  along += vec3(equal(along, vec3(0.0))) * 1e-6;
  return form == 0 ? cloud(along) : solid(along);
}

void main() {
  if (!fine) { colour = seenAt(at); return; }
  // Four rays per pixel smooth the outlines of forms.
  vec2 x = dFdx(at) * 0.25, y = dFdy(at) * 0.25;
  colour = 0.25 * (seenAt(at + x + y) + seenAt(at + x - y) + seenAt(at - x + y) + seenAt(at - x - y));
}`;
