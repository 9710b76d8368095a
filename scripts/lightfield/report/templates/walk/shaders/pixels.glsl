// Places the corners of the splats of single pixels beside a tear.
uniform float far, splat, splatSame;
// The place in pixels right of and below the pixel's middle.
out vec2 inSplat;
flat out ivec2 pixel;
// A bit for each of 3 × 3 pixels, row by row: whether it is on the surface of the one in the middle.
flat out int joined;

// Return a neighbour that has a ray, or else the pixel itself.
ivec2 beside(ivec2 pixel, ivec2 way) {
  ivec2 other = clamp(pixel + way, ivec2(0), textureSize(rays, 0) - 1);
  return texelFetch(inverses, other, 0).r < 0.0 ? pixel : other;
}

int joinedPixels(ivec2 pixel) {
  ivec2 last = textureSize(inverses, 0) - 1;
  float own = texelFetch(inverses, pixel, 0).r;
  int bits = 0;
  for (int k = 0; k < 9; k++) {
    ivec2 texel = pixel + ivec2(k % 3, k / 3) - 1;
    // Without a ray the inverse distance is −1.
    float other = texel == clamp(texel, ivec2(0), last) ? texelFetch(inverses, texel, 0).r : -1.0;
    if (other >= 0.0 && abs(other - own) <= max(splatSame * max(other, own), far)) bits |= 1 << k;
  }
  return bits;
}

void main() {
  int number = gl_VertexID / 4;
  pixel = ivec2(number % stride, number / stride);
  vec3 ray = texelFetch(rays, pixel, 0).rgb;
  ivec2 toLeft = beside(pixel, ivec2(-1, 0)), toRight = beside(pixel, ivec2(1, 0));
  ivec2 above = beside(pixel, ivec2(0, -1)), below = beside(pixel, ivec2(0, 1));
  vec3 across = (texelFetch(rays, toRight, 0).rgb - texelFetch(rays, toLeft, 0).rgb) / float(max(toRight.x - toLeft.x, 1));
  vec3 down = (texelFetch(rays, below, 0).rgb - texelFetch(rays, above, 0).rgb) / float(max(below.y - above.y, 1));
  joined = joinedPixels(pixel);
  inSplat = splat * (2.0 * vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1) - 1.0);
  place(pixel, normalize(ray + inSplat.x * across + inSplat.y * down));
}
