// SPDX-License-Identifier: LGPL-2.1-or-later
// Simulates a pixel over an interval, like src/dvs: the response to light of row_filter.cpp, the
// moving light of moving_light.cpp, and pixel_solver.cpp with the crossings of trajectory.cpp. An
// invocation per pixel. Times are microseconds.
//
// The precision of floats suffices: levels are relative to the reference at the start of a
// sub-interval, and the low pass is calculated without the large terms that cancel out.
layout(local_size_x = 64) in;

// Two copies of the planes below: the state before the interval and after it.
layout(std430, binding = 0) buffer State { uint state[]; };
// Luma and flow of the frames.
layout(std430, binding = 1) readonly buffer Scene { uint scene[]; };
layout(std430, binding = 2) readonly buffer Tables {
  uvec2 key;  // hash of the seed
  float positive_mean;
  float negative_mean;
  float threshold_sigma;
  float threshold_jitter;
  float gap;
  float latency;
  float latency_jitter;
  float growth_rate;      // fall of the thresholds' growth, 0 without adaptation
  float growth_duration;  // by which an event prolongs it
  uint tables[];          // responses by luma, then those that `plans` points to
};
layout(std430, binding = 3) buffer Events {
  uint event_count;
  uint capacity;
  uvec2 events[];  // as Event
};
layout(location = 0) uniform int width;
layout(location = 1) uniform int height;
layout(location = 2) uniform int before;  // plane of the state before the interval
layout(location = 3) uniform int after;
layout(location = 4) uniform int has_bandwidth;
layout(location = 5) uniform int has_noise;
layout(location = 6) uniform int holds;      // the refractory period holds the reference at the signal
layout(location = 7) uniform int luma_bits;  // of the responses
layout(location = 8) uniform int saturated;  // luma from which a pixel keeps a higher response
layout(location = 9) uniform int plans;      // first word of the plan of each tile
layout(location = 10) uniform int moves;     // scene: this frame, the last one, flow
layout(location = 11) uniform int max_events;
layout(location = 12) uniform int end_time;  // of the interval, whole microseconds
layout(location = 13) uniform int end_rest;  // eighths of a microsecond

// Planes of the state.
const int target_plane = 0;
const int signal_plane = 1;
const int reference_plane = 2;
const int positive_plane = 3;
const int negative_plane = 4;
const int leak_plane = 5;
const int refractory_plane = 6;
const int noise_plane = 7;
const int growth_plane = 8;

const float rounding = 2e-6;  // a level missed by less counts as reached
const float never = 1e30;     // threshold of dead pixels, too
const float min_gap = 1.0;
const uvec2 event_purpose = uvec2(8, 0);

/* random numbers, as 64-bit integers: low word, high word */

uvec2 sum(uvec2 a, uvec2 b) {
  uint carry;
  uint low = uaddCarry(a.x, b.x, carry);
  return uvec2(low, a.y + b.y + carry);
}

uvec2 product(uvec2 a, uvec2 b) {
  uint low;
  uint high;
  umulExtended(a.x, b.x, high, low);
  return uvec2(low, high + a.x * b.y + a.y * b.x);
}

uvec2 with_shifted(uvec2 z, int bits) {
  return z ^ uvec2(z.x >> bits | z.y << (32 - bits), z.y >> bits);
}

uvec2 mixed(uvec2 z) {
  z = product(with_shifted(z, 30), uvec2(0x1ce4e5b9u, 0xbf58476du));
  z = product(with_shifted(z, 27), uvec2(0x133111ebu, 0x94d049bbu));
  return with_shifted(z, 31);
}

uvec2 hash_of(uint pixel, uvec2 purpose, uvec2 counter) {
  return mixed(sum(mixed(sum(mixed(sum(key, uvec2(pixel, 0))), purpose)), counter));
}

// Greater than 0, up to 1.
float uniform_of(uvec2 bits) {
  return (float(bits.y) + 0.5 + float(bits.x >> 8) * exp2(-24.0)) * exp2(-32.0);
}

