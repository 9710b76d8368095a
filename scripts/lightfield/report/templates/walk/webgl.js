// Creates WebGL 2 programs, textures and triangles.

export function program(gl, vertex, fragment) {
  const linked = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(linked, shader);
  }
  gl.linkProgram(linked);
  if (!gl.getProgramParameter(linked, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(linked));
  const uniforms = {};
  for (let number = 0; number < gl.getProgramParameter(linked, gl.ACTIVE_UNIFORMS); number++) {
    const { name } = gl.getActiveUniform(linked, number);
    uniforms[name] = gl.getUniformLocation(linked, name);
  }
  return { linked, uniforms };
}

// Return a texture that shaders read by texel. `image` holds the arguments of texImage2D or texImage3D after the level.
export function texture(gl, kind, ...image) {
  const created = gl.createTexture();
  gl.bindTexture(kind, created);
  gl.texParameteri(kind, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(kind, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  gl.texParameteri(kind, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  gl.texParameteri(kind, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  if (kind === gl.TEXTURE_2D) gl.texImage2D(kind, 0, ...image);
  else gl.texImage3D(kind, 0, ...image);
  return created;
}

// Return triangles or points without attributes. A shader looks everything up by a vertex's number.
export function drawable(gl, kind, corners) {
  const vertices = gl.createVertexArray();
  gl.bindVertexArray(vertices);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
  gl.bindVertexArray(null);
  return { vertices, count: corners.length, kind };
}

// Bind a program's textures. `textures` has the kind and the texture by the uniform's name.
export function bindTextures(gl, uniforms, textures) {
  Object.entries(textures).forEach(([name, [kind, bound]], unit) => {
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(kind, bound);
    gl.uniform1i(uniforms[name], unit);
  });
}
