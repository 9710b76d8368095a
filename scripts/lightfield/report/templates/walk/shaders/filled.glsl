#version 300 es
// Fills pixels of a level of a picture from the next coarser one, like `enlarge` in synthesis/kernels.py.
precision highp float;
precision highp int;
precision highp sampler2D;
uniform sampler2D colours, inverses, coarseColours, coarseInverses;
uniform float far;
uniform bool isFirst;

// Return a filled pixel's light and inverse distance.
void fill(ivec2 texel, out vec4 colour, out float inverse) {
  colour = texelFetch(colours, texel, 0);
  inverse = texelFetch(inverses, texel, 0).r;
  float seen = isFirst ? step(1e-6, colour.a) : colour.a;
  if (seen >= 1.0) return;
  ivec2 last = textureSize(coarseColours, 0) - 1;
  ivec2 nearest = texel / 2;
  ivec2 other = clamp(nearest + 2 * (texel % 2) - 1, ivec2(0), last);
  float total = 0.0, near = 0.0;
  vec3 light = vec3(0.0);
  for (int k = 0; k < 4; k++) {
    ivec2 coarse = ivec2((k & 1) == 1 ? other.x : nearest.x, k > 1 ? other.y : nearest.y);
    float value = texelFetch(coarseInverses, coarse, 0).r;
    float weight = ((k & 1) == 1 ? 0.25 : 0.75) * (k > 1 ? 0.25 : 0.75) / ((value + far) * (value + far));
    total += weight;
    near += weight * value;
    light += weight * texelFetch(coarseColours, coarse, 0).rgb;
  }
  colour = vec4(mix(light / total, colour.rgb, seen), 1.0);
  inverse = mix(near / total, inverse, seen);
}
