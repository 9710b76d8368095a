#version 300 es
// Shades one source in motion. Reads the light at each pixel, because triangles cover several of the source's pixels.
precision highp float;
precision highp sampler2D;
uniform sampler2D light;
uniform float certain;
in vec2 spot;
in float towards, nearness;
layout(location = 0) out vec4 colour;
layout(location = 1) out float inverse;
void main() {
  vec4 shade = texture(light, spot);
  float weight = shade.a * towards;
  colour = vec4(shade.rgb, shade.a >= certain ? weight : -weight);
  inverse = nearness;
}
