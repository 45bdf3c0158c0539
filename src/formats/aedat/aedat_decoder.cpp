// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/aedat/aedat_decoder.hpp"

#include <algorithm>
#include <string_view>

#include "src/formats/aedat/aedat2_decoder.hpp"
#include "src/formats/aedat/aedat3_decoder.hpp"
#include "src/formats/aedat/aedat4_decoder.hpp"

namespace eventcamera {

/// Creates the decoder of the version in the first line. False if more bytes are needed.
bool AedatDecoder::find_version() {
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

}  // namespace eventcamera
