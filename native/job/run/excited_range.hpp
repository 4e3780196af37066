// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "job/documents/document.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {

/// The strains and rates that the bodies of a run go through, and whether these take a material
/// beyond what it was seen at when it was fitted (BodyDoc::excited): there its law is extrapolated.
class ExcitedRange {
 public:
  /// `all`: of bodies too that do not say what they were seen at.
  explicit ExcitedRange(const SceneDoc& scene, bool all = false);

  /// Some body is watched.
  [[nodiscard]] bool any() const;
  /// Frames in their order. What 95 % of each body's particles stay within: |dev ε| of the total
  /// strain, as far as the plastic strain shows it (its elastic part and √(3/2) of the
  /// equivalent plastic strain, which a flow back and forth makes too large); ln J; and |dev D|
  /// between this frame and the one before.
  void record(const mpm::FrameState& state);
  /// The most of a body up to a frame, which is what a fit to these frames has seen of its
  /// material; strains up to 2.5, volume strains up to 1.5. Nothing of a fluid, whose shape leaves
  /// no trace in F, and of a body that is not watched.
  [[nodiscard]] std::optional<material::Excitation> seen(const std::string& body,
                                                         double last_frame) const;
  /// A sentence each of the bodies that left it by more than a quarter (of ln J: and a hundredth),
  /// with the frame where they were farthest out.
  [[nodiscard]] std::vector<std::string> notes() const;

 private:
  struct Frame {
    int number = 0;
    double strain = 0.0;
    double compression = 0.0;
    double expansion = 0.0;
    double rate = 0.0;
    double middle_rate = 0.0;
  };
  struct Watched {
    std::size_t body = 0;
    std::string name;
    std::optional<material::Excitation> excited;
    bool fluid = false;  ///< of F only J is there
    std::vector<Mat3f> gradients;
    std::vector<float> plastic;
    std::vector<Frame> frames;
  };

  double frame_seconds_;
  std::vector<Watched> watched_;
};

}  // namespace matterfit::job
