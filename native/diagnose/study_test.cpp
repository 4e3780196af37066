// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/study.hpp"

#include <gtest/gtest.h>

#include "diagnose/models_for_test.hpp"

namespace matterfit::diagnose {
namespace {

/// Two throws, of which each parameter moves one: it may say so.
class WindowedThrows : public ThrownModel {
 public:
  explicit WindowedThrows(bool told)
      : ThrownModel({Vec3d(3.0, 0.0, 1.0), Vec3d(-2.0, 1.0, 2.0)}), told_(told) {}
  std::vector<std::optional<Window>> windows() const override {
    std::vector<std::optional<Window>> result(parameters().size());
    for (std::size_t p = 0; p < result.size() && told_; ++p) {
      const int capture = own_capture()[p];
      result[p] = Window{capture, capture + 1, -1e300, 1e300};
    }
    return result;
  }

 private:
  bool told_;
};

TEST(Study, ParametersThatMoveNoSampleTogetherShareTheirRuns) {
  std::vector<Linearised> both;
  std::vector<int> runs;
  for (const bool told : {false, true}) {
    WindowedThrows model(told);
    model.record({}, {});
    const Study study(model, 1000000);
    both.push_back(linearise(study, study.fitted(), {}, {}));
    runs.push_back(study.runs());
  }
  // The state, and two sides of six parameters or of three pairs.
  EXPECT_EQ(runs[0], 13);
  EXPECT_EQ(runs[1], 7);
  EXPECT_LT((both[0].theta - both[1].theta).norm(), 1e-9 * both[0].theta.norm());
}

/// Samples outside of a parameter's window are moved by others of its group.
TEST(Study, AColumnIsZeroOutsideOfItsWindow) {
  WindowedThrows model(true);
  model.record({}, {});
  const Study study(model, 1000000);
  const Linearised lin = linearise(study, study.fitted(), {}, {});
  for (const Series& series : study.used().series()) {
    const auto rows = Eigen::seqN(series.begin, series.end - series.begin);
    const Eigen::Index other = series.capture == 0 ? 3 : 0;
    EXPECT_EQ(lin.theta(rows, Eigen::seqN(other, 3)).norm(), 0.0);
  }
}

}  // namespace
}  // namespace matterfit::diagnose
