// SPDX-License-Identifier: LGPL-2.1-or-later
// Lucas-Kanade on one level of a pyramid, like search_tile() of src/flow/lucas_kanade/search. One
// block per invocation.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer From { uint from[]; };
layout(std430, binding = 1) readonly buffer Slopes { int slopes[]; };
layout(std430, binding = 2) readonly buffer To { uint to[]; };
layout(std430, binding = 3) buffer Blocks { uvec2 blocks[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int height;
layout(location = 2) uniform int block_side;
layout(location = 3) uniform int removes_lost;

const uint none = 0x7fffffffu;
const float scale = 1.0 / 1048576.0;
const int window = 16;

int grey_of(uint word, int x) {
  return int(word >> (8 * (x % 4)) & 255u);
}

int word_of(int x, int y) {
  return mirrored(y, height) * ((width + 3) / 4) + x / 4;
}

int grey_to(int x, int y) {
  int u = mirrored(x, width);
  return grey_of(to[word_of(u, y)], u);
}

// Grey level and slopes.
ivec3 pixel(int x, int y) {
  int u = mirrored(x, width);
  int grey = grey_of(from[word_of(u, y)], u);
  if (x < 0 || x >= width || y < 0 || y >= height) return ivec3(grey, 0, 0);
  int slope = slopes[y * width + x];
  return ivec3(grey, slope << 16 >> 16, slope >> 16);
}

// The exact sum of products is high * 256 + low.
float rounded(int high, int low) {
  return (float(high) * 256.0 + float(low)) * scale;
}

bool outside(vec2 corner) {
  return any(lessThan(corner, vec2(-window))) || corner.x >= float(width) ||
         corner.y >= float(height);
}

void main() {
  int blocks_across = (width + block_side - 1) / block_side;
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= blocks_across) return;
  uvec2 track = blocks[y * blocks_across + x];
  if (track.x == none) return;
  vec2 flow = uintBitsToFloat(track);
  ivec2 first = block_side * ivec2(x, y) - 7;  // pixel of the window's corner

  // The window is read again in each move, because it does not fit into registers.
  ivec3 high = ivec3(0);
  ivec3 low = ivec3(0);
  for (int v = 0; v < window; ++v) {
    for (int u = 0; u < window; ++u) {
      ivec3 here = pixel(first.x + u, first.y + v);
      ivec3 products = ivec3(here.y * here.y, here.y * here.z, here.z * here.z);
      high += products >> 8;
      low += products & 255;
    }
  }
  float xx = rounded(high.x, low.x);
  float xy = rounded(high.y, low.y);
  float yy = rounded(high.z, low.z);
  float least = (xx + yy - sqrt((xx - yy) * (xx - yy) + 4.0 * (xy * xy))) / 512.0;
  float determinant = xx * yy - xy * xy;
  bool found = least >= 1.6e-4 && determinant >= 1.1920929e-7;
  vec2 before = vec2(0.0);
  for (int i = 0; i < 11 && found; ++i) {
    vec2 cell = floor(flow);
    if (outside(vec2(first) + cell)) {
      found = false;
      break;
    }
    ivec2 sums[4] = ivec2[4](ivec2(0), ivec2(0), ivec2(0), ivec2(0));
    ivec2 start = first + ivec2(cell);
    for (int u = 0; u < window; ++u) {
      int upper_left = grey_to(start.x + u, start.y);
      int upper_right = grey_to(start.x + u + 1, start.y);
      for (int v = 0; v < window; ++v) {
        int lower_left = grey_to(start.x + u, start.y + v + 1);
        int lower_right = grey_to(start.x + u + 1, start.y + v + 1);
        ivec3 here = pixel(first.x + u, first.y + v);
        sums[0] += (upper_left - here.x) * here.yz;
        sums[1] += (upper_right - here.x) * here.yz;
        sums[2] += (lower_left - here.x) * here.yz;
        sums[3] += (lower_right - here.x) * here.yz;
        upper_left = lower_left;
        upper_right = lower_right;
      }
    }
    vec2 within = flow - cell;
    vec2 above = vec2(sums[0]) + (vec2(sums[1]) - vec2(sums[0])) * within.x;
    vec2 below = vec2(sums[2]) + (vec2(sums[3]) - vec2(sums[2])) * within.x;
    vec2 mismatch = (above + (below - above) * within.y) * (32.0 * scale);
    vec2 move = vec2(xy * mismatch.y - yy * mismatch.x, xy * mismatch.x - xx * mismatch.y) *
                (1.0 / determinant);
    flow += move;
    float square = dot(move, move);
    if (square <= 0.03 * 0.03 || (i >= 4 && square > 2.0 * 2.0)) break;
    if (i > 0 && all(lessThan(abs(move + before), vec2(0.01)))) {
      flow -= move / 2.0;
      break;
    }
    before = move;
  }
  found = found && !outside(vec2(first) + floor(flow));
  if (found)
    blocks[y * blocks_across + x] = floatBitsToUint(flow);
  else if (removes_lost != 0)
    blocks[y * blocks_across + x] = uvec2(none);
}
