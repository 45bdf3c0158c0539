// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <vector>

#include "src/formats/seek_points.hpp"

namespace eventcamera {

/// Where the chunks of a bag are and when their messages were recorded: as the index of the file
/// says, else of the part that was read.
class ChunkIndex {
 public:
  struct Chunk {
    std::uint64_t position;  ///< in the file, bytes
    Microseconds last;       ///< time of its latest message
  };

  /// Takes the index of a file, in any order. `start` is the position of the first record.
  void set(std::vector<Chunk> chunks, std::uint64_t start) {
    std::ranges::sort(chunks, {}, &Chunk::position);
    auto latest = before_all;
    for (const auto& chunk : chunks) {
      // Chunks may overlap in time.
      indexed_.push_back({latest, chunk.position < start ? start : chunk.position});
      latest = std::max(latest, chunk.last);
    }
    if (!indexed_.empty()) {
      indexed_.front().position = start;
      last_ = latest;
    }
  }

  /// Takes a chunk with messages of a topic from the index of a file.
  void set_topic(std::size_t topic, std::uint64_t position) {
    auto& first = first_.try_emplace(topic, SeekPoint{before_all, position}).first->second;
    first.position = std::min(first.position, position);
  }

  /// Records that a chunk or a message was reached, if no index was set.
  void reached(std::uint64_t position) {
    if (indexed_.empty() && read_.due(position)) read_.note({latest_, position});
  }

  /// Records that a message was read.
  void read(Microseconds logged) { latest_ = std::max(latest_, logged); }

  /// Where to begin for all messages from `logged` on.
  std::optional<SeekPoint> before(Microseconds logged) const {
    if (indexed_.empty()) return read_.before(logged);
    const auto later =
        std::partition_point(indexed_.begin() + 1, indexed_.end(),
                             [logged](const SeekPoint& chunk) { return chunk.t < logged; });
    return *(later - 1);
  }

  /// Where to begin for the first message of a topic, if the index says it.
  std::optional<SeekPoint> first_of(std::size_t topic) const {
    const auto first = first_.find(topic);
    return first == first_.end() ? std::nullopt : std::optional(first->second);
  }

  /// Continues at a seek point.
  void restart(const SeekPoint& seek_point) { latest_ = seek_point.t; }

  /// Time of the latest message of the file, if there is an index.
  std::optional<Microseconds> last() const { return last_; }

 private:
  static constexpr auto before_all = std::numeric_limits<Microseconds>::min();

  std::vector<SeekPoint> indexed_;          ///< the chunks of the index; t: the latest before them
  std::map<std::size_t, SeekPoint> first_;  ///< chunks of the index, by topic
  std::optional<Microseconds> last_;
  SeekPoints read_;  ///< if there is no index
  Microseconds latest_ = before_all;
};

}  // namespace eventcamera
