#version 300 es
// Places vertices; surface.glsl and pixels.glsl follow it. Positions are in units of their distance from the source. So
// infinitely far points need no special case, because clip coordinates are homogeneous.
precision highp float;
precision highp int;
precision highp sampler2D;
uniform sampler2D rays;
// Inverse distances: of the surface, and of where a reflection on it seems to be.
uniform sampler2D inverses;
// Whether reflections are drawn where they seem to be.
uniform bool isSeeming;
// The roots of colours; alpha is the certainty of a pixel.
uniform sampler2D light;
// The number of vertex numbers from row to row, and the distance of the pixels with vertices in motion.
uniform int stride, gridStep;
uniform mat3 turn, back;
uniform vec3 offset;
uniform vec4 lens;
uniform float near, spread, sharp, closest, unmoved;
// The width of a source's pixel at the distance 1, in pixels of the picture.
uniform float pointSize;
out vec4 shade;
out vec2 spot;
out float towards;
out float nearness;

void place(ivec2 pixel, vec3 ray) {
  vec2 distances = texelFetch(inverses, pixel, 0).rg;
  float inverse = isSeeming ? distances.g : distances.r;
  vec3 direction = turn * ray;
  vec3 seen = direction + inverse * offset;
  vec3 eye = back * seen;
  gl_Position = vec4(lens.x * eye.x + lens.z * eye.z, lens.y * eye.y + lens.w * eye.z, -eye.z - 2.0 * near * inverse, -eye.z);
  gl_PointSize = clamp(pointSize / max(-eye.z, 1e-3), 1.0, 16.0);
  float here = length(seen);
  float angle = length(seen / here - direction);
  float penalty = angle + spread * max(1.0 / here - 1.0, 0.0) + sharp;
  shade = texelFetch(light, pixel, 0);
  nearness = inverse / here;
  spot = (vec2(pixel) + 0.5) / vec2(textureSize(rays, 0));
  // The unit of `here` is the source's distance, so a near source counts more: it sees more.
  float worth = min(here, closest) / penalty;
  towards = worth * worth * (!isSeeming && distances.r != distances.g ? unmoved : 1.0);
}

