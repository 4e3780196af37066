// SPDX-License-Identifier: GPL-3.0-or-later
// What it takes to add an effect: this file alone, with a term that exists nowhere else.
#include <gtest/gtest.h>

#include "mpm/terms_for_test.hpp"

namespace matterfit::mpm {
namespace {

/// A constant force per volume [N/m³] on every second half of a body, by the particles' numbers.
class HalfForce final : public effects::Term {
 public:
  explicit HalfForce(const effects::Effect& effect) : effect_(effect) {}

  [[nodiscard]] Vec3d force(const effects::MaterialPoint& point,
                            const effects::Moment& moment) const override {
    return share(point) * effect_.vector_at(0, moment.time);
  }
  void force_adjoint(const effects::MaterialPoint& point, const effects::Moment& /*moment*/,
                     const Vec3d& force_bar, effects::MaterialPointBar& /*bar*/,
                     double* values) const override {
    for (std::size_t c = 0; c < 3; ++c) {
      values[c] += share(point) * force_bar[static_cast<int>(c)];
    }
  }
  [[nodiscard]] double acceleration_bound(double /*speed*/) const override { return 100.0; }

 private:
  [[nodiscard]] static double share(const effects::MaterialPoint& point) {
    return point.particle < 48 ? point.volume : 0.0;
  }
  const effects::Effect& effect_;
};

const effects::EffectType& half_force() {
  static const effects::EffectType row = {
      .name = "half_force",
      .parameters = {{.key = "force",
                      .unit = "N/m³",
                      .size = 3,
                      .standard = {0.0, 0.0, 0.0},
                      .neutral = 0.0,
                      .low = -1e6,
                      .high = 1e6,
                      .label = "Force",
                      .sentence = "On half of the body"}},
      .quantities = {},
      .signature = "Half of the body goes one way",
      .confused_with = {},
      .sentence = "A force on half of a body",
      .make = [](const effects::Effect& effect, const effects::BodyFacts& /*body*/)
          -> std::unique_ptr<effects::Term> { return std::make_unique<HalfForce>(effect); }};
  return row;
}

class AddedTerm : public ::testing::TestWithParam<Formulation> {};

TEST_P(AddedTerm, ActsAndHasItsDerivatives) {
  const TermCase run(GetParam(), {{&half_force(), "half", "bar", {3e4, -2e4, 5e4}, {}}});
  const TermCase without(GetParam(), {});
  EXPECT_GT(std::abs(run.loss({}) - without.loss({})), 1e-3);
  expect_gradient(run);
}

INSTANTIATE_TEST_SUITE_P(Formulations, AddedTerm,
                         ::testing::Values(Formulation::kTotal, Formulation::kUpdated),
                         [](const auto& info) {
                           return info.param == Formulation::kTotal ? "total" : "updated";
                         });

}  // namespace
}  // namespace matterfit::mpm