float minus_logarithm(uvec2 bits) {
  if (bits.y >= 0xf0000000u) {  // the rest to 1 is more precise
    float q = float(~bits.y) * exp2(-32.0);
    return q * (1.0 + q * (0.5 + q * (1.0 / 3.0 + q * (0.25 + q * 0.2))));
  }
  int exponent;
  float mantissa = frexp(uniform_of(bits), exponent);
  const float root = 0.70710678;
  float s = (mantissa - root) / (mantissa + root);
  float s2 = s * s;
  float series = 1.0 + s2 * (1.0 / 3.0 + s2 * (0.2 + s2 * (1.0 / 7.0 + s2 / 9.0)));
  return (0.5 - float(exponent)) * 0.69314718 - 2.0 * s * series;
}

vec2 normals(uvec2 bits) {
  float radius = sqrt(2.0 * max(0.0, minus_logarithm(bits)));
  uvec2 second = mixed(sum(bits, uvec2(1, 0)));
  float x = 0.78539816 * uniform_of(uvec2(second.x << 3, second.y << 3 | second.x >> 29));
  float x2 = x * x;
  float cosine = 1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 + x2 * (-1.0 / 720.0 + x2 / 40320.0)));
  float sine = x + x * x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 + x2 * (-1.0 / 5040.0)));
  vec2 point = (second.y >> 29 & 1u) != 0u ? vec2(sine, cosine) : vec2(cosine, sine);
  if ((second.y >> 31) != 0u) point.x = -point.x;
  if ((second.y >> 30 & 1u) != 0u) point.y = -point.y;
  return radius * point;
}

uint noise_budget(uvec2 bits) {
  return uint(clamp(minus_logarithm(bits) * 134217728.0, 1.0, 4294967040.0));
}

/* trajectories */

// The signal less the reference at the start: start + rise t, and the change of a low pass whose
// input rises by `slope`, and which is `lag` above it at first.
struct Trajectory {
  float start;
  float rise;
  float slope;
  float lag;
  float bandwidth;  // 0 for a straight line
};

// (1 - exp(-x)) / x
float mean_decay(float x) {
  if (x > 0.25) return (1.0 - exp(-x)) / x;
  return 1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0))));
}

float value_at(Trajectory c, float t) {
  float straight = c.start + c.rise * t;
  if (c.bandwidth == 0.0) return straight;
  float mean = mean_decay(c.bandwidth * t);
  return straight + t * (c.slope * (1.0 - mean) - c.lag * c.bandwidth * mean);
}

float slope_at(Trajectory c, float t) {
  if (c.bandwidth == 0.0) return c.rise;
  float x = c.bandwidth * t;
  float mean = mean_decay(x);
  return c.rise + c.slope * x * mean - c.bandwidth * c.lag * exp(-x);
}

// Turning point after `from`.
vec2 turn_after(Trajectory c, vec2 from, vec2 end) {
  float ratio = (c.slope + c.bandwidth * c.lag) / (c.slope + c.rise);
  float t = log(ratio) / c.bandwidth;
  if (!(t > from.x)) return from;
  return t < end.x ? vec2(t, value_at(c, t)) : end;
}

// Time at which a level is crossed between `a` and `b`, once, or missed by rounding: Newton's
// method, with bisection as fallback.
float time_of(Trajectory c, float level, vec2 a, vec2 b) {
  float t = a.x + clamp((level - a.y) / (b.y - a.y), 0.0, 1.0) * (b.x - a.x);
  if (c.bandwidth == 0.0) return t;
  float resolution = max(0.005, 5e-7 * b.x);
  float early = a.x;
  float late = b.x;
  for (int i = 0; i < 64 && late - early > resolution; ++i) {
    float beyond = value_at(c, t) - level;
    if ((beyond > 0.0) == (b.y > a.y))
      late = t;
    else
      early = t;
    float next = t - beyond / slope_at(c, t);
    bool is_within = next >= early && next <= late;
    bool ends = is_within && abs(next - t) < resolution;
    t = is_within ? next : 0.5 * (early + late);
    if (ends) break;
  }
  return t;
}

