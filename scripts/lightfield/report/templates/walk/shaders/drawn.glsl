#version 300 es
// What is drawn of one source: its light and its inverse distance from the eye.
precision highp float;
in vec4 shade;
in float nearness;
layout(location = 0) out vec4 colour;
layout(location = 1) out float inverse;
void main() {
  colour = shade;
  inverse = nearness;
}
