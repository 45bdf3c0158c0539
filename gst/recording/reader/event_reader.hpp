// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <memory>
#include <optional>

#include "gst/base/buffer_bytes.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/owned.hpp"
#include "gst/base/seek_request.hpp"
#include "gst/recording/eventreader.hpp"
#include "gst/recording/reader/reader_output.hpp"
#include "gst/recording/reader/reader_reports.hpp"
#include "gst/recording/reader/reader_timeline.hpp"
#include "src/formats/byte_source.hpp"
#include "src/formats/compressed_file.hpp"
#include "src/formats/recording_reader.hpp"

/// Bytes of a file pulled from upstream.
class PadBytes final : public eventcamera::ByteSource {
 public:
  /// `sink` must outlive this object.
  explicit PadBytes(GstPad* sink) : sink_(sink), size_(upstream_bytes(sink)) {}

  std::uint64_t size() const override { return size_; }
  std::optional<std::size_t> read(std::uint64_t position,
                                  std::span<std::uint8_t> out) noexcept override;
  std::optional<std::span<const std::uint8_t>> piece(std::uint64_t position) override;
  bool failed() const noexcept override { return flow_ != GST_FLOW_OK; }

  /// Reason for a failed read; GST_FLOW_EOS if upstream was stopped before the end of the file.
  GstFlowReturn flow() const { return flow_; }

  /// Clears a failed read.
  void retry() { flow_ = GST_FLOW_OK; }

 private:
  GstBuffer* pull(std::uint64_t position, std::size_t size) noexcept;

  GstPad* sink_;
  std::uint64_t size_;
  GstFlowReturn flow_ = GST_FLOW_OK;
  std::optional<MappedBytes> piece_;
};

/// User-settable values of every reader, read at the start of a file.
struct ReaderSettings {
  GstClockTime buffer_duration = 10 * GST_MSECOND;
};

/// Implementation of the element: gets the bytes of a recording from its sink pad, and passes what
/// they contain to its output. Except where noted, functions run under the sink pad's stream lock,
/// or while there is no streaming thread.
class EventReader {
 public:
  EventReader(GstElement* element, const EventReaderFormat& format);
  EventReader(const EventReader&) = delete;
  EventReader& operator=(const EventReader&) = delete;

  // From any thread.
  Guarded<ReaderSettings>& settings() { return settings_; }
  Guarded<FormatSettings>& format_settings() { return format_settings_; }
  GstStructure* stats() const { return reports_.stats(); }
  gboolean src_event(GstPad* pad, GstEvent* event);
  gboolean src_query(GstPad* pad, GstQuery* query);

  /// Forgets the file.
  void reset();

  gboolean activate(GstPadMode mode, bool active);
  GstFlowReturn chain(GstBuffer* buffer);
  gboolean sink_event(GstEvent* event);

 private:
  template <class Work>
  GstFlowReturn guard(const Work& work);

  void open_recording();
  void close_recording();
  GstFlowReturn step();
  GstFlowReturn push_pending();

  static void loop(gpointer self);
  GstFlowReturn pull();

  GstFlowReturn handle_buffer(GstBuffer* buffer);
  GstFlowReturn push_decompressed();
  gboolean handle_caps(GstEvent* event);
  gboolean handle_segment(GstEvent* event);
  gboolean handle_bytes_segment(guint64 start, guint32 seqnum);
  void handle_gap(GstEvent* event);
  void finish_input();
  GstFlowReturn drain();

  bool seek(const SeekRequest& request);
  bool seek_pulling(const SeekRequest& request);
  bool seek_pushing(const SeekRequest& request, const GstSegment& segment);

  GstElement* element_;
  GstPad* sink_;
  const EventReaderFormat& format_;
  Guarded<ReaderSettings> settings_;
  Guarded<FormatSettings> format_settings_;

  ReaderTimeline timeline_;
  ReaderReports reports_;
  ReaderOutput output_;
  OwnedCaps caps_;                                             ///< input caps
  std::optional<PadBytes> bytes_;                              ///< pull mode only
  std::optional<eventcamera::DecompressedFile> decompressed_;  ///< of bytes_, if compressed
  std::optional<eventcamera::FileDecompressor> decompressor_;  ///< push mode, from a file's start
  std::shared_ptr<eventcamera::RecordingReader> recording_;
  bool is_consuming_ = false;         ///< bytes were passed to the recording
  GstFlowReturn flow_ = GST_FLOW_OK;  ///< anything else refuses pushed bytes
};

/// The reader of an element.
EventReader& event_reader_of(GstObject* element);
