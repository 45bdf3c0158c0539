// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/image.hpp"
#include "src/core/label.hpp"
#include "src/core/thread_pool.hpp"
#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/exposure_gain.hpp"
#include "src/dvs/frame_pair.hpp"
#include "src/dvs/interval_events.hpp"
#include "src/dvs/light_response.hpp"
#include "src/dvs/moving_light.hpp"
#include "src/dvs/pixel_array.hpp"
#include "src/dvs/pixel_solver.hpp"
#include "src/dvs/sub_intervals.hpp"
#include "src/gl/event_sort.hpp"
#include "src/gl/shaders.hpp"
#include "src/gl/simulator.hpp"
#include "src/simulate/denoiser.hpp"

namespace eventcamera::gl {
namespace {

/// Number of values of a pixel, as in the shader.
constexpr int planes = 9;

/// Threshold of dead pixels.
constexpr float never_crossed = 1e30F;

/// 32-bit numbers for a shader.
class Words {
 public:
  template <class Number>
  void add(Number number) {
    static_assert(sizeof(Number) == 4);
    words_.push_back(std::bit_cast<std::uint32_t>(number));
  }
  void add_float(double number) { add(static_cast<float>(number)); }
  template <class Number>
  void add_all(std::span<const Number> numbers) {
    for (const Number& number : numbers) add(number);
  }
  void add_64(std::uint64_t number) {
    add(static_cast<std::uint32_t>(number));
    add(static_cast<std::uint32_t>(number >> 32));
  }
  std::size_t size() const { return words_.size(); }
  std::uint32_t& operator[](std::size_t i) { return words_[i]; }
  std::span<const std::byte> bytes() const { return std::as_bytes(std::span(words_)); }

 private:
  std::vector<std::uint32_t> words_;
};

class PixelSimulator final : public DvsSimulator {
 public:
  PixelSimulator(const Context& gl, const LumaFormat& format)
      : DvsSimulator(gl, format),
        kernel_(gl, "dvs", shaders::dvs),
        grey_{{gl, format}, {gl, format}},
        state_(gl),
        scene_(gl),
        tables_(gl),
        sort_(gl, format),
        unread_{Unread(gl), Unread(gl)},
        frames_(format),
        denoiser_(format),
        pixels_(format.width, format.height),
        fired_(format.width, format.height) {
    state_.reserve(pixel_count(format) * planes * 2 * 4);
  }

 private:
  /// An interval whose events have not been read.
  struct Unread {
    explicit Unread(const Context& gl) : events(gl, GL_DYNAMIC_READ) {}

    Buffer events;        ///< sorted
    double duration = 0;  ///< microseconds
    double max_rate = 0;
    Nanoseconds rolling_shutter = 0;
    std::optional<Image<Flow>> flow;
  };

  /// First words of a list of events: their number, and the number that fits.
  using ListHeader = std::array<std::uint32_t, 2>;

  bool needs_flow() const override { return settings_.upsampling == Upsampling::motion; }

  /// True if the CPU must prepare the frames.
  bool needs_luma() const {
    return settings_.denoise != 0 || settings_.exposure_compensation || needs_flow();
  }

  void start(const TextureFrame& frame) override {
    count_ = 0;
    is_complete_ = true;
    response_.set_range(frame.black != 0);
    luma_.run(frame, grey_[now_]);
    denoiser_.restart();
    const LumaView luma = read_luma(frame.black != 0);
    const double amplitude = denoiser_.amplitude_for(luma, settings_.denoise);
    start(denoiser_.denoised(luma, amplitude, threads()).as<std::uint8_t>());
  }

  void start(const ImageView<std::uint8_t>& frame) {
    frames_.start(frame);
    has_last_ = true;
    timeline_.restart();
    fired_.restart();
    response_.restart();
    response_.set(settings_);
    pixels_.start(settings_, threads());
    settle();
  }

  void mark(const TextureFrame& frame, const StepTimes& interval, const Settings& settings,
            EventList& list) override {
    list.clear();
    complete();
    flow_ = std::exchange(known_flow_, std::nullopt);
    response_.set_range(frame.black != 0);
    if (needs_luma()) ensure_last();
    now_ = 1 - now_;
    luma_.run(frame, grey_[now_]);
    if (needs_luma()) {
      const LumaView luma = read_luma(frame.black != 0);
      const double amplitude = denoiser_.amplitude_for(luma, settings_.denoise);
      if (const auto first = denoiser_.kept_first(amplitude, threads()))
        start(first->as<std::uint8_t>());
      frames_.now.assign(denoiser_.denoised(luma, amplitude, threads()).as<std::uint8_t>());
    }
    change_settings();
    if (needs_luma())
      frames_.prepare(settings_, response_, interval.duration(), flow_, threads(),
                      [&] { settle(); });
    begin(interval, true, settings);
    if (needs_flow()) {
      tiles_.measure(*flow_, settings_.max_interpolated_frames + 1, threads());
      unread_[last_].flow.emplace(format().width, format().height).assign(*flow_);
    }
    advance(needs_flow());
    has_last_ = needs_luma();
    if (has_last_) frames_.advance();
  }

