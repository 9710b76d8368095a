#version 300 es
// Shades a single pixel of a source as a soft splat, like `draw_splats` in synthesis/kernels.py.
precision highp float;
precision highp int;
precision highp sampler2D;
uniform sampler2D light;
uniform float certain;
in vec4 shade;
in float towards, nearness;
in vec2 inSplat;
flat in ivec2 pixel;
flat in int joined;
layout(location = 0) out vec4 colour;
layout(location = 1) out float inverse;

// Return 1 if the neighbour this many pixels right and below is on the pixel's surface, else 0.
float joins(int right, int below) {
  return float((joined >> (3 * below + right + 4)) & 1);
}

void main() {
  ivec2 way = ivec2(inSplat.x > 0.0 ? 1 : -1, inSplat.y > 0.0 ? 1 : -1);
  vec2 part = abs(inSplat);
  // The weights of the pixel itself, and of those beside it, above or below it, and across the corner.
  vec4 weights = vec4(1.0 - part.x, part.x, 1.0 - part.x, part.x) * vec4(1.0 - part.yy, part.yy);
  weights *= vec4(1.0, joins(way.x, 0), joins(0, way.y), joins(way.x, way.y));
  float covered = dot(weights, vec4(1.0));
  // As many of 2 × 2 samples show the splat as its opacity says.
  ivec2 sampled = ivec2(gl_FragCoord.xy) % 2;
  if (2.0 * covered * covered < 0.125 + 0.25 * float((2 * sampled.y + 3 * sampled.x) % 4)) discard;
  vec3 sum = weights.x * shade.rgb;
  if (weights.y > 0.0) sum += weights.y * texelFetch(light, pixel + ivec2(way.x, 0), 0).rgb;
  if (weights.z > 0.0) sum += weights.z * texelFetch(light, pixel + ivec2(0, way.y), 0).rgb;
  if (weights.w > 0.0) sum += weights.w * texelFetch(light, pixel + way, 0).rgb;
  float weight = shade.a * towards;
  colour = vec4(sum / covered, shade.a >= certain ? weight : -weight);
  inverse = nearness;
}
