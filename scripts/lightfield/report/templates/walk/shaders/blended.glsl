#version 300 es
// Blends the layers of all sources, like `blend` in synthesis/kernels.py. A pixel is the mean of samples × samples
// texels of the layers.
precision highp float;
precision highp int;
precision highp sampler2DArray;
uniform sampler2DArray colours, inverses;
uniform int count, samples;
uniform float same, hidden, behind, far, dark;
// Linear light; alpha is the part of the sources that show the nearest surface, 0 in a hole.
layout(location = 0) out vec4 colour;
layout(location = 1) out float inverse;

float sum, number, used;
vec3 light;

// Add a sample's colour to the sums. Return the inverse distance of its nearest surface, −1 in a hole.
float addSample(ivec2 texel) {
  float nearest = -1.0, front = -1.0, total = 0.0, parts = 0.0, mean = 0.0;
  vec3 inverted = vec3(0.0);
  for (int k = 0; k < count; k++) {
    float near = texelFetch(inverses, ivec3(texel, k), 0).r;
    nearest = max(nearest, near);
    if (texelFetch(colours, ivec3(texel, k), 0).a > 0.0) front = max(front, near);
  }
  if (nearest < 0.0) return -1.0;
  for (int k = 0; k < count; k++) {
    float near = texelFetch(inverses, ivec3(texel, k), 0).r;
    if (near < 0.0) continue;
    vec4 drawn = texelFetch(colours, ivec3(texel, k), 0);
    float weight = abs(drawn.a);
    if (near >= nearest - max(same * nearest, far)) {
      parts += weight;
      mean += weight * near;
      used += 1.0;
    }
    // A surface of which a source is certain hides what is behind it, first partly, then completely.
    float lag = (front - near) / max(front, far);
    float counted = max(near, max(behind * nearest, far));
    weight *= counted * counted * (1.0 - clamp((lag - same) / (hidden - same), 0.0, 1.0));
    inverted += weight / (drawn.rgb + dark);
    total += weight;
  }
  vec3 root = total / inverted - dark;
  light += root * root;
  number += 1.0;
  return mean / parts;
}

void main() {
  ivec2 first = samples * ivec2(gl_FragCoord.xy);
  light = vec3(0.0);
  used = number = 0.0;
  vec4 nears = vec4(-1.0);
  for (int k = 0; k < samples * samples; k++) {
    float near = addSample(first + ivec2(k % samples, k / samples));
    if (k == 0) nears.x = near;
    else if (k == 1) nears.y = near;
    else if (k == 2) nears.z = near;
    else nears.w = near;
  }
  colour = number > 0.0 ? vec4(light / number, used / (number * float(count))) : vec4(0.0);
  // Average only distances on the surface of the second nearest, because distances must not blend across an edge.
  vec2 larger = max(nears.xz, nears.yw), smaller = min(nears.xz, nears.yw);
  float second = max(min(larger.x, larger.y), max(smaller.x, smaller.y));
  float middle = second >= 0.0 ? second : max(larger.x, larger.y);
  float total = 0.0, parts = 0.0;
  for (int k = 0; k < 4; k++) {
    if (nears[k] < 0.0 || abs(nears[k] - middle) > max(same * middle, far)) continue;
    total += nears[k];
    parts += 1.0;
  }
  inverse = parts > 0.0 ? total / parts : 0.0;
}
