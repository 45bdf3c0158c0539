// SPDX-License-Identifier: LGPL-2.1-or-later
// tshark finds our RTP packets by our SDP, and reports no fault in either.
#include <gst/app/gstappsink.h>
#include <gst/sdp/gstsdpmessage.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace {

constexpr std::uint16_t port = 5004;
constexpr std::uint16_t announcement_port = 9875;

/// Bytes of a capture, in network byte order unless said otherwise.
class Bytes {
 public:
  Bytes& be(std::uint64_t number, int size) {
    for (int i = size; i-- > 0;) text_ += static_cast<char>(number >> 8 * i);
    return *this;
  }
  Bytes& le(std::uint64_t number, int size = 4) {
    for (int i = 0; i < size; ++i) text_ += static_cast<char>(number >> 8 * i);
    return *this;
  }
  Bytes& add(const std::string& bytes) {
    text_ += bytes;
    return *this;
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

/// Record of a UDP datagram without checksums, from this machine to itself.
std::string record_of(std::uint16_t to, const std::string& payload, GstClockTime time) {
  constexpr std::uint32_t host = 0x7f000001;
  const auto size = payload.size();
  const auto datagram = Bytes()
                            .be(0x4500, 2)
                            .be(28 + size, 2)
                            .be(0, 4)
                            .be(64, 1)
                            .be(17, 1)
                            .be(0, 2)
                            .be(host, 4)
                            .be(host, 4)
                            .be(40000, 2)
                            .be(to, 2)
                            .be(8 + size, 2)
                            .be(0, 2)
                            .add(payload)
                            .text();
  return Bytes()
      .le(time / GST_SECOND)
      .le(time % GST_SECOND / GST_USECOND)
      .le(datagram.size())
      .le(datagram.size())
      .add(datagram)
      .text();
}

std::string sdp_of(GstCaps* caps) {
  GstSDPMedia* media = nullptr;
  gst_sdp_media_new(&media);
  EXPECT_EQ(gst_sdp_media_set_media_from_caps(caps, media), GST_SDP_OK);
  gst_sdp_media_set_port_info(media, port, 1);
  gst_sdp_media_set_proto(media, "RTP/AVP");
  gchar* text = gst_sdp_media_as_text(media);
  const std::string sdp =
      "v=0\r\no=- 1 1 IN IP4 127.0.0.1\r\ns=events\r\nc=IN IP4 127.0.0.1\r\nt=0 0\r\n" +
      std::string(text);
  g_free(text);
  gst_sdp_media_free(media);
  return sdp;
}

/// Writes a capture of an announcement of a stream, and its packets; returns their number.
int write_capture(const std::filesystem::path& path) {
  gst_init(nullptr, nullptr);
  GstElement* pipeline = gst_parse_launch(
      "videotestsrc pattern=ball num-buffers=25 ! video/x-raw,framerate=25/1 ! eventsim-diff ! "
      "rtpeventpay mtu=576 ! appsink name=out sync=false",
      nullptr);
  GstElement* out = gst_bin_get_by_name(GST_BIN(pipeline), "out");
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  std::string packets;
  std::string announcement;
  int count = 0;
  while (GstSample* sample = gst_app_sink_pull_sample(GST_APP_SINK(out))) {
    GstBuffer* buffer = gst_sample_get_buffer(sample);
    std::string packet(gst_buffer_get_size(buffer), '\0');
    gst_buffer_extract(buffer, 0, packet.data(), packet.size());
    packets += record_of(port, packet, GST_BUFFER_PTS(buffer));
    if (count++ == 0)
      announcement = Bytes()
                         .be(0x20000001, 4)
                         .be(0x7f000001, 4)
                         .add("application/sdp")
                         .be(0, 1)
                         .add(sdp_of(gst_sample_get_caps(sample)))
                         .text();
    gst_sample_unref(sample);
  }
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(out);
  gst_object_unref(pipeline);
  constexpr int raw_ip = 101;
  std::ofstream(path, std::ios::binary)
      << Bytes().le(0xa1b2c3d4).le(2, 2).le(4, 2).le(0).le(0).le(65535).le(raw_ip).text()
      << record_of(announcement_port, announcement, 0) << packets;
  return count;
}

/// Lines that tshark prints of a capture, with these fields separated by commas.
std::vector<std::vector<std::string>> dissected(const std::filesystem::path& path,
                                                const std::string& filter,
                                                const std::vector<std::string>& fields) {
  std::string command =
      "tshark -r '" + path.string() + "' -Y '" + filter + "' -T fields -E separator=, 2>/dev/null";
  for (const auto& field : fields) command += " -e " + field;
  FILE* const output = popen(command.c_str(), "r");
  std::string text;
  for (int character = std::fgetc(output); character != EOF; character = std::fgetc(output))
    text += static_cast<char>(character);
  EXPECT_EQ(pclose(output), 0) << command;
  std::vector<std::vector<std::string>> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    auto& values = lines.emplace_back();
    std::istringstream parts(line + ",");
    for (std::string value; std::getline(parts, value, ',');) values.push_back(value);
  }
  return lines;
}

TEST(RtpTshark, DecodesOurSdpAndHeaders) {
  const auto path = std::filesystem::temp_directory_path() /
                    ("events-" + std::to_string(g_random_int()) + ".pcap");
  const int count = write_capture(path);
  ASSERT_GT(count, 50);
  EXPECT_TRUE(dissected(path, "_ws.expert || _ws.malformed", {"frame.number"}).empty());

  const auto announced = dissected(path, "sdp", {"sdp.mime.type", "sdp.sample_rate"});
  ASSERT_EQ(announced.size(), 1U);
  EXPECT_EQ(announced[0], (std::vector<std::string>{"X-EVENT-CAMERA", "1000000"}));

  // As RTP they are known from the SDP only.
  const auto packets = dissected(path, "rtp && rtp.version == 2 && rtp.p_type == 96",
                                 {"rtp.seq", "rtp.timestamp", "rtp.marker", "rtp.setup-method"});
  ASSERT_EQ(packets.size(), static_cast<std::size_t>(count));
  std::set<std::string> timestamps;
  std::size_t markers = 0;
  for (std::size_t i = 0; i < packets.size(); ++i) {
    ASSERT_EQ(packets[i].size(), 4U);
    if (i > 0) {
      EXPECT_EQ(std::stoi(packets[i][0]), (std::stoi(packets[i - 1][0]) + 1) % 65536);
    }
    timestamps.insert(packets[i][1]);
    markers += packets[i][2] == "1" ? 1 : 0;
    EXPECT_EQ(packets[i][3], "SDP");
  }
  EXPECT_EQ(timestamps.size(), 24U);
  EXPECT_EQ(markers, 24U);
  std::filesystem::remove(path);
}

}  // namespace
