// SPDX-License-Identifier: LGPL-2.1-or-later
// Events over RTP, through the elements that people send and protect RTP with: nothing is lost.
#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tests/elements/pipeline.hpp"

namespace {

using eventcamera::AbsoluteEvent;
using eventcamera::Event;
using eventcamera::Polarity;
using namespace std::chrono_literals;

const std::string event_caps = "application/x-event-camera,format=XYTP,width=346,height=260";
const std::string rtp_fields =
    "media=application,clock-rate=1000000,encoding-name=X-EVENT-CAMERA,payload=96,width=346,"
    "height=260,format=EVT3";
const std::string from_caps = "caps=\"application/x-rtp," + rtp_fields + "\"";
/// One second of events in buffers of 10 ms.
constexpr int buffers = 100;
constexpr int events_per_buffer = 400;
const std::string source =
    "appsrc name=in format=time is-live=true caps=" + event_caps + " ! identity sync=true";
const std::string sink = "rtpeventdepay name=depay ! appsink name=out sync=false";

/// The sender's times are neither 0 at its start nor whole microseconds.
constexpr GstClockTime origin = 123'456'789;

std::vector<Event> events_of_buffer(int number) {
  std::vector<Event> events;
  for (int i = 0; i < events_per_buffer; ++i)
    events.push_back(Event::at((number * 31 + i * 17) % 346, (number * 7 + i * 5) % 260,
                               static_cast<std::uint32_t>(i * 25),
                               i % 3 == 0 ? Polarity::on : Polarity::off));
  return events;
}

/// Waits for what should happen at once, at most two minutes: the machine may be under load.
template <class Condition>
void wait_until(const Condition& condition) {
  const auto deadline = std::chrono::steady_clock::now() + 2min;
  while (!condition() && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(10ms);
  EXPECT_TRUE(condition());
}

std::vector<AbsoluteEvent> sent_events() {
  std::vector<AbsoluteEvent> events;
  for (int i = 0; i < buffers; ++i)
    for (const auto& event : events_of_buffer(i))
      events.push_back(
          {static_cast<eventcamera::Microseconds>(origin / 1000) + i * 10'000 + event.t, event.x,
           event.y_p});
  return events;
}

/// Gets the events from the appsink `out` of a pipeline, which stops before they are gone.
class Receiver {
 public:
  explicit Receiver(Pipeline& pipeline) : pipeline_(pipeline) {
    GstAppSinkCallbacks callbacks = {};
    callbacks.new_sample = [](GstAppSink* out, gpointer self) {
      static_cast<Receiver*>(self)->take(gst_app_sink_pull_sample(out));
      return GST_FLOW_OK;
    };
    gst_app_sink_set_callbacks(GST_APP_SINK(pipeline["out"]), &callbacks, this, nullptr);
  }
  ~Receiver() { pipeline_.set(GST_STATE_NULL); }
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;

  std::vector<AbsoluteEvent> events() {
    const std::lock_guard lock(mutex_);
    return events_;
  }

  void wait_for(std::size_t count) {
    wait_until([&] { return events().size() >= count; });
  }

 private:
  void take(GstSample* sample) {
    if (sample == nullptr) return;  // stopped
    {
      const std::lock_guard lock(mutex_);
      append_events(gst_sample_get_buffer(sample), events_);
    }
    gst_sample_unref(sample);
  }

  Pipeline& pipeline_;
  std::mutex mutex_;
  std::vector<AbsoluteEvent> events_;
};

/// Sends the test's events into the appsrc `in` of a pipeline.
class Sender {
 public:
  explicit Sender(const Pipeline& pipeline) : in_(GST_APP_SRC(pipeline["in"])) {}

  void send(int first, int end) {
    for (int i = first; i < end; ++i)
      gst_app_src_push_buffer(in_, buffer_of(origin + static_cast<GstClockTime>(i) * duration,
                                             events_of_buffer(i), duration));
  }
  /// Sends buffers in parts that fit into the receiver's socket. Each waits until the one before
  /// has arrived, so that a slow machine loses none.
  void send(int first, int end, Receiver& receiver) {
    constexpr int part = 10;
    const auto before = receiver.events().size();
    for (int i = first; i < end; i += part) {
      receiver.wait_for(before + static_cast<std::size_t>(std::max(i - first - part, 0)) *
                                     events_per_buffer);
      send(i, std::min(i + part, end));
    }
    receiver.wait_for(before + static_cast<std::size_t>(end - first) * events_per_buffer);
  }

 private:
  static constexpr GstClockTime duration = 10 * GST_MSECOND;
  GstAppSrc* in_;
};

/// Even port number that this process uses for no other test.
int next_port() {
  static int port = 20000 + static_cast<int>(g_get_monotonic_time() / 1000 % 20000) / 2 * 2;
  return port += 10;
}

/// Drops every 50th packet that leaves the element `loss`, but not the first few and the last.
void drop_every_50th(const Pipeline& pipeline, std::atomic<int>& dropped) {
  GstPad* pad = gst_element_get_static_pad(pipeline["loss"], "src");
  struct Loss {
    std::atomic<int>& dropped;
    int count = 0;
  };
  gst_pad_add_probe(
      pad, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo*, gpointer data) {
        auto& loss = *static_cast<Loss*>(data);
        if (++loss.count % 50 != 0 || loss.count > buffers) return GST_PAD_PROBE_OK;
        ++loss.dropped;
        return GST_PAD_PROBE_DROP;
      },
      new Loss{dropped}, [](gpointer data) { delete static_cast<Loss*>(data); });
  gst_object_unref(pad);
}

const std::string key(60, 'a');

std::string srtp_caps(const std::string& with) {
  return "application/x-srtp," + rtp_fields + ",srtp-key=(buffer)" + with +
         ",srtp-cipher=aes-128-icm,srtp-auth=hmac-sha1-80,srtcp-cipher=aes-128-icm,"
         "srtcp-auth=hmac-sha1-80";
}

TEST(Rtp, ARestartedSrtpSenderIsHeardByItsNewSsrc) {
  const auto port = std::to_string(next_port());
  Pipeline receiving("udpsrc port=" + port + " caps=\"application/x-srtp," + rtp_fields +
                     "\" ! srtpdec name=decrypt ! " + sink);
  g_signal_connect(receiving["decrypt"], "request-key",
                   G_CALLBACK(+[](GstElement*, guint, gpointer) {
                     return gst_caps_from_string(srtp_caps(key).c_str());
                   }),
                   nullptr);
  Receiver receiver(receiving);
  receiving.set(GST_STATE_PLAYING);
  for (std::size_t starts = 1; starts <= 3; ++starts) {
    Pipeline sending(source + " ! rtpeventpay name=pay ! srtpenc key=" + key +
                     " ! udpsink host=127.0.0.1 port=" + port);
    sending.set(GST_STATE_PLAYING);
    Sender(sending).send(0, 10);
    const auto sent = starts * 10 * events_per_buffer;
    wait_until([&] { return receiver.events().size() == sent; });
    EXPECT_EQ(receiver.events().size(), sent);
  }
}

/// Answers `signal` of an rtpbin with an element for session 0.
void add_retransmission(const Pipeline& pipeline, const char* rtpbin, const char* signal,
                        const char* element) {
  g_signal_connect(
      pipeline[rtpbin], signal, G_CALLBACK(+[](GstElement*, guint, gpointer name) {
        GstElement* bin = gst_bin_new(nullptr);
        GstElement* rtx = gst_element_factory_make(static_cast<const char*>(name), nullptr);
        GstStructure* map =
            gst_structure_new("application/x-rtp-pt-map", "96", G_TYPE_UINT, 97U, nullptr);
        g_object_set(rtx, "payload-type-map", map, nullptr);
        if (g_strcmp0(static_cast<const char*>(name), "rtprtxsend") == 0)
          g_object_set(rtx, "max-size-packets", 1000U, nullptr);
        gst_structure_free(map);
        gst_bin_add(GST_BIN(bin), rtx);
        for (const auto* pad_name : {"sink", "src"}) {
          GstPad* pad = gst_element_get_static_pad(rtx, pad_name);
          gst_element_add_pad(bin, gst_ghost_pad_new((std::string(pad_name) + "_0").c_str(), pad));
          gst_object_unref(pad);
        }
        return bin;
      }),
      const_cast<char*>(element));
}

TEST(Rtp, RetransmissionLosesNothing) {
  const int port = next_port();
  const auto [rtp, rtcp, feedback] =
      std::array{std::to_string(port), std::to_string(port + 1), std::to_string(port + 2)};
  // The latency bears a loaded machine: packets leave the jitter buffer as soon as none is missing.
  const std::string bin = "rtpbin rtp-profile=avpf do-retransmission=true latency=20000 name=";
  Pipeline receiving(bin + "r  udpsrc name=rtp port=" + rtp + " " + from_caps +
                     "  udpsrc port=" + rtcp +
                     " ! r.recv_rtcp_sink_0  r.send_rtcp_src_0 ! udpsink host=127.0.0.1 "
                     "sync=false async=false port=" +
                     feedback + "  r. ! " + sink);
  g_signal_connect(
      receiving["r"], "request-pt-map", G_CALLBACK(+[](GstElement*, guint, guint type, gpointer) {
        const auto caps = type == 96 ? "application/x-rtp," + rtp_fields
                                     : std::string(
                                           "application/x-rtp,media=application,payload=97,"
                                           "clock-rate=1000000,encoding-name=RTX,apt=96");
        return gst_caps_from_string(caps.c_str());
      }),
      nullptr);
  g_signal_connect(receiving["r"], "new-jitterbuffer",
                   G_CALLBACK(+[](GstElement*, GstElement* buffer, guint, guint, gpointer) {
                     g_object_set(buffer, "faststart-min-packets", 1, nullptr);
                   }),
                   nullptr);
  // rtpbin asks for these when its pads are requested.
  add_retransmission(receiving, "r", "request-aux-receiver", "rtprtxreceive");
  gst_element_link_pads(receiving["rtp"], "src", receiving["r"], "recv_rtp_sink_0");
  Receiver receiver(receiving);
  Pipeline sending(
      bin + "s  " + source +
      " ! rtpeventpay name=pay  identity name=loss ! udpsink host=127.0.0.1 port=" + rtp +
      "  s.send_rtcp_src_0 ! udpsink host=127.0.0.1 sync=false async=false port=" + rtcp +
      "  udpsrc port=" + feedback + " ! s.recv_rtcp_sink_0");
  add_retransmission(sending, "s", "request-aux-sender", "rtprtxsend");
  gst_element_link_pads(sending["pay"], "src", sending["s"], "send_rtp_sink_0");
  gst_element_link_pads(sending["s"], "send_rtp_src_0", sending["loss"], "sink");
  std::atomic<int> dropped = 0;
  drop_every_50th(sending, dropped);
  receiving.set(GST_STATE_PLAYING);
  sending.set(GST_STATE_PLAYING);
  Sender(sending).send(0, buffers, receiver);
  EXPECT_EQ(dropped, 2);
  EXPECT_EQ(receiver.events(), sent_events());
  EXPECT_EQ(receiving.stat("depay", "lost-events"), 0U);
}

TEST(Rtp, ArrivesOverSrt) {
  const auto port = std::to_string(next_port());
  Pipeline receiving("srtsrc uri=\"srt://127.0.0.1:" + port +
                     "?mode=listener\" ! application/x-rtp-stream," + rtp_fields +
                     " ! rtpstreamdepay ! " + sink);
  Receiver receiver(receiving);
  receiving.set(GST_STATE_PLAYING);
  Pipeline sending(source + " ! rtpeventpay ! rtpstreampay ! srtsink uri=\"srt://127.0.0.1:" +
                   port + "?mode=caller\"");
  sending.set(GST_STATE_PLAYING);
  Sender(sending).send(0, buffers, receiver);
  EXPECT_EQ(receiver.events(), sent_events());
  EXPECT_EQ(receiving.stat("depay", "lost-events"), 0U);
}

}  // namespace
