// Places points in motion, for the nearest and the farthest pixel of each block of gridStep × gridStep pixels.
flat out ivec2 corner;
// The pixel's inverse distance from the source.
flat out float own;

void main() {
  ivec2 pixel = ivec2(gl_VertexID % stride, gl_VertexID / stride);
  corner = pixel / gridStep * gridStep;
  own = texelFetch(inverses, pixel, 0).g;
  place(pixel, texelFetch(rays, pixel, 0).rgb);
}