// First point from `from` to `end` at or above `upper` (returns 1), or at or below `lower` (-1); 0
// if there is none. Times `side`, the slope never decreases, so that only the lower of two levels
// can be crossed in both directions.
int first_crossing(Trajectory c, vec2 from, vec2 end, float lower, float upper, out vec2 point) {
  point = from;
  if (from.y >= upper) return 1;
  if (from.y <= lower) return -1;
  float side = c.slope + c.bandwidth * c.lag < 0.0 ? -1.0 : 1.0;
  float near = side > 0.0 ? lower : -upper;
  float far = side > 0.0 ? upper : -lower;
  float last = side * end.y;
  bool turns = c.bandwidth != 0.0 && last > near && side * slope_at(c, from.x) < 0.0 &&
               side * slope_at(c, end.x) > 0.0;
  vec2 nearest = turns ? turn_after(c, from, end) : end;
  if (side * nearest.y <= near + rounding) {
    point = vec2(time_of(c, side * near, from, nearest), side * near);
    return -int(side);
  }
  if (last < far - rounding) return 0;
  point = vec2(time_of(c, side * far, from, end), side * far);
  return int(side);
}

/* light */

int grey(int frame, ivec2 at) {
  int word = (frame * height + at.y) * ((width + 3) / 4) + at.x / 4;
  return int(scene[word] >> (8 * (at.x % 4)) & 255u);
}

// Bilinear sample at a position in 1/65536 of a pixel, rounded to 1/64; in 1/4096 of a grey level.
int sampled(int frame, ivec2 at) {
  ivec2 end = ivec2(width, height) - 1;
  ivec2 place = clamp(at + 512 >> 10, ivec2(0), end * 64);
  ivec2 a = place >> 6;
  ivec2 b = min(a + 1, end);
  ivec2 part = place & 63;
  int upper = grey(frame, a) * (64 - part.x) + grey(frame, ivec2(b.x, a.y)) * part.x;
  int lower = grey(frame, ivec2(a.x, b.y)) * (64 - part.x) + grey(frame, b) * part.x;
  return upper * (64 - part.y) + lower * part.y;
}

// Luma at the end of step j, of 16 bits if luma_bits is.
int luma_at(ivec2 at, ivec2 motion, int j, int steps) {
  if (j == steps) return luma_bits == 8 ? grey(0, at) : 257 * grey(0, at);
  int earlier = sampled(1, (at << 16) - j * motion);
  int later = sampled(0, (at << 16) + (steps - j) * motion);
  int weight = (j * 256 + steps / 2) / steps;
  int blended = earlier * 256 + (later - earlier) * weight + (1 << 7) >> 8;
  return blended * 257 + (1 << 11) >> 12;
}

/* a pixel */

float loaded(int plane, int pixel) {
  return uintBitsToFloat(state[(before + plane) * width * height + pixel]);
}

void store(int plane, int pixel, uint value) {
  state[(after + plane) * width * height + pixel] = value;
}

void store(int plane, int pixel, float value) {
  store(plane, pixel, floatBitsToUint(value));
}

float table(int i) {
  return uintBitsToFloat(tables[i]);
}

uvec2 draw;  // counter of the random numbers
int pixel;
float positive;
float negative;
float reference;  // less the one at the start of the sub-interval
float ready;      // earliest time of the next event
float growth_end;
uvec2 begin;      // of the sub-interval: whole microseconds, and the bits of the rest
uint next_time;   // of an event

uvec2 next_hash() {
  uvec2 hash = hash_of(uint(pixel), event_purpose, draw);
  draw.x += 1u;
  return hash;
}

