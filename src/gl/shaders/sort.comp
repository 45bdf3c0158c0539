// SPDX-License-Identifier: LGPL-2.1-or-later
// Half a pass of a stable radix sort of events by a byte of their places or times: counts the values
// of the byte or, in a second run, moves the events. Each group processes a part of the list.
layout(local_size_x = 128) in;

layout(std430, binding = 0) readonly buffer From {
  uint event_count;
  uint capacity;
  uvec2 events[];
};
layout(std430, binding = 1) buffer Counts { uvec2 counts[]; };  // of each value, by group
layout(std430, binding = 2) writeonly buffer To {
  uint moved_count;
  uint moved_capacity;
  uvec2 moved[];
};
layout(location = 0) uniform int width;
layout(location = 1) uniform int is_time;
layout(location = 2) uniform int shift;
layout(location = 3) uniform int moves;

shared uint places[256];  // number of events of each value, or the place of the next one
shared uint masks[1024];  // bits of the invocations that have events of each value
shared uint sums[128];

// Events past the interval, which have bits beside their coordinates, are the last ones.
uint value_of(uvec2 event) {
  uint place = (event.y >> 16 & 0x3fffu) * uint(width) + (event.y & 0x3fffu);
  uint time = (event.y & 0x4000c000u) != 0u ? ~0u : event.x;
  return (is_time != 0 ? time : place) >> shift & 255u;
}

// Sets the places of the group's events: after those of smaller values and of earlier groups.
void find_places(uint groups) {
  uint lane = gl_LocalInvocationID.x;
  uvec2 before = uvec2(0);
  uvec2 total = uvec2(0);
  for (uint group = 0u; group < groups; ++group) {
    uvec2 count = counts[group * 128u + lane];
    if (group < gl_WorkGroupID.x) before += count;
    total += count;
  }
  sums[lane] = total.x + total.y;
  barrier();
  for (uint stride = 1u; stride < 128u; stride <<= 1u) {
    uint left = lane >= stride ? sums[lane - stride] : 0u;
    barrier();
    sums[lane] += left;
    barrier();
  }
  uint start = sums[lane] - total.x - total.y;
  places[2u * lane] = start + before.x;
  places[2u * lane + 1u] = start + total.x + before.y;
}

void move_events(uint first, uint end) {
  uint lane = gl_LocalInvocationID.x;
  for (; first < end; first += 128u) {
    bool exists = first + lane < end;
    uvec2 event = exists ? events[first + lane] : uvec2(0);
    uint value = value_of(event);
    if (exists) atomicOr(masks[4u * value + lane / 32u], 1u << lane % 32u);
    barrier();
    uint rank = 0u;
    uint count = 0u;
    for (uint i = 0u; i < 4u; ++i) {
      uint mask = masks[4u * value + i];
      count += uint(bitCount(mask));
      if (i == lane / 32u) mask &= (1u << lane % 32u) - 1u;
      if (i <= lane / 32u) rank += uint(bitCount(mask));
    }
    if (exists) moved[places[value] + rank] = event;
    barrier();
    if (exists && rank + 1u == count) {
      places[value] += count;
      for (uint i = 0u; i < 4u; ++i) masks[4u * value + i] = 0u;
    }
    barrier();
  }
}

void main() {
  uint lane = gl_LocalInvocationID.x;
  uint group = gl_WorkGroupID.x;
  if (group == 0u && lane == 0u && moves != 0) {
    moved_count = event_count;
    moved_capacity = capacity;
  }
  uint size = min(event_count, capacity);
  uint size_of_group = 128u * max(4u, (size / 128u) / gl_NumWorkGroups.x + 1u);
  uint first = group * size_of_group;
  uint end = min(first + size_of_group, size);
  if (first >= end) return;
  places[lane] = 0u;
  places[lane + 128u] = 0u;
  for (uint i = lane; i < 1024u; i += 128u) masks[i] = 0u;
  barrier();
  if (moves != 0) {
    find_places((size - 1u) / size_of_group + 1u);
    barrier();
    move_events(first, end);
  } else {
    for (uint i = first + lane; i < end; i += 128u) atomicAdd(places[value_of(events[i])], 1u);
    barrier();
    counts[group * 128u + lane] = uvec2(places[2u * lane], places[2u * lane + 1u]);
  }
}
