/** Draws a rectangle of the screen as a strip of four vertices without attributes. */
export const RECT_VERTEX = `#version 300 es
uniform vec4 u_rect; // left, top, right, bottom in clip space
void main() {
  bool right = (gl_VertexID & 1) == 1, bottom = gl_VertexID > 1;
  gl_Position = vec4(right ? u_rect.z : u_rect.x, bottom ? u_rect.w : u_rect.y, 0.0, 1.0);
}`;
