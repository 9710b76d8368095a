// Places the corners of single pixels beside a tear. A corner's ray is the mean of those around it.

// Return a neighbour that has a ray, or else the pixel itself.
ivec2 beside(ivec2 pixel, ivec2 way) {
  ivec2 other = clamp(pixel + way, ivec2(0), textureSize(rays, 0) - 1);
  return texelFetch(inverses, other, 0).r < 0.0 ? pixel : other;
}
void main() {
  int number = gl_VertexID / 4;
  ivec2 pixel = ivec2(number % stride, number / stride);
  vec3 ray = texelFetch(rays, pixel, 0).rgb;
  ivec2 toLeft = beside(pixel, ivec2(-1, 0)), toRight = beside(pixel, ivec2(1, 0));
  ivec2 above = beside(pixel, ivec2(0, -1)), below = beside(pixel, ivec2(0, 1));
  vec3 across = (texelFetch(rays, toRight, 0).rgb - texelFetch(rays, toLeft, 0).rgb) / float(max(toRight.x - toLeft.x, 1));
  vec3 down = (texelFetch(rays, below, 0).rgb - texelFetch(rays, above, 0).rgb) / float(max(below.y - above.y, 1));
  vec2 corner = vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1) - 0.5;
  place(pixel, normalize(ray + corner.x * across + corner.y * down));
}
