// Shows the picture on the whole viewport: its light, depth, holes or sources, by `mode`. filled.glsl precedes it.
precision highp sampler3D;
uniform sampler2D palette;
// A table of pixels by light: blue across, green down, red from slice to slice.
uniform sampler3D look;
uniform bool hasLook;
// The toe and the highest light of the table.
uniform vec2 lookRange;
uniform bool fillsHoles;
uniform int mode;
uniform ivec2 corner;
uniform float gain, white, edge;
uniform vec2 shown;
out vec4 result;
vec3 encoded(vec3 v) {
  v = clamp(v, 0.0, 1.0);
  return mix(12.92 * v, 1.055 * pow(v, vec3(1.0 / 2.4)) - 0.055, step(vec3(0.0031308), v));
}

// Develop light with the look, or else by tone mapping.
vec3 developed(vec3 v) {
  if (!hasLook) return encoded(v * (1.0 + v / (white * white)) / (1.0 + v));
  float side = float(textureSize(look, 0).x);
  vec3 place = clamp(log(1.0 + max(v, 0.0) / lookRange.x) / log(1.0 + lookRange.y / lookRange.x), 0.0, 1.0);
  return texture(look, (place.bgr * (side - 1.0) + 0.5) / side).rgb;
}

void main() {
  ivec2 texel = ivec2(gl_FragCoord.xy) - corner;
  vec4 light = texelFetch(colours, texel, 0);
  float inverse = texelFetch(inverses, texel, 0).r;
  float used = mode == 0 ? 1.0 : light.a;
  bool hole = used <= 0.0;
  if (fillsHoles) fill(texel, light, inverse);
  vec3 colour = developed(gain * light.rgb);
  if (mode == 1) {
    float depth = (-log2(max(inverse, 1e-9)) - shown.x) / (shown.y - shown.x);
    colour = hole ? vec3(0.0) : inverse <= 0.0 ? vec3(0.69) : texture(palette, vec2(clamp(depth, 0.002, 0.998), 0.5)).rgb;
  } else if (mode == 2) {
    colour = hole ? vec3(1.0, 0.0, 0.8) : vec3(dot(colour, vec3(0.3, 0.6, 0.1)) * 0.6);
  } else if (mode == 3) {
    colour = hole ? vec3(0.0) : texture(palette, vec2(used, 0.5)).rgb;
  }
  // Colours fade towards the volume's edge, so that the user notices it. They never fade at the start of the walk.
  result = vec4(mix(colour, vec3(dot(colour, vec3(1.0 / 3.0))) * 0.5, edge), 1.0);
}
