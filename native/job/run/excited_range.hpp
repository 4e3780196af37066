// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "job/documents/document.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {

/// Whether a run takes a material beyond what it was seen at when it was fitted
/// (BodyDoc::excited): there its law is extrapolated.
class ExcitedRange {
 public:
  explicit ExcitedRange(const SceneDoc& scene);

  /// Some body says what it was seen at.
  [[nodiscard]] bool any() const;
  /// Frames in their order. Of each body what 95 % of its particles stay within: |dev ε| of the
  /// total strain, as far as the plastic strain tells (its elastic part and √(3/2) of the
  /// equivalent plastic strain, which a flow back and forth makes too large); ln J; and |dev D|
  /// between this frame and the one before.
  void record(const mpm::FrameState& state);
  /// A sentence each of the bodies that left it by more than a quarter (of ln J: and a hundredth),
  /// with the frame where they were farthest out.
  [[nodiscard]] std::vector<std::string> notes() const;

 private:
  struct Most {
    double value = 0.0;
    int frame = 0;
  };
  struct Watched {
    std::size_t body = 0;
    std::string name;
    material::Excitation excited;
    bool fluid = false;  ///< of F only J is there
    std::vector<Mat3f> gradients;
    std::vector<float> plastic;
    Most strain;
    Most compression;
    Most expansion;
    Most rate;
  };

  double frame_seconds_;
  std::vector<Watched> watched_;
};

}  // namespace matterfit::job
