// The vertices of a source's triangles, one for each pixel.

void main() {
  ivec2 pixel = ivec2(gl_VertexID % stride, gl_VertexID / stride);
  float torn = texelFetch(rays, pixel, 0).a;
  place(pixel, texelFetch(rays, pixel, 0).rgb, torn > 0.5 ? tornWeight : 1.0);
}
