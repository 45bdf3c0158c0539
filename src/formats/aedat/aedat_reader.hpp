// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "src/formats/aedat/aedat4_decoder.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Reads AEDAT 4, 3.1 and 2.0, as the file's first line says. The older ones are read as one stream
/// of events, and triggers.
///
///     reader.push(piece);
///     while (const auto item = reader.next()) ...
class AedatReader {
 public:
  /// Adds bytes, which stay borrowed until next() returns nothing; only then more may be pushed.
  void push(std::span<const std::uint8_t> piece);

  /// Says that no more bytes come.
  void finish() { finished_ = true; }

  /// What comes next, valid until the next call; nothing where that takes more bytes. Throws
  /// UnsupportedFormat.
  std::optional<Aedat4Item> next();

  /// What is pushed next lies at `position`, where a packet of AEDAT 4 should begin. Its header has
  /// to have been read.
  void resume(std::uint64_t position);

  /// What is pushed next is the file's beginning.
  void restart();

  /// 4, 3 or 2; 0 before it is known.
  int version() const { return version_; }

  /// Those that are known so far.
  const std::vector<Aedat4Stream>& streams() const;
  const Corruption& corruption() const;

  /// What reads AEDAT 4; nothing where the file is none, or not known to be one.
  const Aedat4Decoder* aedat4() const { return aedat4_.get(); }

 private:
  bool find_version();
  std::optional<Aedat4Item> next_of_older();

  bool finished_ = false;
  bool ended_ = false;  ///< an older version's decoder was told that it is finished
  int version_ = 0;
  std::vector<std::uint8_t> start_;  ///< of the file, while that is too short to tell its version
  std::span<const std::uint8_t> rest_;

  std::unique_ptr<Aedat4Decoder> aedat4_;
  std::unique_ptr<Decoder> older_;
  std::vector<Aedat4Stream> older_streams_;
  Decoded decoded_;
  bool events_due_ = false;  ///< those in decoded_ are to be handed out
  bool triggers_due_ = false;
};

}  // namespace eventcamera
