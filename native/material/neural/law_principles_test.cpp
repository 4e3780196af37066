// SPDX-License-Identifier: GPL-3.0-or-later
// What a law must keep whatever its weights, of ours and of the published one as it is: torque,
// isotropy, and the work of closed cycles.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/random.hpp"
#include "material/classical/point_law.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/pretrain.hpp"
#include "material/neural/published_file.hpp"
#include "material/neural/published_law.hpp"

namespace matterfit::material {
namespace {

/// Kirchhoff stress after F ← step F.
using Follow = std::function<Mat3d(const Mat3d& step, PointState& state)>;

Mat3d any_matrix(Random& random) {
  Mat3d m;
  for (int i = 0; i < 9; ++i) m(i) = random.between(-1.0, 1.0);
  return m;
}

Mat3d any_rotation(Random& random) {
  Eigen::HouseholderQR<Mat3d> qr(any_matrix(random));
  Mat3d q = qr.householderQ();
  if (q.determinant() < 0.0) q.col(0) *= -1.0;
  return q;
}

/// Q diag(e^ε) Rᵀ, |ε| as pre-training samples it.
Mat3d any_strained(Random& random) {
  const Vec3d along(random.between(-1.0, 1.0), random.between(-1.0, 1.0),
                    random.between(-1.0, 1.0));
  const Vec3d strain = along.normalized() * 0.4 * std::pow(random.uniform(), 1.5);
  return any_rotation(random) * Mat3d(Vec3d(strain.array().exp()).asDiagonal()) *
         any_rotation(random).transpose();
}

struct Kept {
  double torque = 0.0;     ///< mean |τ − τᵀ|/|τ|
  double direction = 0.0;  ///< mean |τ(F Q) − τ(F)| by the larger of them
  double least = 1e300;    ///< work of the worst cycle by the largest energy on the way
  double cycles = 0.0;     ///< share of cycles that give energy
};

/// Work [J/m³] of the second round of a closed way in F, and the largest of the first.
std::pair<double, double> cycle(const Follow& law, const Mat3d& a, const Mat3d& b, double size) {
  constexpr int kRound = 400;
  PointState state;
  Mat3d total = Mat3d::Identity();
  Mat3d before = Mat3d::Zero();
  double work = 0.0;
  double most = 0.0;
  double at_round = 0.0;
  for (int n = 1; n <= 2 * kRound; ++n) {
    const double phase = 2.0 * M_PI * n / kRound;
    const Mat3d f = Mat3d::Identity() + size * (std::sin(phase) * a + (1.0 - std::cos(phase)) * b);
    const Mat3d step = f * total.inverse();
    const Mat3d tau = law(step, state);
    const Mat3d middle = 0.5 * (f + total);
    work += (0.5 * (tau + before)).cwiseProduct((f - total) * middle.inverse()).sum();
    if (n <= kRound) most = std::max(most, work);
    if (n == kRound) at_round = work;
    before = tau;
    total = f;
  }
  return {work - at_round, most};
}

Kept kept(const Follow& law) {
  Random random(3);
  Kept found;
  double states = 0.0;
  for (int i = 0; i < 200; ++i) {
    const Mat3d f = any_strained(random);
    PointState one;
    PointState other;
    const Mat3d tau = law(f, one);
    const Mat3d turned = law(f * any_rotation(random), other);
    if (tau.norm() == 0.0) continue;  // sand that is pulled
    found.torque += (tau - tau.transpose()).norm() / tau.norm();
    found.direction += (turned - tau).norm() / std::max(turned.norm(), tau.norm());
    states += 1.0;
  }
  found.torque /= states;
  found.direction /= states;
  constexpr int kCycles = 20;
  for (int i = 0; i < kCycles; ++i) {
    const Mat3d a = any_matrix(random);
    const Mat3d b = any_matrix(random);
    const auto [work, most] = cycle(law, a, b, 0.12);
    found.least = std::min(found.least, work / most);
    if (work < -1e-4 * most) found.cycles += 1.0 / kCycles;
  }
  return found;
}

std::string words(const Kept& k) {
  return "torque " + std::to_string(k.torque) + ", direction " + std::to_string(k.direction) +
         ", worst cycle " + std::to_string(k.least) + ", cycles that give energy " +
         std::to_string(k.cycles);
}

TEST(LawPrinciples, OursKeepThemWhateverTheWeights) {
  for (const StartLaw start : kStartLaws) {
    Pretraining options;
    options.fit_samples = 200;
    const Material material = isotropic_material(
        with_directions("made", pretrain_isotropic(start_material(start), options), 1));
    const PointLaw law(material, 1e-3);
    const Kept found =
        kept([&](const Mat3d& step, PointState& state) { return law.advance(step, state); });
    RecordProperty(std::string(start_law_name(start)), words(found));
    EXPECT_LT(found.torque, 1e-12);
    EXPECT_LT(found.direction, 1e-8);
    EXPECT_GT(found.least, -1e-4);
    EXPECT_EQ(found.cycles, 0.0);
  }
}

TEST(LawPrinciples, ThePublishedOneDoesNot) {
  const std::filesystem::path folder = std::filesystem::path(MATTERFIT_DATA_DIR) / "nclaw_weights";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not here";
  Arena arena(1);
  for (const std::string name : {"jelly", "plasticine", "sand"}) {
    const PublishedWeights weights = read_published_pt(folder / (name + "_0300.pt"));
    const Kept found = kept([&](const Mat3d& step, PointState& state) {
      using Rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
      const Rows trial = step * state.elastic;
      Rows elastic;
      Rows tau;
      published_forward<double>(weights, GeluMode::kExact, {trial.data(), 9}, {elastic.data(), 9},
                                {tau.data(), 9}, arena);
      state.elastic = elastic;
      return Mat3d(tau);
    });
    RecordProperty(name, words(found));
    EXPECT_GT(found.torque, 1e-4) << name;
    EXPECT_GT(found.direction, 1e-3) << name;
  }
}

}  // namespace
}  // namespace matterfit::material
