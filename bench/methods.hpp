// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "src/dvs/dvs_simulator.hpp"
#include "src/simulate/simulators.hpp"

namespace bench {

using namespace eventcamera;

using MakeSimulator = std::function<std::unique_ptr<Simulator>(const LumaFormat&)>;

struct Method {
  std::string name;
  double threshold;
  MakeSimulator make;
};

inline Method dense_method(const std::string& name, FlowMethod flow) {
  return {name, 3, [flow](const LumaFormat& format) {
            auto simulator = make_dense_simulator(format);
            simulator->set_flow(flow);
            return simulator;
          }};
}

/// The settings have the thresholds.
inline Method dvs_method(const std::string& name, const DvsSettings& settings) {
  return {name, 0, [settings](const auto& format) {
            auto simulator = make_dvs_simulator(format);
            simulator->set(settings);
            return simulator;
          }};
}

inline const Method frame_method{"frame", 20, make_frame_simulator};
inline const Method dis_lq_method = dense_method("dense-dis-lq", FlowMethod::dis_lq);
inline const Method dis_hq_method = dense_method("dense-dis-hq", FlowMethod::dis_hq);
inline const Method opencv_dis_method = dense_method("dense-opencv-dis", FlowMethod::opencv_dis);
inline const Method farneback_method = dense_method("dense-farneback", FlowMethod::farneback);
inline const Method sparse_method{"sparse", 6, make_sparse_simulator};
inline const Method diff_method{"diff", 19, make_diff_simulator};

/// All methods, with multiples of their usual thresholds.
inline std::vector<Method> all_methods(double threshold_factor = 1) {
  std::vector<Method> methods{frame_method,     dis_lq_method, dis_hq_method,
                              farneback_method, sparse_method, diff_method};
  for (auto& method : methods) method.threshold *= threshold_factor;
  const std::pair<const char*, DvsSettings> arrays[] = {
      {"dvs-ideal", settings_of(DvsPreset::ideal)},
      {"dvs-denoised", {.denoise = 8}},
      {"dvs-v2e-noisy", settings_of(DvsPreset::v2e_noisy)},
      {"dvs-motion", {.upsampling = Upsampling::motion}},
      {"dvs", settings_of(DvsPreset::standard)},
  };
  for (auto [name, settings] : arrays) {
    settings.positive_threshold *= threshold_factor;
    settings.negative_threshold *= threshold_factor;
    methods.push_back(dvs_method(name, settings));
  }
  return methods;
}

}  // namespace bench
