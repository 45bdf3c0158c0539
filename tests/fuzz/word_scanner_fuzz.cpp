// SPDX-License-Identifier: LGPL-2.1-or-later
// The first byte selects a format and how words arrive. Transfers follow, each after two bytes with
// its size and one with flags and the time since the one before.
#include "src/formats/evt/word_scanner.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

namespace {

using namespace eventcamera;
using fuzz::require;

constexpr SensorSize sensor{320, 240};

/// Decodes the pieces as evtdec does, and checks their times.
class Pieces {
 public:
  explicit Pieces(EvtFormat format)
      : format_(format == EvtFormat::evt21_legacy ? EvtFormat::evt21 : format) {}

  void take(const std::vector<WordScanner::Piece>& pieces) {
    for (const auto& piece : pieces) {
      require(!piece.words.empty(), "pieces have words");
      require(piece.start <= piece.end, "intervals end after they start");
      require(piece.is_discontinuous || (decoder_ && piece.start == end_), "intervals follow");
      if (piece.is_discontinuous) decoder_ = make_evt_decoder(format_, sensor);
      end_ = piece.end;
      bytes += piece.words.size();
      Decoded decoded;
      decoder_->decode(piece.words, decoded);
      events += decoded.events.size();
      fuzz::require_within(sensor, decoded.events);
    }
  }

  std::uint64_t bytes = 0;
  std::uint64_t events = 0;

 private:
  EvtFormat format_;
  std::unique_ptr<EventDecoder> decoder_;
  Microseconds end_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span bytes(data, size);
  if (bytes.empty()) return 0;
  const auto format = static_cast<EvtFormat>(bytes[0] % 5);
  const auto framing = bytes[0] % 2 == 0 ? Framing::loose : Framing::padded;
  const auto scanner = make_word_scanner(format, sensor, framing);
  Pieces read(format);
  std::uint64_t sent = 0;
  std::vector<WordScanner::Piece> pieces;
  fuzz::for_each_packet(bytes.subspan(1), [&](int flags, const auto& transfer) {
    std::optional<Microseconds> elapsed;
    if ((flags & 2) != 0) elapsed = Microseconds{1} << (flags >> 2) % 40;
    scanner->scan({transfer, (flags & 1) != 0, elapsed}, pieces);
    sent += transfer.size();
    read.take(pieces);
    pieces.clear();
  });
  scanner->finish(pieces);
  read.take(pieces);
  const auto& counts = scanner->counts();
  require(counts.bytes == read.bytes, "bytes are counted");
  require(counts.events == read.events, "events are counted");
  if (framing == Framing::loose)
    require(counts.bytes + counts.lost_bytes == sent, "every byte is passed on or lost");
  else
    require(counts.bytes + counts.lost_bytes <= sent, "no byte is made up");
  return 0;
}