float fixed_threshold(float mean, uint purpose) {
  if (threshold_sigma <= 0.0) return mean;
  float drawn = normals(hash_of(uint(pixel), uvec2(purpose, 0), uvec2(0))).x;
  return max(mean + threshold_sigma * drawn, max(mean / 10.0, 1e-3));
}

// Emits an event and starts the refractory period.
void fire(float crossed, int polarity) {
  bool is_dead = positive >= never;
  if (growth_rate > 0.0) growth_end = max(crossed, growth_end) + growth_duration;
  float t = crossed + latency;
  if (latency_jitter > 0.0) t = max(crossed, t + latency_jitter * normals(next_hash()).x);
  ready = t + gap;
  if (is_dead) return;
  float time = uintBitsToFloat(begin.y) + t;
  uint whole = max(begin.x + uint(time), next_time);
  next_time = whole + 1u;
  uint place = uint(pixel % width) | uint(pixel / width) << 16 | (polarity > 0 ? 1u << 31 : 0u);
  float rest = fract(time);
  if (whole > uint(end_time) || (whole == uint(end_time) && int(rest * 8.0) > end_rest)) {
    uint seventh = uint(rest * 7.0) + 1u;  // in bits beside the coordinates
    place |= (seventh & 3u) << 14 | (seventh & 4u) << 28;
  }
  uint i = atomicAdd(event_count, 1u);
  if (i < capacity) events[i] = uvec2(whole, place);
  if (threshold_jitter > 0.0) {
    vec2 jitter = threshold_jitter * normals(next_hash());
    float fixed_positive = fixed_threshold(positive_mean, 1u);
    float fixed_negative = fixed_threshold(negative_mean, 2u);
    positive = max(fixed_positive + jitter.x, max(fixed_positive / 10.0, 1e-3));
    negative = max(fixed_negative + jitter.y, max(fixed_negative / 10.0, 1e-3));
  }
}

// First crossing of the level at `threshold` from the reference, negative for OFF, which grew by
// `growth` at `from` and falls until `to`. A falling level is equivalent to a rising signal.
int fading_crossing(Trajectory c, vec2 from, vec2 to, float threshold, float growth,
                    out vec2 point) {
  float level = reference + threshold * (1.0 + growth);
  float fall = threshold * growth_rate;
  c.start -= fall * from.x;
  c.rise += fall;
  to.y += fall * (to.x - from.x);
  int polarity = threshold > 0.0 ? first_crossing(c, from, to, -never, level, point)
                                 : first_crossing(c, from, to, level, never, point);
  point.y -= fall * (point.x - from.x);
  return polarity;
}