  void mark_events(const StepTimes& interval, const Settings& settings, EventList& list) override {
    list.assign(events(interval.duration(), settings));
  }

  bool hold(const StepTimes& interval, const Settings& settings, StepBuckets&) override {
    complete();
    change_settings();
    if (has_last_) frames_.hold();
    begin(interval, false, settings);
    advance(false);
    return true;
  }

  const EventBuckets& events(Nanoseconds, const Settings&) override {
    if (count_ == 1) complete();
    const Unread& unread = unread_[(last_ + 3 - count_) % 2];
    --count_;
    ListHeader header;
    unread.events.read(std::as_writable_bytes(std::span(header)));
    events_.reset(1, 1);
    auto& list = events_.bucket(1, 0);
    list.resize(header[0]);
    unread.events.read(std::as_writable_bytes(std::span(list)), sizeof header);
    flow_.reset();
    if (unread.flow) {
      read_flow_ = *unread.flow;
      flow_ = read_flow_.view();
    }
    fired_.begin(unread.duration, unread.max_rate, unread.rolling_shutter);
    const bool has_late = !list.empty() && list.back() != without_cause(list.back());
    return fired_.is_plain() && !has_late ? events_ : collect(list);
  }

  /// Ends the interval with these events, and deferred ones that are due. Events past its end carry
  /// the fraction of their microsecond, as written by the shader.
  const EventBuckets& collect(std::span<const Event> events) {
    std::vector<IntervalEvents::Band> bands(static_cast<std::size_t>(band_count(format().height)));
    for (std::size_t i = 0; i < bands.size(); ++i) bands[i].begin(fired_, static_cast<int>(i));
    for (const Event& event : events) {
      const auto seventh = static_cast<int>(cause_of(event));
      bands[(event.y() & coordinate_bits) / rows_per_band].add(
          event.t + (seventh > 0 ? (seventh - 0.5) / 7 : 0), without_cause(event));
    }
    for (auto& band : bands) band.end();
    return fired_.end(events_, threads());
  }

  std::optional<Nanoseconds> latest() const override { return fired_.latest(); }

  const EventBuckets& late(Nanoseconds duration) override {
    fired_.begin(in_microseconds(duration), settings_.max_rate, 0);
    return collect({});
  }

  /// The luma of the current frame, valid until the next call.
  LumaView read_luma(bool is_narrow) {
    const int stride = 4 * GreyFrame::words_across(format().width);
    luma_bytes_.resize(static_cast<std::size_t>(stride) *
                       static_cast<std::size_t>(format().height));
    grey_[now_].buffer().read(std::as_writable_bytes(std::span(luma_bytes_)));
    return {format(), luma_bytes_.data(), stride, is_narrow};
  }

  /// Reads the last frame, if earlier settings did not need it.
  void ensure_last() {
    if (std::exchange(has_last_, true)) return;
    frames_.last.assign(read_luma(false).as<std::uint8_t>());
    frames_.hold();
  }

  void settle() {
    pixels_.settle(frames_.last, response_, threads());
    write_state();
  }

  /// Applies new settings mid-stream, like the simulator on the CPU.
  void change_settings() {
    if (settings_ == pixels_.model().settings) return;
    const bool keeps_units = response_.has_units_of(settings_);
    response_.set(settings_);
    read_state();
    pixels_.change(settings_, threads());
    write_state();
    if (keeps_units) return;
    timeline_.end_pulse();
    settle();
  }

  /// Calls visit(words, row of a plane) for each row of each plane of the state.
  template <class Visit>
  void visit_state(const Visit& visit) {
    const auto width = static_cast<std::size_t>(format().width);
    const auto count = pixel_count(format());
    for (int y = 0; y < format().height; ++y) {
      const PixelRow row = pixels_.row(y);
      std::uint32_t* words = state_words_.data() + static_cast<std::size_t>(y) * width;
      const auto next = [&](auto* values) {
        visit(std::span(words, width), values);
        words += count;
      };
      next(row.target);
      next(row.signal);
      next(row.reference);
      next(row.positive);
      next(row.negative);
      next(row.leak);
      next(row.refractory_left);
      next(row.noise_budget);
      next(row.growth_end);
    }
  }

