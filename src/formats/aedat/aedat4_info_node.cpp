// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/aedat/aedat4_info_node.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <utility>

namespace eventcamera {

namespace {

constexpr std::size_t max_streams = 256;
constexpr std::size_t deepest_node = 64;
constexpr int max_side = 32767;

constexpr std::array<std::pair<std::string_view, char>, 5> entities{
    {{"&amp;", '&'}, {"&lt;", '<'}, {"&gt;", '>'}, {"&quot;", '"'}, {"&apos;", '\''}}};

std::string unescaped(std::string_view text) {
  std::string plain;
  while (!text.empty()) {
    const auto* const entity = std::ranges::find_if(
        entities, [&](const auto& candidate) { return text.starts_with(candidate.first); });
    const bool found = entity != entities.end();
    plain += found ? entity->second : text.front();
    text.remove_prefix(found ? entity->first.size() : 1);
  }
  return plain;
}

std::string escaped(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    const auto* const entity =
        std::ranges::find(entities, c, &std::pair<std::string_view, char>::second);
    safe += entity != entities.end() ? entity->first : std::string_view(&c, 1);
  }
  return safe;
}

std::optional<int> number(std::string_view text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < 0) return std::nullopt;
  return value;
}

/// Value of the attribute `name` in the text of a tag.
std::string_view attribute(std::string_view tag, std::string_view name) {
  const auto is_name = [](char c) { return c != ' ' && c != '\t' && c != '\r' && c != '\n'; };
  std::size_t before = 0;  // end of the previous attribute
  for (auto equals = tag.find('='); equals != std::string_view::npos;
       equals = tag.find('=', equals + 1)) {
    if (equals + 1 >= tag.size() || (tag[equals + 1] != '"' && tag[equals + 1] != '\'')) return {};
    const auto end = tag.find(tag[equals + 1], equals + 2);
    if (end == std::string_view::npos) return {};
    auto start = equals;
    while (start > before && is_name(tag[start - 1])) --start;
    if (tag.substr(start, equals - start) == name) return tag.substr(equals + 2, end - equals - 2);
    equals = end;
    before = end + 1;
  }
  return {};
}

/// Parses the tags and collects the nodes outInfo/N and outInfo/N/info.
class XmlReader {
 public:
  explicit XmlReader(std::string_view xml) : xml_(xml) {}

  Aedat4InfoNode read() {
    info_.whole = walk() && path_.empty();
    for (auto& stream : info_.streams)
      if (stream.size.width == 0 || stream.size.height == 0) stream.size = {};
    return std::move(info_);
  }

 private:
  bool walk() {
    while (true) {
      const auto open = xml_.find('<');
      if (open == std::string_view::npos) return true;
      xml_.remove_prefix(open);
      const bool comment = xml_.starts_with("<!--");
      const auto close = comment ? xml_.find("-->") : xml_.find('>');
      if (close == std::string_view::npos) return false;
      const auto tag = xml_.substr(1, close - 1);
      xml_.remove_prefix(close + 1);
      if (!comment && !take(tag)) return false;
    }
  }

  bool take(std::string_view tag) {
    if (tag.starts_with("node ")) {
      if (path_.size() == deepest_node) return false;
      path_.push_back(attribute(tag, "name"));
      if (of_stream(1) && !add_stream()) return false;
      if (tag.ends_with('/')) path_.pop_back();
    } else if (tag == "/node") {
      if (path_.empty()) return false;
      path_.pop_back();
    } else if (tag.starts_with("attr ") && !tag.ends_with('/')) {
      const auto end = xml_.find('<');
      if (end == std::string_view::npos) return false;
      note(attribute(tag, "key"), xml_.substr(0, end));
    }
    return true;
  }

  /// True if the current node is `below` levels below outInfo.
  bool of_stream(std::size_t below) const {
    return path_.size() > below && path_[path_.size() - 1 - below] == "outInfo" &&
           (below == 1 || path_.back() == "info");
  }

  bool add_stream() {
    const auto id = number(path_.back());
    const auto& streams = info_.streams;
    named_ = id.has_value();
    if (!named_) return true;
    if (streams.size() == max_streams ||
        std::ranges::find(streams, *id, &StreamInfo::id) != streams.end())
      return false;
    info_.streams.emplace_back().id = *id;
    return true;
  }

  void note(std::string_view key, std::string_view value) {
    if (!named_ || info_.streams.empty()) return;
    auto& stream = info_.streams.back();
    if (of_stream(1)) {
      if (key == "typeIdentifier") stream.kind = aedat4_kind(value);
    } else if (of_stream(2)) {
      const auto side = number(value).value_or(0);
      if (key == "source") stream.source = unescaped(value);
      if (key == "sizeX" && side <= max_side) stream.size.width = side;
      if (key == "sizeY" && side <= max_side) stream.size.height = side;
    }
  }

  std::string_view xml_;
  std::vector<std::string_view> path_;  ///< names of open nodes
  bool named_ = false;                  ///< the node of the last stream has a number
  Aedat4InfoNode info_;
};

std::string node(const std::string& name, const std::string& path, const std::string& inside) {
  return "<node name=\"" + name + "\" path=\"" + path + "\">" + inside + "</node>";
}

std::string text_attribute(const std::string& key, const std::string& value,
                           const std::string& type = "string") {
  return "<attr key=\"" + key + "\" type=\"" + type + "\">" + escaped(value) + "</attr>";
}

/// Indexed by Aedat4Compression.
constexpr const char* compression_names[] = {"NONE", "LZ4", "LZ4_HIGH", "ZSTD", "ZSTD_HIGH"};

struct KindText {
  StreamKind kind;
  std::string_view identifier;
  const char* name;
  const char* description;
};

constexpr std::array<KindText, 4> kinds{{
    {StreamKind::events, "EVTS", "events", "Array of events (polarity ON/OFF)."},
    {StreamKind::frames, "FRME", "frames", "Standard frame (8-bit image)."},
    {StreamKind::triggers, "TRIG", "triggers", "External triggers and special signals."},
    {StreamKind::imu, "IMUS", "imu", "Inertial Measurement Unit data samples."},
}};

}  // namespace

StreamKind aedat4_kind(std::string_view identifier) {
  const auto* const text = std::ranges::find(kinds, identifier, &KindText::identifier);
  return text != kinds.end() ? text->kind : StreamKind::other;
}

Aedat4InfoNode read_info_node(std::string_view xml) {
  return XmlReader(xml).read();
}

std::string write_info_node(std::span<const StreamInfo> streams, Aedat4Compression compression) {
  const std::string path = "/mainloop/Recorder/outInfo/";
  std::string inside;
  for (const auto& stream : streams) {
    const auto* const text = std::ranges::find(kinds, stream.kind, &KindText::kind);
    if (text == kinds.end()) continue;
    const auto id = std::to_string(stream.id);
    const auto stream_path = path + id + "/";
    inside += node(id, stream_path,
                   text_attribute("compression", compression_names[static_cast<int>(compression)]) +
                       text_attribute("originalModuleName", "gst-eventsim") +
                       text_attribute("originalOutputName", text->name) +
                       text_attribute("typeDescription", text->description) +
                       text_attribute("typeIdentifier", std::string(text->identifier)) +
                       node("info", stream_path + "info/",
                            text_attribute("sizeX", std::to_string(stream.size.width), "int") +
                                text_attribute("sizeY", std::to_string(stream.size.height), "int") +
                                text_attribute("source", stream.source)));
  }
  return "<dv version=\"2.0\">" + node("outInfo", path, inside) + "</dv>";
}

}  // namespace eventcamera
