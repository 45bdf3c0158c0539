// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/aedat/aedat_decoder.hpp"

#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "src/formats/aedat/aedat4.hpp"

namespace eventcamera {
namespace {

class AedatDecoder final : public Decoder {
 public:
  explicit AedatDecoder(SensorSize assumed) : assumed_(assumed) {}

  void push(std::span<const std::uint8_t> piece) override {
    if (!version_.empty())
      reader_->push(piece);
    else
      start_.insert(start_.end(), piece.begin(), piece.end());
  }

  void drain() override {
    finished_ = true;
    reader_->drain();
  }

  bool open(ByteSource& source) override {
    source_ = &source;
    return reader_->open(source);
  }

  std::optional<Item> next() override {
    return !version_.empty() || find_version() ? reader_->next() : std::nullopt;
  }

  const std::vector<StreamInfo>& streams() const override { return reader_->streams(); }
  const Corruption& corruption() const override { return reader_->corruption(); }
  std::optional<SeekPoint> seek_point_before(Microseconds t) const override {
    return reader_->seek_point_before(t);
  }
  void restart(const SeekPoint& seek_point) override { reader_->restart(seek_point); }
  std::optional<Microseconds> last_time() override { return reader_->last_time(); }
  std::optional<std::uint64_t> end_of(std::size_t stream, Microseconds t) const override {
    return reader_->end_of(stream, t);
  }
  std::uint64_t position() const override { return reader_->position(); }
  std::string format_name() const override { return "AEDAT " + version_; }

 private:
  /// Creates the decoder of the version in the first line. False if more bytes are needed.
  bool find_version() {
    constexpr std::string_view any_version = "#!AER-DAT";
    constexpr std::size_t magic_size = any_version.size() + 3;
    const std::string_view text(reinterpret_cast<const char*>(start_.data()),
                                std::min(start_.size(), magic_size));
    const auto known = std::min(text.size(), any_version.size());
    if (text.substr(0, known) != any_version.substr(0, known) ||
        (finished_ && text.size() < magic_size))
      throw UnsupportedFormat("this is not AEDAT: it does not begin with #!AER-DAT and a version");
    if (text.size() < magic_size) return false;
    const auto version = text.substr(any_version.size());
    if (version == "3.1")
      reader_ = make_aedat3_decoder();
    else if (version == "2.0")
      reader_ = make_aedat2_decoder(assumed_);
    else if (version == "1.0")
      reader_ = make_aedat2_decoder(assumed_, Aedat2Version::one);
    else if (version != "4.0")
      throw UnsupportedFormat("this is AEDAT " + std::string(version) +
                              "; only versions 4.0, 3.1, 2.0 and 1.0 are supported");
    version_ = version;
    if (source_ != nullptr) reader_->open(*source_);
    reader_->push(start_);
    if (finished_) reader_->drain();
    return true;
  }

  const SensorSize assumed_;
  std::vector<std::uint8_t> start_;  ///< start of the file, collected until its version is known
  bool finished_ = false;
  ByteSource* source_ = nullptr;
  std::string version_;  ///< empty until known
  std::unique_ptr<Decoder> reader_ = make_aedat4_decoder();
};

}  // namespace

std::unique_ptr<Decoder> make_aedat_decoder(SensorSize assumed) {
  return std::make_unique<AedatDecoder>(assumed);
}

}  // namespace eventcamera
