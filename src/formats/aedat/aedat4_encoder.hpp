// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat4_table.hpp"
#include "src/formats/encoder.hpp"

namespace flatbuffers {
class FlatBufferBuilder;
}

namespace eventcamera {

class Aedat4Compressor;

/// What an AEDAT4 file is to be.
struct Aedat4Settings {
  SensorSize size;
  std::string source;  ///< the camera's name
  Aedat4Compression compression = Aedat4Compression::lz4;
  bool frames = false;  ///< beside the stream of events there is one of frames
  bool table = false;   ///< the file ends with a table of its packets; see Aedat4Encoder::patch()
};

/// Writes AEDAT4: stream 0 has events, stream 1 frames. Nothing has to be written a second time;
/// only where a table is wanted, whoever can seek in the file puts its position into the header.
class Aedat4Encoder final : public Encoder {
 public:
  static constexpr int event_stream = 0;
  static constexpr int frame_stream = 1;

  /// Throws std::invalid_argument where the size is none that AEDAT4 can have.
  explicit Aedat4Encoder(Aedat4Settings settings);
  ~Aedat4Encoder() override;

  using Encoder::encode;

  /// Appends the events that are held back, and then the frame. Throws std::invalid_argument for
  /// one that AEDAT4 cannot hold.
  void encode(const Frame& frame, std::vector<std::uint8_t>& out);

  /// Appends the header, and the events that are held back.
  void flush(std::vector<std::uint8_t>& out);

  /// The table's position: until it is written, the header says that there is no table.
  std::optional<FilePatch> patch() const override { return patch_; }

 private:
  /// Events are held back until there are enough of them for a packet.
  void append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override;
  void append_end(std::vector<std::uint8_t>& out) override;
  void write_header(std::vector<std::uint8_t>& out);
  void write_events(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out);
  void write_packet(int stream, std::int64_t elements, Microseconds start, Microseconds end,
                    std::vector<std::uint8_t>& out);

  Aedat4Settings settings_;
  std::unique_ptr<Aedat4Compressor> compressor_;
  std::unique_ptr<flatbuffers::FlatBufferBuilder> builder_;
  std::vector<AbsoluteEvent> held_;
  std::uint64_t position_ = 0;        ///< in the file, of what comes next
  std::uint64_t table_field_at_ = 0;  ///< in the file, of the table's position
  std::vector<Aedat4TableEntry> table_;
  std::optional<FilePatch> patch_;
};

}  // namespace eventcamera
