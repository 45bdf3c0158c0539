// SPDX-License-Identifier: LGPL-2.1-or-later
// Blurs a picture with a Gaussian and shrinks it, like PyramidLevel of src/flow/farneback: first
// along the columns, then along the rows. 64 pixels of a row per group.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Picture { uint picture[]; };
layout(std430, binding = 1) readonly buffer Weights { float weights[]; };
layout(std430, binding = 2) writeonly buffer Shrunk { float shrunk[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int height;
layout(location = 2) uniform int shrunk_width;
layout(location = 3) uniform int shrunk_height;
layout(location = 4) uniform int reach;

// Column sums that 64 pixels depend on, at a factor of up to 8.
shared float sums[576];

float grey(int x, int y) {
  int word = mirrored(y, height) * ((width + 3) / 4) + x / 4;
  return float(picture[word] >> (8 * (x % 4)) & 255u);
}

void main() {
  int lane = int(gl_LocalInvocationID.x);
  int left = int(gl_WorkGroupID.x) * 64;
  int y = int(gl_WorkGroupID.y);
  float down;
  float right;
  int upper = place(y, height, shrunk_height, down);
  int end = place(min(left + 63, shrunk_width - 1), width, shrunk_width, right) + 1 + reach;
  int start = place(left, width, shrunk_width, right) - reach;
  for (int i = lane; i <= end - start; i += 64) {
    int x = mirrored(start + i, width);
    float sum = 0.0;
    float above = grey(x, upper - reach);
    for (int t = -reach; t <= reach; ++t) {
      float below = grey(x, upper + t + 1);
      sum += weights[reach + t] * (above + down * (below - above));
      above = below;
    }
    sums[i] = sum;
  }
  barrier();
  int x = left + lane;
  if (x >= shrunk_width) return;
  int middle = place(x, width, shrunk_width, right) - start;
  float sum = 0.0;
  for (int t = -reach; t <= reach; ++t) {
    float here = sums[middle + t];
    sum += weights[reach + t] * (here + right * (sums[middle + t + 1] - here));
  }
  shrunk[y * shrunk_width + x] = sum;
}
