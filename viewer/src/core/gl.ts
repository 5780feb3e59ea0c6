import { DrawError } from "./errors";

/** Compiles and links a program. @param name for error messages  @throws DrawError with the compiler's log, or when the context is lost */
export function linkProgram(gl: WebGL2RenderingContext, name: string, vertex: string, fragment: string): WebGLProgram {
  const program = gl.createProgram();
  for (const [type, source] of [
    [gl.VERTEX_SHADER, vertex],
    [gl.FRAGMENT_SHADER, fragment],
  ] as const) {
    const shader = gl.createShader(type);
    if (!shader) throw new DrawError("the WebGL context is lost");
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    gl.deleteShader(shader); // freed with the program
  }
  gl.linkProgram(program);
  if (gl.getProgramParameter(program, gl.LINK_STATUS) || gl.isContextLost()) return program;
  const logs = (gl.getAttachedShaders(program) ?? []).map((shader) => gl.getShaderInfoLog(shader));
  throw new DrawError(`shader ${name}: ${[gl.getProgramInfoLog(program), ...logs].join(" ").trim()}`);
}

/** Creates an empty texture without mipmaps, clamped at its edges and bound to the active unit. @param format internal format, e.g. gl.RGBA8  @param width texels  @param height texels  @param filter minification and magnification */
export function makeTexture(
  gl: WebGL2RenderingContext,
  format: number,
  width: number,
  height: number,
  filter: number = gl.NEAREST,
): WebGLTexture {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, filter);
  for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
  gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
  return texture;
}
