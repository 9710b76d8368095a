#version 300 es
// The layers of all sources, blended where they show the same surface.
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
uniform sampler2DArray colours, inverses;
uniform sampler2D palette;
uniform int count, mode;
uniform ivec2 corner;
uniform float gain, white, same, far, edge;
uniform vec2 shown;
out vec4 result;
vec3 encoded(vec3 v) {
  v = clamp(v, 0.0, 1.0);
  return mix(12.92 * v, 1.055 * pow(v, vec3(1.0 / 2.4)) - 0.055, step(vec3(0.0031308), v));
}
void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy) - corner;
  float nearest = -1.0, used = 0.0, total = 0.0, mean = 0.0;
  for (int k = 0; k < count; k++) nearest = max(nearest, texelFetch(inverses, ivec3(pixel, k), 0).r);
  vec3 sum = vec3(0.0);
  for (int k = 0; k < count; k++) {
    float inverse = texelFetch(inverses, ivec3(pixel, k), 0).r;
    if (inverse < 0.0 || inverse < nearest - max(same * nearest, far)) continue;
    vec4 drawn = texelFetch(colours, ivec3(pixel, k), 0);
    sum += drawn.a * drawn.rgb;
    mean += drawn.a * inverse;
    total += drawn.a;
    used += 1.0;
  }
  bool hole = nearest < 0.0;
  vec3 v = gain * sum / max(total, 1e-30);
  vec3 colour = hole ? vec3(0.0) : encoded(v * (1.0 + v / (white * white)) / (1.0 + v));
  if (mode == 1) {
    float place = (log2(total / max(mean, 1e-9)) - shown.x) / (shown.y - shown.x);
    colour = hole ? vec3(0.0) : mean <= 0.0 ? vec3(0.69) : texture(palette, vec2(clamp(place, 0.002, 0.998), 0.5)).rgb;
  } else if (mode == 2) {
    colour = hole ? vec3(1.0, 0.0, 0.8) : vec3(dot(colour, vec3(0.3, 0.6, 0.1)) * 0.6);
  } else if (mode == 3) {
    colour = hole ? vec3(0.0) : texture(palette, vec2(used / float(count), 0.5)).rgb;
  }
  // The edge of the volume is felt: colour fades towards it, from where the walk begins at most.
  result = vec4(mix(colour, vec3(dot(colour, vec3(1.0 / 3.0))) * 0.5, edge), 1.0);
}