  void write_state() {
    state_words_.resize(planes * pixel_count(format()));
    visit_state([]<class Value>(std::span<std::uint32_t> words, const Value* values) {
      for (auto& word : words) {
        const Value value = *values++;
        if constexpr (sizeof(Value) == 4)
          word = std::bit_cast<std::uint32_t>(value);
        else
          word = std::bit_cast<std::uint32_t>(static_cast<float>(value));
        if constexpr (std::is_same_v<Value, float>)
          if (std::isinf(value)) word = std::bit_cast<std::uint32_t>(never_crossed);
      }
    });
    state_.assign(std::as_bytes(std::span(state_words_)));
    is_second_ = false;
  }

  void read_state() {
    const auto size = planes * pixel_count(format());
    state_words_.resize(is_second_ ? 2 * size : size);
    state_.read(std::as_writable_bytes(std::span(state_words_)));
    state_words_.erase(state_words_.begin(),
                       state_words_.end() - static_cast<std::ptrdiff_t>(size));
    visit_state([]<class Value>(std::span<const std::uint32_t> words, Value* values) {
      for (const auto word : words) {
        if constexpr (std::is_same_v<Value, std::uint32_t>)
          *values++ = word;
        else
          *values++ = std::bit_cast<float>(word);
      }
    });
  }

  /// Begins an interval, and its list of events.
  void begin(const StepTimes& interval, bool is_exposed, const Settings& settings) {
    timeline_.begin(settings_, response_.gain(), *last_time_, interval.duration(), is_exposed);
    last_ = 1 - last_;
    ++count_;
    Unread& unread = unread_[last_];
    unread.duration = timeline_.duration();
    unread.max_rate = settings_.max_rate;
    unread.rolling_shutter = settings.rolling_shutter;
    unread.flow.reset();
  }

  /// Queues the simulation of all pixels.
  void advance(bool moves) {
    moves_ = moves;
    write_tables(moves);
    if (needs_luma() && has_last_) write_scene(moves);
    constexpr std::size_t first_capacity = 4096;
    unread_[last_].events.reserve(first_capacity * sizeof(Event));
    run();
    timeline_.end();
    is_second_ = !is_second_;
    is_complete_ = false;
  }

  void run() {
    const double duration = unread_[last_].duration;
    const auto whole = static_cast<std::uint32_t>(duration);
    const Buffer& sorted = unread_[last_].events;
    Buffer& events = sort_.unsorted(sorted);
    const ListHeader header = {0, static_cast<std::uint32_t>(sorted.size() / sizeof(Event) - 1)};
    events.assign(std::as_bytes(std::span(header)));
    const PixelModel& model = pixels_.model();
    const int before = is_second_ ? planes : 0;
    const bool is_prepared = needs_luma() && has_last_;
    kernel_.run(
        {groups_of(64, format().width), format().height},
        {&state_, is_prepared ? &scene_ : &grey_[now_].buffer(), &tables_, &events},
        {format().width, format().height, before, planes - before, model.has_bandwidth(),
         model.has_noise(), model.holds_reference(), response_.bits(),
         response_.gain() != 1 ? saturated_luma(response_.white()) : response_.white() + 1, plans_,
         moves_, max_events, static_cast<int>(whole), static_cast<int>(8 * (duration - whole))});
    sort_.run(sorted, whole);
  }

  /// Simulates the last interval again if its events did not fit into their buffer.
  void complete() {
    if (std::exchange(is_complete_, true)) return;
    Buffer& events = unread_[last_].events;
    ListHeader header;
    events.read(std::as_writable_bytes(std::span(header)));
    if (header[0] <= header[1]) return;
    events.reserve(std::bit_ceil(std::size_t{header[0]} + 1) * sizeof(Event));
    is_second_ = !is_second_;
    run();
    is_second_ = !is_second_;
  }

  /// Writes the tables of an interval, and the responses if they changed.
  void write_tables(bool moves) {
    const PixelModel& model = pixels_.model();
    Words header;
    header.add_64(model.random.key());
    header.add_float(model.mean_thresholds.positive);
    header.add_float(model.mean_thresholds.negative);
    header.add_float(model.settings.threshold_sigma);
    header.add_float(model.settings.threshold_jitter);
    header.add_float(model.gap);
    header.add_float(model.latency);
    header.add_float(model.latency_jitter);
    header.add_float(model.adaptation.rate());
    header.add_float(model.adaptation.duration());

    Words words;
    const auto& responses = response_.table();
    const auto here = [&] { return static_cast<std::uint32_t>(responses.size() + words.size()); };
    const int columns = moves ? tiles_.columns() : 1;
    const int rows = moves ? tiles_.rows() : 1;
    plans_ = static_cast<int>(here());
    for (int tile = 0; tile < columns * rows; ++tile) words.add(std::uint32_t{0});
    std::map<int, std::uint32_t> plans;
    std::map<const ShadeTables*, std::uint32_t> shade_tables;
    for (int tile = 0; tile < columns * rows; ++tile) {
      const int steps = moves ? tiles_.steps(tile % columns, tile / columns) : 1;
      auto& plan = plans[steps];
      if (plan == 0) {
        timeline_.make_plan(steps);
        for (const auto& sub_interval : timeline_.plan(steps)) {
          auto& place = shade_tables[sub_interval.tables];
          if (place != 0) continue;
          place = here();
          if (model.has_bandwidth() || model.has_noise()) add_shades(*sub_interval.tables, words);
        }
        plan = here();
        add_plan(timeline_.plan(steps), steps, shade_tables, words);
      }
      words[tile] = plan;
    }

    const auto response_bytes = std::as_bytes(std::span(responses));
    const std::size_t first_plan = header.bytes().size() + response_bytes.size();
    const std::size_t size = first_plan + words.bytes().size();
    if (size > tables_.size()) {
      tables_.reserve(std::bit_ceil(size));
      responses_.clear();
    }
    tables_.assign(header.bytes());
    tables_.assign(words.bytes(), first_plan);
    if (responses == responses_) return;
    tables_.assign(response_bytes, header.bytes().size());
    responses_ = responses;
  }

