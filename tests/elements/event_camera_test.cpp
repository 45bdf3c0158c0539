// SPDX-License-Identifier: LGPL-2.1-or-later
// Event cameras among the video devices of Linux, as the documentation of their drivers describes
// them; no camera.
#include "elements/eventcam/cameras/event_camera.hpp"

#include <gtest/gtest.h>

namespace {

using namespace eventcamera;

/// A GenX320 on a Raspberry Pi 5, set up by the script of its drivers.
VideoDevice pi5() {
  return {.driver = "rp1-cfe",
          .card = "rp1-cfe",
          .fourcc = "GREY",
          .buffers = {4096, 391},
          .sensor = "genx320 10-003c",
          .word_format = "EVT21"};
}

/// An IMX636 on a Kria KV260.
VideoDevice kria() {
  return {.driver = "psee-dma",
          .card = "ps_host_if output 0",
          .fourcc = "PSE2",
          .buffers = {1280, 720},
          .sensor = "imx636 6-003c"};
}

TEST(EventCameras, HaveTheFormatThatTheirDriversTell) {
  const std::pair<const char*, EvtFormat> fourccs[] = {{"PSEE", EvtFormat::evt2},
                                                       {"PSE1", EvtFormat::evt21_legacy},
                                                       {"PSE2", EvtFormat::evt21},
                                                       {"PSE3", EvtFormat::evt3}};
  for (const auto& [fourcc, format] : fourccs) {
    auto device = kria();
    device.fourcc = fourcc;
    EXPECT_EQ(event_camera_of(device).value().format, format) << fourcc;
  }
  const std::pair<const char*, std::optional<EvtFormat>> controls[] = {
      {"EVT2", EvtFormat::evt2},   {"EVT21ME", EvtFormat::evt21_legacy},
      {"EVT21", EvtFormat::evt21}, {"EVT3", EvtFormat::evt3},
      {"", std::nullopt},          {"EVT9", std::nullopt}};
  for (const auto& [control, format] : controls) {
    auto device = pi5();
    device.word_format = control;
    EXPECT_EQ(event_camera_of(device).value().format, format) << control;
  }
}

TEST(EventCameras, MayHaveAnUnknownSensor) {
  auto device = kria();
  device.sensor = "imx999 6-003c";
  EXPECT_EQ(event_camera_of(device).value().name, "Event camera ps_host_if output 0");
  EXPECT_EQ(event_camera_of(device).value().sensor, (SensorSize{1280, 720}));
  device.fourcc = "GREY";
  EXPECT_EQ(event_camera_of(device).value().sensor, SensorSize{});
}

TEST(OtherCameras, AreNoEventCameras) {
  EXPECT_FALSE(event_camera_of({.driver = "uvcvideo", .card = "a webcam", .fourcc = "YUYV"}));
  EXPECT_FALSE(event_camera_of({.driver = "uvcvideo", .card = "infrared", .fourcc = "GREY"}));
  EXPECT_FALSE(event_camera_of({}));
  auto device = pi5();
  device.sensor = "imx708 10-001a";
  EXPECT_FALSE(event_camera_of(device));
  device.sensor = "";  // grey buffers of this size alone say nothing
  EXPECT_FALSE(event_camera_of(device));
  device.sensor = "genx3200";
  EXPECT_FALSE(event_camera_of(device));
  device = pi5();  // nodes of the same media device that are not set up for words
  device.fourcc = "pBAA";
  EXPECT_FALSE(event_camera_of(device));
}

}  // namespace
