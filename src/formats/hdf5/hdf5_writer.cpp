// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_writer.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "src/core/sensor_size.hpp"
#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/hdf5_file.hpp"
#include "src/formats/hdf5/hdf5_layout.hpp"

namespace eventcamera {

struct Hdf5Writer::File {
  explicit File(const std::filesystem::path& path) : output(path) {}

  Hdf5Output output;
  Hdf5Handle handle;
};

namespace {

/// A commit starts after a tenth more events, or this many. A crash or a full disk loses at most
/// the events of two commits, since the last one may be incomplete.
constexpr std::size_t new_share = 10;
constexpr std::size_t max_uncommitted = std::size_t{1} << 20;

void check(const Hdf5Writer::Settings& settings) {
  const auto [width, height] = settings.size;
  if (settings.format != Hdf5Format::dsec && settings.format != Hdf5Format::metavision)
    throw std::invalid_argument("this HDF5 layout can only be read");
  const bool ecf = settings.format == Hdf5Format::metavision;
  const int limit = ecf ? ecf_max_pixels : max_side;
  if (width <= 0 || height <= 0 || width > limit || height > limit)
    throw std::invalid_argument("HDF5 files need a sensor size of at most " +
                                std::to_string(limit) + " pixels in a row or column");
}

}  // namespace

Hdf5Writer::Hdf5Writer(const std::filesystem::path& path, const Settings& settings)
    : size_(settings.size), commit_interval_(settings.commit_interval) {
  const Hdf5Session session;
  check(settings);
  file_ = std::make_unique<File>(path);
  file_->handle = file_->output.create();
  require(static_cast<bool>(file_->handle));
  layout_ = settings.format == Hdf5Format::dsec
                ? make_dsec_layout(file_->handle.get(), size_, settings.compression)
                : make_metavision_layout(file_->handle.get(), size_);
}

Hdf5Writer::~Hdf5Writer() {
  const Hdf5Session session;
  try {
    close();
  } catch (const std::exception&) {
    // A destructor cannot report errors.
  }
  layout_.reset();
  file_.reset();
}

void Hdf5Writer::append(std::span<const AbsoluteEvent> events) {
  const Hdf5Session session;
  file_->output.check();
  for (const auto& event : events) {
    if (event.t < latest_) throw std::invalid_argument("events are not sorted by time");
    latest_ = event.t;
    if (event.x >= size_.width || event.y() >= size_.height)
      throw std::invalid_argument("event outside the sensor");
  }
  layout_->append(events);
  file_->output.check();
  events_ += events.size();
  if (commit_interval_.count() == 0) return;
  const auto complete = events_ / hdf5_chunk * hdf5_chunk;
  const auto max_new =
      std::clamp<std::size_t>(committed_events_ / new_share, hdf5_chunk, max_uncommitted);
  const bool is_due = !committed_ || Clock::now() - *committed_ >= commit_interval_;
  if (is_due && !file_->output.is_committing())
    start_commit(true);
  else if (complete >= committed_events_ + max_new)
    start_commit(false);
}

std::size_t Hdf5Writer::label(std::span<const Label> labels) {
  const Hdf5Session session;
  file_->output.check();
  return layout_->label(labels);
}

bool Hdf5Writer::append(std::span<const Trigger> triggers) {
  const Hdf5Session session;
  file_->output.check();
  const bool written = layout_->append(triggers);
  file_->output.check();
  return written;
}

void Hdf5Writer::commit() {
  const Hdf5Session session;
  start_commit(true);
  file_->output.finish_commit();
  file_->output.check();
}

void Hdf5Writer::start_commit(bool with_partial_chunks) {
  layout_->flush(with_partial_chunks);
  require(H5Fflush(file_->handle.get(), H5F_SCOPE_GLOBAL) >= 0);
  file_->output.start_commit();
  file_->output.check();
  if (with_partial_chunks) committed_ = Clock::now();
  committed_events_ = with_partial_chunks ? events_ : events_ / hdf5_chunk * hdf5_chunk;
}

void Hdf5Writer::close() {
  if (!layout_) return;
  const Hdf5Session session;
  file_->output.check();
  auto layout = std::move(layout_);
  layout->close();
  layout.reset();
  file_->handle = {};
  file_->output.finish();
  file_->output.check();
}

}  // namespace eventcamera
