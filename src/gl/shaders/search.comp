// SPDX-License-Identifier: LGPL-2.1-or-later
// Lucas-Kanade on one level of a pyramid, like search_tile() of src/flow/lucas_kanade/search. Each
// group takes four of the listed blocks at a time, with an invocation per column of each window: sums
// of integers are exact in any order.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer From { uint from[]; };
layout(std430, binding = 1) readonly buffer Slopes { int slopes[]; };  // then the list of blocks
layout(std430, binding = 2) readonly buffer To { uint to[]; };
layout(std430, binding = 3) buffer Blocks { uvec2 blocks[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int height;
layout(location = 2) uniform int block_side;
layout(location = 3) uniform int removes_lost;

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

const int numbers_a_block = 8;
const int stride = 65;  // 64 invocations; rows start in different banks of the memory

shared bool are_going[4];
shared int partial[numbers_a_block * stride];
shared int totals[numbers_a_block * 4];

// Adds up the numbers of all columns of each block that is going on. Returns false if none is; all
// invocations call it, with the same answer.
bool add_up(bool is_going, inout int numbers[numbers_a_block]) {
  int lane = int(gl_LocalInvocationID.x);
  int block = lane / window;
  int column = lane % window;
  are_going[block] = is_going;
  for (int k = 0; k < numbers_a_block; ++k) partial[k * stride + lane] = numbers[k];
  barrier();
  if (!are_going[0] && !are_going[1] && !are_going[2] && !are_going[3]) return false;
  if (column < numbers_a_block) {
    int total = 0;
    for (int i = 0; i < window; ++i) total += partial[column * stride + block * window + i];
    totals[column * 4 + block] = total;
  }
  barrier();
  for (int k = 0; k < numbers_a_block; ++k) numbers[k] = totals[k * 4 + block];
  return true;
}

// Follows a block of the list, if it is that long.
void follow(int entry) {
  int column = int(gl_LocalInvocationID.x) % window;
  bool exists = entry < slopes[width * height];
  int place = exists ? slopes[width * height + 1 + entry] : 0;
  vec2 flow = uintBitsToFloat(blocks[place]);
  int blocks_across = (width + block_side - 1) / block_side;
  ivec2 first = block_side * ivec2(place % blocks_across, place / blocks_across) - 7;

  ivec3 here[window];  // of this column
  int numbers[numbers_a_block] = int[numbers_a_block](0, 0, 0, 0, 0, 0, 0, 0);
  if (exists) {
    for (int v = 0; v < window; ++v) {
      here[v] = pixel(first.x + column, first.y + v);
      ivec3 products = ivec3(here[v].y * here[v].y, here[v].y * here[v].z, here[v].z * here[v].z);
      for (int k = 0; k < 3; ++k) {
        numbers[2 * k] += products[k] >> 8;
        numbers[2 * k + 1] += products[k] & 255;
      }
    }
  }
  if (!add_up(exists, numbers)) return;
  float xx = rounded(numbers[0], numbers[1]);
  float xy = rounded(numbers[2], numbers[3]);
  float yy = rounded(numbers[4], numbers[5]);
  float least = (xx + yy - sqrt((xx - yy) * (xx - yy) + 4.0 * (xy * xy))) / 512.0;
  float determinant = xx * yy - xy * xy;
  bool found = exists && least >= 1.6e-4 && determinant >= 1.1920929e-7;
  bool is_going = found;
  vec2 before = vec2(0.0);
  for (int i = 0; i < 11; ++i) {
    vec2 cell = floor(flow);
    if (is_going && outside(vec2(first) + cell)) is_going = found = false;
    ivec2 sums[4] = ivec2[4](ivec2(0), ivec2(0), ivec2(0), ivec2(0));
    if (is_going) {
      ivec2 start = first + ivec2(cell) + ivec2(column, 0);
      int upper_left = grey_to(start.x, start.y);
      int upper_right = grey_to(start.x + 1, start.y);
      for (int v = 0; v < window; ++v) {
        int lower_left = grey_to(start.x, start.y + v + 1);
        int lower_right = grey_to(start.x + 1, start.y + v + 1);
        sums[0] += (upper_left - here[v].x) * here[v].yz;
        sums[1] += (upper_right - here[v].x) * here[v].yz;
        sums[2] += (lower_left - here[v].x) * here[v].yz;
        sums[3] += (lower_right - here[v].x) * here[v].yz;
        upper_left = lower_left;
        upper_right = lower_right;
      }
    }
    for (int k = 0; k < 4; ++k) {
      numbers[2 * k] = sums[k].x;
      numbers[2 * k + 1] = sums[k].y;
    }
    if (!add_up(is_going, numbers)) break;
    if (!is_going) continue;
    for (int k = 0; k < 4; ++k) sums[k] = ivec2(numbers[2 * k], numbers[2 * k + 1]);
    vec2 within = flow - cell;
    vec2 above = vec2(sums[0]) + (vec2(sums[1]) - vec2(sums[0])) * within.x;
    vec2 below = vec2(sums[2]) + (vec2(sums[3]) - vec2(sums[2])) * within.x;
    vec2 mismatch = (above + (below - above) * within.y) * (32.0 * scale);
    vec2 move = vec2(xy * mismatch.y - yy * mismatch.x, xy * mismatch.x - xx * mismatch.y) *
                (1.0 / determinant);
    flow += move;
    float square = dot(move, move);
    if (square <= 0.03 * 0.03 || (i >= 4 && square > 2.0 * 2.0)) {
      is_going = false;
    } else if (i > 0 && all(lessThan(abs(move + before), vec2(0.01)))) {
      flow -= move / 2.0;
      is_going = false;
    }
    before = move;
  }
  if (!exists || column != 0) return;
  if (found && !outside(vec2(first) + floor(flow)))
    blocks[place] = floatBitsToUint(flow);
  else if (removes_lost != 0)
    blocks[place] = uvec2(none);
}

void main() {
  int block = int(gl_LocalInvocationID.x) / window;
  int stride_of_groups = 4 * int(gl_NumWorkGroups.x);
  for (int i = 4 * int(gl_WorkGroupID.x); i < slopes[width * height]; i += stride_of_groups) {
    follow(i + block);
    barrier();  // until all know the last sums
  }
}
