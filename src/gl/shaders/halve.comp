// SPDX-License-Identifier: LGPL-2.1-or-later
// Computes the next level of a Gaussian pyramid, like src/flow/lucas_kanade/pyramid. Four pixels per
// invocation.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Picture { uint picture[]; };
layout(std430, binding = 1) writeonly buffer Half { uint halved[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int height;
layout(location = 2) uniform int half_width;

int grey(int x, int y) {
  int u = mirrored(x, width);
  return int(picture[mirrored(y, height) * ((width + 3) / 4) + u / 4] >> (8 * (u % 4)) & 255u);
}

int row(int x, int y) {
  return grey(x - 2, y) + grey(x + 2, y) + 4 * (grey(x - 1, y) + grey(x + 1, y)) + 6 * grey(x, y);
}

void main() {
  int words_across = (half_width + 3) / 4;
  int word = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (word >= words_across) return;
  uint four = 0u;
  for (int i = 0; i < 4; ++i) {
    int x = 2 * min(4 * word + i, half_width - 1);
    int sum = row(x, 2 * y - 2) + row(x, 2 * y + 2) + 6 * row(x, 2 * y) +
              4 * (row(x, 2 * y - 1) + row(x, 2 * y + 1));
    four |= uint((sum + 128) / 256) << (8 * i);
  }
  halved[y * words_across + word] = four;
}
