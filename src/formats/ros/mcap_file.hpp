// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "src/formats/byte_cursor.hpp"
#include "src/formats/compression/compressed_frames.hpp"
#include "src/formats/ros/chunked_bag_file.hpp"

namespace eventcamera {

/// Reads MCAP files, with and without chunks, summary and index.
class McapFile final : public ChunkedBagFile {
 public:
  explicit McapFile(AddTopic add_topic);

 private:
  void read_index(ByteSource& source) override;
  std::optional<Head> head_of(Bytes bytes) const override;
  bool begins_record(Bytes bytes) const override;
  std::optional<BagMessage> read_record(Bytes record, std::uint64_t position) override;
  std::optional<Bytes> records_of(Bytes chunk, std::uint64_t position, bool is_cut) override;

  void add_schema(ByteCursor content, std::uint64_t position);
  void add_channel(ByteCursor content, std::uint64_t position);
  std::optional<BagMessage> message_of(ByteCursor content, std::uint64_t position);

  std::map<std::uint16_t, std::string> schemas_;                  ///< names of the types
  std::map<std::uint16_t, std::optional<std::size_t>> channels_;  ///< topics by channel
  FrameDecompressor decompressor_;
};

}  // namespace eventcamera
