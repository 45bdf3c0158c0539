// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_handle.hpp"

namespace eventcamera {

namespace {

constexpr std::size_t max_text = 4096;

struct Attribute {
  Attribute(hid_t object, const char* name, hssize_t numbers = 1) {
    if (H5Aexists(object, name) <= 0) return;
    attribute = {H5Aopen(object, name, H5P_DEFAULT), H5Aclose};
    const Hdf5Handle space(H5Aget_space(attribute.get()), H5Sclose);
    if (H5Sget_simple_extent_npoints(space.get()) == numbers)
      type = {H5Aget_type(attribute.get()), H5Tclose};
  }

  Hdf5Handle attribute, type;
};

}  // namespace

std::optional<std::string> read_text_attribute(hid_t object, const char* name) {
  const Attribute found(object, name);
  if (!found.type || H5Tget_class(found.type.get()) != H5T_STRING) return std::nullopt;
  if (H5Tis_variable_str(found.type.get()) > 0) {
    char* text = nullptr;
    if (H5Aread(found.attribute.get(), found.type.get(), static_cast<void*>(&text)) < 0 ||
        text == nullptr)
      return std::nullopt;
    std::string copy(text);
    H5free_memory(text);
    return copy;
  }
  const auto bytes = H5Tget_size(found.type.get());
  if (bytes == 0 || bytes > max_text) return std::nullopt;
  std::string text(bytes, '\0');
  if (H5Aread(found.attribute.get(), found.type.get(), text.data()) < 0) return std::nullopt;
  text.resize(text.find_last_not_of(std::string_view("\0 ", 2)) + 1);
  return text;
}

std::optional<std::int64_t> read_number_attribute(hid_t object, const char* name) {
  const Attribute found(object, name);
  if (!found.type || H5Tget_class(found.type.get()) != H5T_INTEGER) return std::nullopt;
  std::int64_t number = 0;
  if (H5Aread(found.attribute.get(), H5T_NATIVE_INT64, &number) < 0) return std::nullopt;
  return number;
}

std::optional<std::array<std::int64_t, 2>> read_pair_attribute(hid_t object, const char* name) {
  const Attribute found(object, name, 2);
  if (!found.type || H5Tget_class(found.type.get()) != H5T_INTEGER) return std::nullopt;
  std::array<std::int64_t, 2> numbers = {};
  if (H5Aread(found.attribute.get(), H5T_NATIVE_INT64, numbers.data()) < 0) return std::nullopt;
  return numbers;
}

bool write_text_attribute(hid_t object, const char* name, const std::string& text) {
  const Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  const Hdf5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  if (H5Tset_size(type.get(), H5T_VARIABLE) < 0) return false;
  const Hdf5Handle attribute(
      H5Acreate2(object, name, type.get(), space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  const char* const begin = text.c_str();
  return attribute && H5Awrite(attribute.get(), type.get(), static_cast<const void*>(&begin)) >= 0;
}

}  // namespace eventcamera
