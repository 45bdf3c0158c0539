// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/aedat/aedat_decoder.hpp"

#include <algorithm>
#include <string_view>

#include "src/formats/aedat/aedat2_decoder.hpp"
#include "src/formats/aedat/aedat3_decoder.hpp"
#include "src/formats/aedat/aedat4_decoder.hpp"

namespace eventcamera {

namespace {

constexpr std::string_view any_version = "#!AER-DAT";
constexpr std::size_t magic_size = any_version.size() + 3;

}  // namespace

void AedatDecoder::push(std::span<const std::uint8_t> piece) {
  if (reader_)
    reader_->push(piece);
  else
    start_.insert(start_.end(), piece.begin(), piece.end());
}

void AedatDecoder::drain() {
  finished_ = true;
  if (reader_) reader_->drain();
}

bool AedatDecoder::open(ByteSource& source) {
  source_ = &source;
  return false;
}

std::optional<Item> AedatDecoder::next() {
  if (!reader_ && !find_version()) return std::nullopt;
  return reader_->next();
}

/// Creates the decoder of the version in the first line. False if more bytes are needed.
bool AedatDecoder::find_version() {
  const std::string_view text(reinterpret_cast<const char*>(start_.data()),
                              std::min(start_.size(), magic_size));
  const auto known = std::min(text.size(), any_version.size());
  if (text.substr(0, known) != any_version.substr(0, known) ||
      (finished_ && text.size() < magic_size))
    throw UnsupportedFormat("this is not AEDAT: it does not begin with #!AER-DAT and a version");
  if (text.size() < magic_size) return false;
  const auto version = text.substr(any_version.size());
  if (version == "4.0")
    reader_ = std::make_unique<Aedat4Decoder>();
  else if (version == "3.1")
    reader_ = std::make_unique<Aedat3Decoder>();
  else if (version == "2.0")
    reader_ = std::make_unique<Aedat2Decoder>(assumed_);
  else if (version == "1.0")
    reader_ = std::make_unique<Aedat2Decoder>(assumed_, Aedat2Version::one);
  else
    throw UnsupportedFormat("this is AEDAT " + std::string(version) +
                            "; only versions 4.0, 3.1, 2.0 and 1.0 are supported");
  version_ = version;
  if (source_ != nullptr) reader_->open(*source_);
  reader_->push(start_);
  if (finished_) reader_->drain();
  return true;
}

const std::vector<StreamInfo>& AedatDecoder::streams() const {
  static const std::vector<StreamInfo> none;
  return reader_ ? reader_->streams() : none;
}

const Corruption& AedatDecoder::corruption() const {
  static const Corruption none;
  return reader_ ? reader_->corruption() : none;
}

std::optional<SeekPoint> AedatDecoder::seek_point_before(Microseconds t) const {
  return reader_ ? reader_->seek_point_before(t) : std::nullopt;
}

void AedatDecoder::restart(const SeekPoint& seek_point) {
  reader_->restart(seek_point);
}

std::optional<Microseconds> AedatDecoder::last_time() {
  return reader_ ? reader_->last_time() : std::nullopt;
}

std::optional<std::uint64_t> AedatDecoder::end_of(std::size_t stream, Microseconds t) const {
  return reader_ ? reader_->end_of(stream, t) : std::nullopt;
}

std::uint64_t AedatDecoder::position() const {
  return reader_ ? reader_->position() : 0;
}

std::string AedatDecoder::format_name() const {
  return "AEDAT " + version_;
}

const Aedat4Decoder* AedatDecoder::aedat4() const {
  return dynamic_cast<const Aedat4Decoder*>(reader_.get());
}

}  // namespace eventcamera
