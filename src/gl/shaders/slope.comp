// SPDX-License-Identifier: LGPL-2.1-or-later
// Scharr gradients of a picture: along x in the lower half of a word, along y in the upper half. Then
// an empty list of blocks.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Picture { uint picture[]; };
layout(std430, binding = 1) writeonly buffer Slopes { int slopes[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int height;

int grey(int x, int y) {
  int u = mirrored(x, width);
  return int(picture[mirrored(y, height) * ((width + 3) / 4) + u / 4] >> (8 * (u % 4)) & 255u);
}

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= width) return;
  if (x == 0 && y == 0) slopes[width * height] = 0;
  int left = 3 * (grey(x - 1, y - 1) + grey(x - 1, y + 1)) + 10 * grey(x - 1, y);
  int right = 3 * (grey(x + 1, y - 1) + grey(x + 1, y + 1)) + 10 * grey(x + 1, y);
  int above = 3 * (grey(x - 1, y - 1) + grey(x + 1, y - 1)) + 10 * grey(x, y - 1);
  int below = 3 * (grey(x - 1, y + 1) + grey(x + 1, y + 1)) + 10 * grey(x, y + 1);
  slopes[y * width + x] = (right - left & 0xffff) | below - above << 16;
}
