// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/encoder.hpp"

namespace eventcamera {

class Aedat4Builder;

FrameCompressor make_aedat4_compressor(Aedat4Compression compression);

struct Aedat4Settings {
  SensorSize size;
  std::string source;  ///< name of the camera
  Aedat4Compression compression = Aedat4Compression::lz4;
  bool frames = false;       ///< with a stream of frames
  bool table = false;        ///< with a packet table at the end; see Aedat4Encoder::patch()
  bool triggers = false;     ///< with a stream of triggers
  bool imu_samples = false;  ///< with a stream of IMU samples
};

/// Encodes AEDAT4: stream 0 has events, 1 frames, 2 triggers, 3 IMU samples. Output is sequential,
/// except that the position of the packet table, if any, is patched into the header.
class Aedat4Encoder final : public Encoder {
 public:
  static constexpr int event_stream = 0;
  static constexpr int frame_stream = 1;
  static constexpr int trigger_stream = 2;
  static constexpr int imu_stream = 3;

  /// Throws std::invalid_argument if AEDAT4 does not support the size.
  explicit Aedat4Encoder(Aedat4Settings settings);
  ~Aedat4Encoder() override;

  using Encoder::encode;

  /// Appends all pending events, then the frame. Throws std::invalid_argument if AEDAT4 does not
  /// support the frame.
  void encode(const Frame& frame, std::vector<std::uint8_t>& out);

  /// Appends the supported ones, which must be sorted by time, and returns their number; 0 without
  /// a stream for them.
  std::size_t encode(std::span<const Trigger> triggers, std::vector<std::uint8_t>& out);
  std::size_t encode(std::span<const ImuSample> samples, std::vector<std::uint8_t>& out);

  /// Appends the header and all pending events.
  void flush(std::vector<std::uint8_t>& out);

  /// Position of the packet table. Until it is written, the header states that there is none.
  std::optional<FilePatch> patch() const override { return patch_; }

 private:
  /// Keeps events pending until there are enough for a packet.
  void append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override;
  bool append_end(std::vector<std::uint8_t>& out) override;
  void write_header(std::vector<std::uint8_t>& out);
  void write_events(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out);
  void write_packet(int stream, std::int64_t elements, Microseconds start, Microseconds end,
                    std::vector<std::uint8_t>& out);

  Aedat4Settings settings_;
  FrameCompressor compressor_;
  std::unique_ptr<Aedat4Builder> builder_;
  std::vector<AbsoluteEvent> held_;
  std::uint64_t position_ = 0;        ///< of the next bytes in the file
  std::uint64_t table_field_at_ = 0;  ///< of the table position in the file
  std::vector<Aedat4TableEntry> table_;
  std::optional<FilePatch> patch_;
};

}  // namespace eventcamera
