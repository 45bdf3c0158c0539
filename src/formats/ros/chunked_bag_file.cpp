// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/ros/chunked_bag_file.hpp"

#include <algorithm>

#include "src/formats/corruption.hpp"
#include "src/formats/magic.hpp"

namespace eventcamera {

std::optional<SeekPoint> ChunkedBagFile::seek_point_before(Microseconds logged) const {
  if (!magic_read_ && !index_.last()) return std::nullopt;
  return index_.before(logged);
}

void ChunkedBagFile::restart(const SeekPoint& seek_point) {
  queue_.restart(seek_point.position);
  chunk_.reset();
  finished_ = ended_ = scanning_ = false;
  magic_read_ = true;
  skip_ = 0;
  record_ = 0;
  index_.restart(seek_point);
}

std::optional<BagMessage> ChunkedBagFile::next() {
  while (magic_read_ || read_magic()) {
    if (chunk_) {
      if (const auto message = next_in_chunk()) return message;
      continue;
    }
    if (!next_record()) break;
    if (record_ == 0) continue;
    const auto record = queue_.peek(record_).first(record_);
    const auto position = queue_.position();
    index_.record_position(position);
    if (kind_ == Head::Kind::chunk)
      chunk_ = records_of(record, position, ended_);
    else if (const auto message = read_record(record, position))
      return message;
  }
  queue_.keep();
  return std::nullopt;
}

bool ChunkedBagFile::read_magic() {
  const auto start = queue_.peek(magic_.size());
  if (start.empty()) {
    if (finished_) throw UnsupportedFormat("the file ends within its first bytes");
    return false;
  }
  if (!has_at(0, magic_, start)) throw UnsupportedFormat("it does not begin as a bag does");
  queue_.consume(magic_.size());
  magic_read_ = true;
  index_.record_position(queue_.position());
  return true;
}

/// Consumes the last record and finds the next one: record_ is its size, or 0 if other bytes
/// precede it. False if more bytes are needed, or at the end.
bool ChunkedBagFile::next_record() {
  queue_.consume(std::exchange(record_, 0));
  if (ended_) skip_ = queue_.size();
  if (skip_ > 0 && !skip_bytes()) return false;
  if (ended_ || (scanning_ && !scan()) || queue_.size() == 0) return false;
  auto head = head_of(queue_.peek(1));
  if (!head) head = head_of(queue_.peek(queue_.size()));
  if (!head) {
    if (!finished_) return false;
    corrupt("the file ends within a record");
    return true;
  }
  if (head->kind == Head::Kind::end) {
    ended_ = true;
    return true;
  }
  if (head->kind == Head::Kind::skipped) {
    skip_ = head->size;
    return true;
  }
  if (head->kind == Head::Kind::none || head->size > max_record) {
    corrupt("bytes that are not a record");
    return true;
  }
  kind_ = head->kind;
  record_ = static_cast<std::size_t>(head->size);
  if (!queue_.peek(record_).empty()) return true;
  record_ = 0;
  if (!finished_) return false;
  if (kind_ != Head::Kind::chunk) {
    corrupt("the file ends within a record");
    return true;
  }
  // The messages of an uncompressed chunk can still be read.
  corruption_.note(queue_.position(), "the file ends within a chunk");
  record_ = queue_.size();
  ended_ = true;
  return true;
}

/// False if more bytes are needed.
bool ChunkedBagFile::skip_bytes() {
  const auto count = std::min<std::uint64_t>(skip_, queue_.size());
  queue_.consume(static_cast<std::size_t>(count));
  skip_ -= count;
  if (skip_ > 0 && finished_ && !ended_) {
    corruption_.note(queue_.position(), "the file ends within a record");
    ended_ = true;
  }
  return skip_ == 0;
}

/// Searches for the next record. False if there is none so far.
bool ChunkedBagFile::scan() {
  while (true) {
    const auto bytes = queue_.peek(scanned_bytes_);
    if (bytes.empty()) {
      if (finished_) queue_.consume(queue_.size());
      return false;
    }
    std::size_t at = 0;
    const auto end = bytes.size() - scanned_bytes_ + 1;
    while (at < end && !begins_record(bytes.subspan(at))) ++at;
    queue_.consume(at);
    if (at == end) continue;
    scanning_ = false;
    return true;
  }
}

void ChunkedBagFile::corrupt(const char* what) {
  corruption_.note(queue_.position(), what);
  queue_.consume(1);
  record_ = 0;
  scanning_ = true;
}

/// Skips invalid bytes up to the next record in the chunk. False if there is none.
bool ChunkedBagFile::find_record_in_chunk() {
  do chunk_ = chunk_->subspan(1);
  while (chunk_->size() >= scanned_bytes_ && !begins_record(*chunk_));
  return chunk_->size() >= scanned_bytes_;
}

/// The next message in the chunk, which ends if there is none.
std::optional<BagMessage> ChunkedBagFile::next_in_chunk() {
  const auto position = queue_.position();
  while (!chunk_->empty()) {
    const auto head = head_of(*chunk_);
    if (!head || head->kind == Head::Kind::none || head->size > chunk_->size()) {
      if (!ended_) corruption_.note(position, "a chunk with bytes that are not a record");
      if (!find_record_in_chunk()) break;
      continue;
    }
    const auto record = chunk_->first(static_cast<std::size_t>(head->size));
    chunk_ = chunk_->subspan(record.size());
    if (head->kind != Head::Kind::read) continue;
    if (const auto message = read_record(record, position)) return message;
  }
  chunk_.reset();
  return std::nullopt;
}

}  // namespace eventcamera