int next_crossing(Trajectory c, vec2 from, vec2 end, out vec2 point) {
  if (growth_end > from.x && positive < never) {
    float growth = growth_rate * (growth_end - from.x);
    vec2 faded = growth_end < end.x ? vec2(growth_end, value_at(c, growth_end)) : end;
    vec2 off_point;
    int on = fading_crossing(c, from, faded, positive, growth, point);
    int off = fading_crossing(c, from, faded, -negative, growth, off_point);
    if (on != 0 && (off == 0 || point.x <= off_point.x)) return on;
    point = off_point;
    if (off != 0 || faded.x == end.x) return off;
    from = faded;
  }
  return first_crossing(c, from, end, reference - negative, reference + positive, point);
}

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= width) return;
  pixel = y * width + x;
  float target = loaded(target_plane, pixel);
  float signal = loaded(signal_plane, pixel);
  float base = loaded(reference_plane, pixel);
  positive = loaded(positive_plane, pixel);
  negative = loaded(negative_plane, pixel);
  ready = loaded(refractory_plane, pixel);
  growth_end = loaded(growth_plane, pixel);
  float leak = loaded(leak_plane, pixel);
  uint budget = state[(before + noise_plane) * width * height + pixel];
  next_time = 0u;

  int tile = moves != 0 ? y / 8 * ((width + 31) / 32) + x / 32 : 0;
  int plan = int(tables[plans + tile]);
  int sub_intervals = int(tables[plan]);
  int steps = int(tables[plan + 1]);
  ivec2 motion = ivec2(0);
  if (steps > 1) {
    int flow = 2 * height * ((width + 3) / 4) + 2 * pixel;
    float factor = 65536.0 / float(steps);
    motion = ivec2(motion_per_step(scene[flow], factor), motion_per_step(scene[flow + 1], factor));
  }
  for (int i = 0; i < sub_intervals; ++i) {
    int at = plan + 2 + 10 * i;
    begin = uvec2(tables[at], tables[at + 1]);
    float duration = table(at + 2);
    int step = int(tables[at + 3]);
    float share = table(at + 4);
    float pulse = table(at + 5);
    draw = uvec2(tables[at + 6], tables[at + 7]);
    float next_rounding = table(at + 8);
    int shade_table = int(tables[at + 9]);

    int luma = luma_at(ivec2(x, y), motion, step, steps);
    float last_target = target;
    target = table(luma);
    if (luma >= saturated) target = max(target, last_target);
    if (share < 1.0) target = last_target + (target - last_target) * share;
    float leaked = leak * duration + pulse;
    if (has_bandwidth == 0 && step < steps) luma = luma_at(ivec2(x, y), motion, steps, steps);
    int shade = shade_table + (luma >> (luma_bits - 8));
    Trajectory c;
    vec2 end = vec2(duration, 0.0);
    if (has_bandwidth != 0) {
      float lag = signal - last_target;
      c = Trajectory(signal - base, leaked / duration, (target - last_target) / duration, lag,
                     table(shade));
      signal = target - (target - last_target) * table(shade + 512) + lag * table(shade + 256);
      end.y = signal - base + leaked;
    } else {
      end.y = target - base + leaked;
      float start = last_target - base;
      c = Trajectory(start, (end.y - start) / duration, 0.0, 0.0, 0.0);
      signal = target;
    }
    uint expected = has_noise != 0 ? tables[shade + 768] : 0u;
    uint passed = 0u;
    reference = 0.0;
    vec2 now = vec2(0.0, c.start);
    int happened = 0;
    for (; happened < max_events; ++happened) {
      if (holds != 0 && ready > now.x) {
        if (ready > end.x) break;
        now = vec2(ready, value_at(c, ready));
        reference = now.y;
      }
      float noise = never;
      if (expected > 0u && budget <= expected - passed)
        noise = duration * (float(passed + budget) / float(expected));
      vec2 point;
      int polarity = next_crossing(c, now, end, point);
      if (noise <= (polarity != 0 ? point.x : end.x)) {
        if (noise > now.x) now = vec2(noise, value_at(c, noise));
        passed += budget;
        budget = noise_budget(next_hash());
        if (noise < ready) continue;
        reference = now.y;
        fire(noise, (next_hash().y >> 31) != 0u ? 1 : -1);
      } else if (polarity != 0) {
        now = point;
        float growth = growth_rate * max(0.0, growth_end - now.x);
        reference += (polarity > 0 ? positive : -negative) * (1.0 + growth);
        if (now.x >= ready) fire(now.x, polarity);
      } else {
        break;
      }
    }
    if (happened == max_events) reference = end.y;
    if (expected > 0u) {
      if (budget <= expected - passed) {
        budget = noise_budget(next_hash());
        passed = expected;
      }
      budget = max(1u, budget - (expected - passed));
    }
    base += reference - leaked;
    growth_end = max(0.0, growth_end - duration);
    ready = max(0.0, ready - duration);
    if (ready > 0.0 && ready < min_gap) ready += next_rounding;
  }

  store(target_plane, pixel, target);
  store(signal_plane, pixel, signal);
  store(reference_plane, pixel, base);
  store(positive_plane, pixel, positive);
  store(negative_plane, pixel, negative);
  store(leak_plane, pixel, leak);
  store(refractory_plane, pixel, ready);
  store(noise_plane, pixel, budget);
  store(growth_plane, pixel, growth_end);
}
