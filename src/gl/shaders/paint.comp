// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws frames into a ring: the last frame with moved points or, after the last step, the current
// one. Clears the winners. Four pixels per invocation; each layer of groups is a frame.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Last { uint last[]; };
layout(std430, binding = 1) readonly buffer Now { uint now[]; };
layout(std430, binding = 2) buffer Winners { uint winners[]; };
layout(std430, binding = 3) writeonly buffer Between { uint between[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int first;  // step of the first frame
layout(location = 2) uniform int steps;  // of the interval
layout(location = 3) uniform int ring_size;

const uint left = 1u;

uint grey(int x, int y) {
  return last[y * ((width + 3) / 4) + x / 4] >> (8 * (x % 4)) & 255u;
}

void main() {
  int words_across = (width + 3) / 4;
  int word = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (word >= words_across) return;
  int rows = int(gl_NumWorkGroups.y);
  int layer = int(gl_WorkGroupID.z);
  int step = first + layer;
  uint four_now = now[y * words_across + word];
  uint four = 0u;
  for (int x = 4 * word; x < min(4 * word + 4, width); ++x) {
    int place = (layer * rows + y) * width + x;
    uint winner = winners[place];
    uint shade;
    if (winner > left)
      shade = grey(int(winner - 2u) % width, int(winner - 2u) / width);
    else if (winner == left)
      shade = four_now >> (8 * (x % 4)) & 255u;
    else
      shade = grey(x, y);
    four |= shade << (8 * (x % 4));
    winners[place] = 0u;
  }
  between[(step % ring_size * rows + y) * words_across + word] = step == steps ? four_now : four;
}
