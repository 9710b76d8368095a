#version 300 es
// Makes the next coarser level of a picture, like `shrink` in synthesis/kernels.py. The farthest pixels count most.
precision highp float;
precision highp int;
precision highp sampler2D;
uniform sampler2D colours, inverses;
uniform float far;
uniform bool isFirst;
layout(location = 0) out vec4 colour;
layout(location = 1) out float inverse;

void main() {
  ivec2 first = 2 * ivec2(gl_FragCoord.xy);
  ivec2 size = textureSize(colours, 0);
  vec4 lights[4];
  float nears[4];
  float behind = 1e30, total = 0.0, parts = 0.0;
  for (int k = 0; k < 4; k++) {
    ivec2 texel = first + ivec2(k & 1, k >> 1);
    lights[k] = vec4(0.0);
    if (texel.x >= size.x || texel.y >= size.y) continue;
    lights[k] = texelFetch(colours, texel, 0);
    nears[k] = texelFetch(inverses, texel, 0).r + far;
    if (isFirst) lights[k].a = step(1e-6, lights[k].a);
    if (lights[k].a > 0.0) behind = min(behind, nears[k]);
  }
  colour = vec4(0.0);
  inverse = 0.0;
  for (int k = 0; k < 4; k++) {
    if (lights[k].a <= 0.0) continue;
    float part = behind / nears[k];
    float weight = lights[k].a * part * part;
    total += weight;
    parts += lights[k].a;
    colour.rgb += weight * lights[k].rgb;
    inverse += weight * (nears[k] - far);
  }
  if (total > 0.0) {
    colour.rgb /= total;
    inverse /= total;
  }
  colour.a = min(parts, 1.0);
}
