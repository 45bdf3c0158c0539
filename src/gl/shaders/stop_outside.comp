// SPDX-License-Identifier: LGPL-2.1-or-later
// Sets the flow to 0 outside the region of interest around a box of changed pixels, as defined in
// src/flow/region_of_interest_flow.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Box { int box[4]; };  // as in changed_box
layout(std430, binding = 1) writeonly buffer Flows { vec2 flows[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int height;
layout(location = 2) uniform int surroundings;
layout(location = 3) uniform int side_step;

// First and end of the region along an axis.
ivec2 range(int from, int to, int size) {
  int wanted = to - from + 2 * surroundings;
  int side = min((wanted + side_step - 1) / side_step * side_step, size);
  int first = clamp(from - (side - (to - from)) / 2, 0, size - side);
  return ivec2(first, first + side);
}

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= width) return;
  bool is_empty = box[2] == 0;
  ivec2 columns = range(width - box[0], box[2], width);
  ivec2 rows = range(height - box[1], box[3], height);
  bool is_inside = x >= columns.x && x < columns.y && y >= rows.x && y < rows.y;
  bool is_whole = 2 * (columns.y - columns.x) * (rows.y - rows.x) > width * height;
  if (is_empty || !(is_inside || is_whole)) flows[y * width + x] = vec2(0.0);
}
