// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/aedat/aedat_reader.hpp"

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>

#include "src/formats/aedat/aedat2_decoder.hpp"
#include "src/formats/aedat/aedat3_decoder.hpp"

namespace eventcamera {

namespace {

constexpr std::string_view any_version = "#!AER-DAT";
constexpr std::size_t max_magic = any_version.size() + 3;
/// Decoded at once: few enough for the cache, however large the pieces are.
constexpr std::size_t decoded_bytes = std::size_t{1} << 16;

}  // namespace

void AedatReader::push(std::span<const std::uint8_t> piece) {
  if (aedat4_)
    aedat4_->push(piece);
  else if (older_)
    rest_ = piece;
  else
    start_.insert(start_.end(), piece.begin(), piece.end());
}

std::optional<Aedat4Item> AedatReader::next() {
  if (version_ == 0 && !find_version()) return std::nullopt;
  if (older_) return next_of_older();
  if (finished_) aedat4_->finish();
  return aedat4_->next();
}

/// Makes the decoder that the file's first line asks for. False where that takes more bytes.
bool AedatReader::find_version() {
  const std::string_view text(reinterpret_cast<const char*>(start_.data()),
                              std::min(start_.size(), max_magic));
  const auto known = std::min(text.size(), any_version.size());
  if (text.substr(0, known) != any_version.substr(0, known) ||
      (finished_ && text.size() < max_magic))
    throw UnsupportedFormat("this is not AEDAT: it does not begin with #!AER-DAT and a version");
  if (text.size() < max_magic) return false;
  const auto version = text.substr(any_version.size());
  if (version == "4.0") {
    version_ = 4;
    aedat4_ = std::make_unique<Aedat4Decoder>();
    aedat4_->push(start_);
  } else if (version == "3.1") {
    version_ = 3;
    older_ = std::make_unique<Aedat3Decoder>();
  } else if (version == "2.0") {
    version_ = 2;
    older_ = std::make_unique<Aedat2Decoder>();
  } else {
    throw UnsupportedFormat("this is AEDAT " + std::string(version) +
                            ", of which only 4.0, 3.1 and 2.0 can be read");
  }
  if (older_) {
    rest_ = start_;
    older_streams_.push_back({0, Aedat4Kind::events, {}, {}});
  }
  return true;
}

std::optional<Aedat4Item> AedatReader::next_of_older() {
  while (true) {
    if (std::exchange(events_due_, false) && !decoded_.events.empty())
      return Aedat4Events{0, decoded_.events};
    if (std::exchange(triggers_due_, false) && !decoded_.triggers.empty())
      return Aedat4Triggers{0, decoded_.triggers};
    decoded_.events.clear();
    decoded_.triggers.clear();
    if (!rest_.empty()) {
      const auto few = rest_.first(std::min(rest_.size(), decoded_bytes));
      rest_ = rest_.subspan(few.size());
      older_->decode(few, decoded_);
    } else if (finished_ && !std::exchange(ended_, true)) {
      older_->finish(decoded_);
    } else {
      return std::nullopt;
    }
    older_streams_.front().size = older_->size();
    events_due_ = triggers_due_ = true;
  }
}

void AedatReader::resume(std::uint64_t position) {
  finished_ = false;
  aedat4_->resume(position);
}

void AedatReader::restart() {
  *this = AedatReader();
}

const std::vector<Aedat4Stream>& AedatReader::streams() const {
  return aedat4_ ? aedat4_->streams() : older_streams_;
}

const Corruption& AedatReader::corruption() const {
  static const Corruption none;
  return aedat4_ ? aedat4_->corruption() : older_ ? older_->corruption() : none;
}

}  // namespace eventcamera
