// Places the vertices of a source's triangles, one for each pixel.

void main() {
  ivec2 pixel = ivec2(gl_VertexID % stride, gl_VertexID / stride);
  place(pixel, texelFetch(rays, pixel, 0).rgb);
}
