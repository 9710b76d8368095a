// Fills a level of a picture; filled.glsl precedes it.
layout(location = 0) out vec4 colour;
layout(location = 1) out float inverse;

void main() {
  fill(ivec2(gl_FragCoord.xy), colour, inverse);
}
