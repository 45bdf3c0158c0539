// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string_view>
#include <vector>

#include "src/formats/compression/compressed_frames.hpp"
#include "src/formats/expansion_limit.hpp"
#include "src/formats/ros/chunked_bag_file.hpp"

namespace eventcamera {

/// Reads ROS 1 bags, version 2.0: wiki.ros.org/Bags/Format/2.0.
class RosbagFile final : public ChunkedBagFile {
 public:
  explicit RosbagFile(AddTopic add_topic);

 private:
  void read_index(ByteSource& source) override;
  std::optional<Head> head_of(Bytes bytes) const override;
  bool begins_record(Bytes bytes) const override;
  std::optional<BagMessage> read_record(Bytes record, std::uint64_t position) override;
  std::optional<Bytes> records_of(Bytes record, std::uint64_t position, bool is_cut) override;

  std::optional<Bytes> decompressed(std::string_view compression, Bytes content);
  std::optional<Bytes> decompressed_bz2(Bytes content);

  std::map<std::uint32_t, std::optional<std::size_t>> connections_;  ///< topics by connection
  FrameDecompressor decompressor_;
  std::vector<std::uint8_t> content_;  ///< of a chunk compressed with bzip2
  ExpansionLimit expansion_;           ///< of these chunks
};

}  // namespace eventcamera