  static void add_shades(const ShadeTables& tables, Words& words) {
    for (const double bandwidth : tables.bandwidth) words.add_float(bandwidth);
    words.add_all(std::span<const float>(tables.decay_factor));
    words.add_all(std::span<const float>(tables.mean_decay_factor));
    words.add_all(std::span<const std::uint32_t>(tables.noise));
  }

  static void add_plan(const Timeline::Plan& plan, int steps,
                       const std::map<const ShadeTables*, std::uint32_t>& shade_tables,
                       Words& words) {
    words.add(static_cast<std::uint32_t>(plan.size()));
    words.add(steps);
    for (const auto& sub_interval : plan) {
      const auto microseconds = static_cast<std::uint32_t>(sub_interval.begin);
      words.add(microseconds);
      words.add_float(sub_interval.begin - microseconds);
      words.add_float(sub_interval.duration);
      words.add(sub_interval.step);
      words.add_float(sub_interval.share);
      words.add_float(sub_interval.rise);
      words.add_64(sub_interval.number * draws_per_sub_interval);
      words.add_float(sub_interval.next_rounding);
      words.add(shade_tables.at(sub_interval.tables));
    }
  }

  /// Writes the frames that the CPU prepared and, if the pixels move, the flow.
  void write_scene(bool moves) {
    const auto stride = 4 * static_cast<std::size_t>(GreyFrame::words_across(format().width));
    const auto height = static_cast<std::size_t>(format().height);
    scene_bytes_.resize(stride * height * (moves ? 2 : 1) +
                        (moves ? pixel_count(format()) * sizeof(Flow) : 0));
    std::byte* out = scene_bytes_.data();
    const auto width = static_cast<std::size_t>(format().width);
    const auto add_frame = [&](const Image<std::uint8_t>& frame) {
      for (int y = 0; y < format().height; ++y, out += stride)
        std::memcpy(out, frame.row(y), width);
    };
    add_frame(frames_.now);
    if (moves) {
      add_frame(frames_.last);
      for (int y = 0; y < format().height; ++y, out += width * sizeof(Flow))
        std::memcpy(out, flow_->row(y), width * sizeof(Flow));
    }
    scene_.assign(scene_bytes_);
  }

  Kernel kernel_;
  GreyFrame grey_[2];       ///< the last two frames
  int now_ = 0;             ///< index of the later one
  Buffer state_;            ///< of the pixels, twice: before the last interval, and after it
  bool is_second_ = false;  ///< the second one is the current state
  Buffer scene_;            ///< frames that the CPU prepared, and the flow
  Buffer tables_;
  std::vector<float> responses_;  ///< in tables_
  int plans_ = 0;                 ///< place in tables_
  bool moves_ = false;            ///< the last interval follows the flow
  EventSort sort_;
  Unread unread_[max_queued];
  int last_ = 0;             ///< index of the last interval
  int count_ = 0;            ///< number of unread intervals
  bool is_complete_ = true;  ///< the last interval's events are known to fit into their buffer
  Image<Flow> read_flow_;

  FramePair<std::uint8_t> frames_;
  bool has_last_ = false;  ///< frames_ has the last frame
  Denoiser denoiser_;
  LightResponse response_{8};
  PixelArray pixels_;  ///< state at the start, or when settings change
  Timeline timeline_;
  MotionTiles tiles_;
  IntervalEvents fired_;
  std::vector<std::uint8_t> luma_bytes_;
  std::vector<std::byte> scene_bytes_;
  std::vector<std::uint32_t> state_words_;
};

}  // namespace

std::unique_ptr<DvsSimulator> make_dvs_simulator(const Context& gl, const LumaFormat& format) {
  return std::make_unique<PixelSimulator>(gl, format);
}

}  // namespace eventcamera::gl
