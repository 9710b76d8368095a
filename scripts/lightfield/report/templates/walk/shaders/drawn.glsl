#version 300 es
// Shades one source: its light, its weight, and its inverse distance from the eye. The weight is negative if the source
// is not certain enough to hide what is behind it.
precision highp float;
uniform float certain;
in vec4 shade;
in float towards, nearness;
layout(location = 0) out vec4 colour;
layout(location = 1) out float inverse;
void main() {
  float weight = shade.a * towards;
  colour = vec4(shade.rgb, shade.a >= certain ? weight : -weight);
  inverse = nearness;
}
