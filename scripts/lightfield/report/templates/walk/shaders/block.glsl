#version 300 es
// Shades a block of pixels of one source in motion: those that are about as far away as the point.
precision highp float;
precision highp int;
precision highp sampler2D;
uniform sampler2D light, inverses;
uniform int gridStep;
uniform float certain, deepest;
flat in ivec2 corner;
flat in float own;
in float towards, nearness;
layout(location = 0) out vec4 colour;
layout(location = 1) out float inverse;

void main() {
  ivec2 pixel = min(corner + ivec2(gl_PointCoord * float(gridStep)), textureSize(light, 0) - 1);
  float other = texelFetch(inverses, pixel, 0).g;
  if (min(other, own) < (1.0 - deepest) * max(other, own)) discard;
  vec4 shade = texelFetch(light, pixel, 0);
  float weight = shade.a * towards;
  colour = vec4(shade.rgb, shade.a >= certain ? weight : -weight);
  inverse = nearness;
}
