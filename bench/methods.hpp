// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "bench/plain/dense.hpp"
#include "bench/plain/diff.hpp"
#include "bench/plain/dvs.hpp"
#include "bench/plain/frame.hpp"
#include "bench/plain/sparse.hpp"
#include "src/dvs/dvs_simulator.hpp"
#include "src/simulate/dense.hpp"
#include "src/simulate/diff.hpp"
#include "src/simulate/frame.hpp"
#include "src/simulate/sparse.hpp"

namespace bench {

using namespace eventcamera;

using MakeSimulator = std::function<std::unique_ptr<Simulator>(const LumaFormat&)>;

/// A method in both formulations, plain and optimized.
struct Method {
  std::string name;
  double threshold;
  MakeSimulator plain;
  MakeSimulator ours;
};

template <class PlainSimulator, class... Arguments>
MakeSimulator make_plain(const Arguments&... arguments) {
  return [=](const LumaFormat& format) {
    return std::make_unique<PlainSimulator>(format, arguments...);
  };
}

inline Method dense_method(const std::string& name, FlowMethod flow) {
  return {name, 3, make_plain<plain::DenseSimulator>(flow), [flow](const LumaFormat& format) {
            auto simulator = make_dense_simulator(format);
            simulator->set_flow(flow);
            return simulator;
          }};
}

/// Thresholds are those of the settings.
inline Method dvs_method(const std::string& name, const DvsSettings& settings) {
  return {name, 0, make_plain<plain::DvsSimulator>(settings), [settings](const auto& format) {
            auto simulator = make_dvs_simulator(format);
            simulator->set(settings);
            return simulator;
          }};
}

inline const Method frame_method{"frame", 20, make_plain<plain::FrameSimulator>(),
                                 make_frame_simulator};
inline const Method dis_lq_method = dense_method("dense-dis-lq", FlowMethod::dis_lq);
inline const Method dis_hq_method = dense_method("dense-dis-hq", FlowMethod::dis_hq);
inline const Method farneback_method = dense_method("dense-farneback", FlowMethod::farneback);
inline const Method sparse_method{"sparse", 6, make_plain<plain::SparseSimulator>(),
                                  make_sparse_simulator};
inline const Method diff_method{"diff", 19, make_plain<plain::DiffSimulator>(),
                                make_diff_simulator};
inline const Method dvs_ideal_method = dvs_method("dvs-ideal", settings_of(DvsPreset::ideal));
inline const Method dvs_denoised_method = dvs_method("dvs-denoised", {.denoise = 8});
inline const Method dvs_noisy_method =
    dvs_method("dvs-v2e-noisy", settings_of(DvsPreset::v2e_noisy));
inline const Method dvs_motion_method =
    dvs_method("dvs-motion", {.upsampling = Upsampling::motion});

}  // namespace bench
