// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "src/formats/aedat/aedat4.fbs.h"

/// Reads the FlatBuffers of AEDAT4 in place, at any alignment: neither their address nor the
/// writer's alignment can be relied on.
namespace eventcamera::aedat4 {

inline constexpr std::size_t size_prefix = sizeof(flatbuffers::uoffset_t);

/// Minimum size of a FlatBuffer with size prefix and identifier.
inline constexpr std::size_t min_flatbuffer = 3 * size_prefix;

/// Elements of a verified vector: bytes, structs, or offsets of tables.
struct Elements {
  const std::uint8_t* data = nullptr;
  std::size_t count = 0;

  /// Element `i` of a vector of tables.
  template <class Table>
  const Table* table(std::size_t i) const {
    const auto* const offset = data + i * sizeof(flatbuffers::uoffset_t);
    return reinterpret_cast<const Table*>(offset +
                                          flatbuffers::ReadScalar<flatbuffers::uoffset_t>(offset));
  }
};

inline Elements elements_of(const void* vector) {
  if (vector == nullptr) return {};
  const auto* const bytes = static_cast<const std::uint8_t*>(vector);
  return {bytes + sizeof(flatbuffers::uoffset_t),
          flatbuffers::ReadScalar<flatbuffers::uoffset_t>(bytes)};
}

/// A table whose first field is a vector of tables. The verifier that flatc generates works for
/// aligned vectors only.
template <class Element>
class Tables : private flatbuffers::Table {
 public:
  const void* elements() const { return GetPointer<const void*>(field); }

  bool Verify(flatbuffers::Verifier& verifier) const {
    if (!VerifyTableStart(verifier) || !VerifyOffset(verifier, field)) return false;
    const auto* const vector = static_cast<const std::uint8_t*>(elements());
    if (vector != nullptr && !verifier.VerifyVectorOrString(vector, sizeof(flatbuffers::uoffset_t)))
      return false;
    const auto tables = elements_of(vector);
    for (std::size_t i = 0; i < tables.count; ++i) {
      const auto* const offset = tables.data + i * sizeof(flatbuffers::uoffset_t);
      if (verifier.VerifyOffset(offset, 0) == 0 || !tables.table<Element>(i)->Verify(verifier))
        return false;
    }
    return verifier.EndTable();
  }

 private:
  static constexpr flatbuffers::voffset_t field = 4;
};

/// Returns the root of a FlatBuffer with a size prefix; null if it is corrupt.
template <class Root>
const Root* verified(std::span<const std::uint8_t> content, const char* identifier) {
  // The Verifier reads the identifier without checking the size first.
  if (content.size() < min_flatbuffer) return nullptr;
  flatbuffers::Verifier::Options options;
  options.max_tables = static_cast<flatbuffers::uoffset_t>(content.size());
  options.check_alignment = false;
  flatbuffers::Verifier verifier(content.data(), content.size(), options);
  if (!verifier.VerifySizePrefixedBuffer<Root>(identifier)) return nullptr;
  const auto* const root = content.data() + size_prefix;
  return reinterpret_cast<const Root*>(root +
                                       flatbuffers::ReadScalar<flatbuffers::uoffset_t>(root));
}

/// Returns the elements of a packet or of the packet table; nothing if it is corrupt.
template <class Root>
std::optional<Elements> verified_elements(std::span<const std::uint8_t> content,
                                          const char* identifier) {
  const auto* const root = verified<Root>(content, identifier);
  if (root == nullptr) return std::nullopt;
  return elements_of(root->elements());
}

}  // namespace eventcamera::aedat4
