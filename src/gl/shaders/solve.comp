// SPDX-License-Identifier: LGPL-2.1-or-later
// Sums the equations over 15 columns and 7 rows of equations, and solves them for the flow of the
// centre; the border is replicated. 64x4 pixels per group, a column of four per invocation.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Equations { float equations[]; };
layout(std430, binding = 1) writeonly buffer Flows { vec2 flows[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int rows;

const int across = 78;  // columns of equations that a group reads
const float regularization = 1e-4 * 105.0 * 105.0;

shared float sums[5 * 4 * across];  // over 7 rows

// Equation of plane k in row i of the rows that a group reads.
float equation(int k, int x, int i) {
  int row = clamp(int(gl_WorkGroupID.y) * 4 - 3 + i, 0, rows - 1);
  return equations[(k * rows + row) * width + x];
}

float window(int k, int row) {
  int first = (k * 4 + row) * across + int(gl_LocalInvocationID.x);
  float sum = 0.0;
  for (int i = 0; i < 15; ++i) sum += sums[first + i];
  return sum;
}

void main() {
  int left = int(gl_WorkGroupID.x) * 64;
  for (int i = int(gl_LocalInvocationID.x); i < across; i += 64) {
    int x = clamp(left - 7 + i, 0, width - 1);
    for (int k = 0; k < 5; ++k) {
      float middle = 0.0;  // rows that all four windows share
      for (int row = 3; row < 7; ++row) middle += equation(k, x, row);
      float above = equation(k, x, 2);
      float below = equation(k, x, 7);
      float nearest = middle + above + below;
      int out_at = k * 4 * across + i;
      sums[out_at] = middle + above + equation(k, x, 1) + equation(k, x, 0);
      sums[out_at + across] = nearest + equation(k, x, 1);
      sums[out_at + 2 * across] = nearest + equation(k, x, 8);
      sums[out_at + 3 * across] = middle + below + equation(k, x, 8) + equation(k, x, 9);
    }
  }
  barrier();
  int x = int(gl_GlobalInvocationID.x);
  if (x >= width) return;
  for (int row = 0; row < 4; ++row) {
    int out_row = int(gl_WorkGroupID.y) * 4 + row;
    if (out_row >= rows) break;
    float g_yy = window(0, row);
    float g_xy = window(1, row);
    float g_xx = window(2, row);
    float h_y = window(3, row);
    float h_x = window(4, row);
    float determinant = g_yy * g_xx - g_xy * g_xy + regularization;
    flows[out_row * width + x] = vec2(g_yy * h_x - g_xy * h_y, g_xx * h_y - g_xy * h_x) / determinant;
  }
}
