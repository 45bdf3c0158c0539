// SPDX-License-Identifier: LGPL-2.1-or-later
// Equations for the improved flow of each pixel of every other row, from the polynomials at both ends
// of its flow, like those of src/flow/farneback/flow_update.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer From { float from[]; };
layout(std430, binding = 1) readonly buffer To { float to[]; };
layout(std430, binding = 2) readonly buffer Flows { vec2 flows[]; };
// Planes of the symmetric matrix (yy, xy, xx) and of the right-hand side (y, x).
layout(std430, binding = 3) writeonly buffer Equations { float equations[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int height;

// Polynomials near the border, fitted to replicated pixels, weigh less.
float border_weight(int i, int size) {
  const float weights[6] = float[6](0.14, 0.14, 0.4472, 0.4472, 0.4472, 1.0);
  return weights[min(i, 5)] * weights[min(size - 1 - i, 5)];
}

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int row = int(gl_WorkGroupID.y);
  if (x >= width) return;
  int y = 2 * row;
  int size = width * height;
  int at = y * width + x;
  int found_size = width * int(gl_NumWorkGroups.y);
  int found_at = row * width + x;
  vec2 flow = flows[found_at];
  float sums[5] =
      float[5](from[at], from[size + at], from[2 * size + at], from[3 * size + at], from[4 * size + at]);
  vec2 end = vec2(x, y) + flow;
  bool is_inside = all(greaterThanEqual(end, vec2(0.0))) &&
                   all(lessThanEqual(end, vec2(width - 1, height - 1)));
  if (is_inside) {
    ivec2 cell = ivec2(end);
    vec2 part = end - vec2(cell);
    int upper = cell.y * width + cell.x;
    int lower = cell.y + 1 < height ? upper + width : upper;
    int right = cell.x + 1 < width ? 1 : 0;
    for (int k = 0; k < 5; ++k) {
      float a = to[upper];
      float b = to[upper + right];
      a += part.y * (to[lower] - a);
      b += part.y * (to[lower + right] - b);
      a += part.x * (b - a);
      sums[k] += k < 2 ? -a : a;
      upper += size;
      lower += size;
    }
  }
  float a_weight = is_inside ? 0.5 : 1.0;
  vec2 b = 0.5 * vec2(sums[0], sums[1]);  // y, x
  vec2 a = a_weight * vec2(sums[2], sums[3]);
  float a_xy = 0.5 * a_weight * sums[4];
  b += a * flow.yx + a_xy * flow;
  float weight = border_weight(x, width) * border_weight(y, height);
  a *= weight;
  a_xy *= weight;
  b *= weight;
  equations[found_at] = a.x * a.x + a_xy * a_xy;
  equations[found_size + found_at] = (a.x + a.y) * a_xy;
  equations[2 * found_size + found_at] = a.y * a.y + a_xy * a_xy;
  equations[3 * found_size + found_at] = a.x * b.x + a_xy * b.y;
  equations[4 * found_size + found_at] = a_xy * b.x + a.y * b.y;
}
