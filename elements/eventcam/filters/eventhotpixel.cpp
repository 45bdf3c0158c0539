// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventhotpixel
 * @title: eventhotpixel
 * @short_description: drops the events of hot pixels
 *
 * Drops the events of pixels that fire much more often than those around them. After every
 * #GstEventHotPixel:learning-period, the hot pixels are those that fired at least
 * #GstEventHotPixel:min-rate times a second, and #GstEventHotPixel:ratio times as often as the
 * median of their 8 neighbours. In the first period nothing is dropped, unless
 * #GstEventHotPixel:location is a file of hot pixels.
 *
 * With #GstEventHotPixel:location, the hot pixels are read from the file, if there is one, when the
 * stream begins, and written to it when the element stops or the size of the sensor changes, if
 * they have changed; without #GstEventHotPixel:learn, they are only read. It is a text file with
 * the column and row of a pixel in each line; those outside the sensor stay in it. For a camera,
 * learn once with the lens covered or in front of an even scene, and use that file from then on.
 *
 * Hot pixels belong to the sensor: they are kept through flushes, gaps, new segments, DISCONT and
 * where time goes back. The counts of the current period are forgotten after a flush and where time
 * goes back.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventhotpixel location=hot-pixels.txt
 * ! eventrender ! videoconvert ! autovideosink
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventhotpixel learn=false
 * location=hot-pixels.txt ! eventrender ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include <filesystem>
#include <iterator>
#include <vector>

#include "gst/base/element_type.hpp"
#include "gst/base/named_file.hpp"
#include "gst/base/properties.hpp"
#include "gst/filter/eventfilter.hpp"
#include "src/filter/hot_pixel_filter.hpp"

using namespace eventcamera;

namespace {

struct Settings : HotPixelFilter::Settings {
  std::string location;
};

/// Maximum size of a file, bytes: several million hot pixels.
constexpr std::size_t max_file_size = std::size_t{64} << 20;

void write_hot_pixels(const std::string& location, const std::vector<PixelPosition>& pixels) {
  try {
    write_bytes(location, pixel_list_text(pixels));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error("cannot write the hot pixels \"" + location + "\": " + error.what());
  }
}

class HotPixels final : public EventFilterOf<HotPixelFilter, Settings> {
 public:
  void start(SensorSize in, SensorSize out) override {
    stop();
    const Settings now = settings.copy();
    std::vector<PixelPosition> pixels;
    if (!now.location.empty() && !(now.learn && !std::filesystem::exists(now.location)))
      pixels = read_named_file("the hot pixels", now.location, max_file_size, parse_pixel_list);
    // After the file: one that cannot be read must not be replaced on stop.
    EventFilterOf::start(in, out);
    outside_.clear();
    std::ranges::copy_if(pixels, std::back_inserter(outside_), [in](const PixelPosition& pixel) {
      return pixel.x >= in.width || pixel.y >= in.height;
    });
    core_->set_hot_pixels(std::move(pixels));
    read_ = core_->hot_pixels();
  }

  void stop() override {
    if (!core_) return;
    auto pixels = core_->hot_pixels();
    EventFilterOf::stop();  // even if the file cannot be written
    const Settings now = settings.copy();
    if (!now.learn || now.location.empty() ||
        (pixels == read_ && std::filesystem::exists(now.location)))
      return;
    pixels.insert(pixels.end(), outside_.begin(), outside_.end());
    write_hot_pixels(now.location, pixels);
  }

 private:
  // Contents of the file:
  std::vector<PixelPosition> read_;     ///< hot pixels of the sensor
  std::vector<PixelPosition> outside_;  ///< of a larger sensor; kept in the file
};

}  // namespace

DEFINE_EVENT_FILTER(GstEventHotPixel, gst_event_hot_pixel, EVENT_HOT_PIXEL, HotPixels,
                    eventhotpixel)

static void gst_event_hot_pixel_class_init(GstEventHotPixelClass* klass) {
  Properties<gst_event_hot_pixel_settings> properties(G_OBJECT_CLASS(klass));
  properties.add_fixed(&Settings::location, "location",
                       "Text file of hot pixels, read at the start and, with learn, written on "
                       "stop if they have changed");
  properties.add(&Settings::learn, "learn",
                 "Detect hot pixels; if false, use only those in location");
  properties.add(&Settings::learning_period, "learning-period",
                 "Time after which hot pixels are detected again (ns)", GST_MSECOND,
                 3600 * GST_SECOND);
  properties.add(&Settings::min_rate, "min-rate", "Minimum event rate of a hot pixel (events/s)", 0,
                 1e6);
  properties.add(&Settings::ratio, "ratio",
                 "Minimum event rate of a hot pixel, as a multiple of the median of its neighbours",
                 1, 1e6);
  set_metadata(klass, "Hot pixel filter", "Filter", "Drops the events of hot pixels");
}
