// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/flow_kernels.hpp"

#include <gtest/gtest.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/LevelSetMeasure.h>

#include <cmath>
#include <random>

#include "bake/test_support.hpp"
#include "bake/volume.hpp"

namespace matterfit::bake {
namespace {

class FlowKernelsTest : public ::testing::Test {
 protected:
  /// Moves each particle of a body by up to `share` of a separation along each axis.
  static void shake(Specimen& body, double share) {
    std::mt19937 engine(7);
    std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
    const auto far = static_cast<float>(share * body.separation);
    for (Vec3f& position : body.positions) {
      for (int k = 0; k < 3; ++k) position[k] += far * uniform(engine);
    }
  }
  openvdb::FloatGrid::Ptr surface(const Specimen& body, bool flows, int threads = 2) {
    VolumeOptions options;
    options.density = false;
    options.surface = true;
    options.flows = flows;
    Arena arena(threads);
    const capture::ParticleView view = body.view();
    return openvdb::gridPtrCast<openvdb::FloatGrid>(
        make_volume({&view, 1}, options, arena, interrupter_)[0]);
  }
  Interrupter interrupter_;
};

/// The height at which a level set is crossed on the way from `inside` (z) up to a separation of 5
/// more, above (x, y).
double surface_height(const openvdb::FloatGrid& grid, double x, double y, double inside, double h) {
  const openvdb::tools::GridSampler<openvdb::FloatGrid, openvdb::tools::BoxSampler> sample(grid);
  double low = inside;
  double high = inside + 5.0 * h;
  for (int step = 0; step < 40; ++step) {
    const double middle = 0.5 * (low + high);
    (sample.wsSample(openvdb::Vec3d(x, y, middle)) < 0.0F ? low : high) = middle;
  }
  return low;
}

// Shaken by what a flow's particles have of disorder, a flat surface is half as rough as with the
// kernels of a solid, and lies within .3 of a separation of where it is.
TEST_F(FlowKernelsTest, AFlatSurfaceIsSmooth) {
  const double h = 0.02;
  Specimen body = lattice_body(h, 0.3, [](const Vec3d& x) { return x[2] < 0.0 && x[2] > -0.16; });
  shake(body, 0.4);
  double rough[2] = {0.0, 0.0};
  for (const bool flows : {false, true}) {
    const auto grid = surface(body, flows);
    double sum = 0.0;
    double squares = 0.0;
    constexpr int kSide = 40;
    for (int i = 0; i < kSide; ++i) {
      for (int j = 0; j < kSide; ++j) {
        const double z = surface_height(*grid, 0.2 * (2.0 * i / kSide - 1.0),
                                        0.2 * (2.0 * j / kSide - 1.0), -0.06, h);
        sum += z;
        squares += z * z;
      }
    }
    const double mean = sum / (kSide * kSide);
    rough[flows ? 1 : 0] = std::sqrt(squares / (kSide * kSide) - mean * mean) / h;
    RecordProperty(flows ? "mean_flow" : "mean", std::to_string(mean / h));
    EXPECT_NEAR(mean / h, 0.0, 0.3) << "flows " << flows;
  }
  RecordProperty("rough", std::to_string(rough[0]));
  RecordProperty("rough_flow", std::to_string(rough[1]));
  EXPECT_LT(rough[1], 0.5 * rough[0]);
}

// A sheet one particle thick, thinned by half again of its area: closed, where round droplets leave
// gaps.
TEST_F(FlowKernelsTest, AThinnedSheetCloses) {
  const double h = 0.02;
  Specimen body = lattice_body(h, 0.3, [&](const Vec3d& x) { return x[2] > 0.0 && x[2] < h; });
  body.move(Vec3d(1.25, 1.25, 1.0).asDiagonal(), Vec3d::Zero());
  for (Mat3f& gradient : body.deformation) gradient = Mat3f::Identity();  // all that a fluid keeps
  int gaps[2] = {0, 0};
  for (const bool flows : {false, true}) {
    const auto grid = surface(body, flows);
    const openvdb::tools::GridSampler<openvdb::FloatGrid, openvdb::tools::BoxSampler> sample(*grid);
    for (int i = 0; i < 100; ++i) {
      for (int j = 0; j < 100; ++j) {
        const openvdb::Vec3d x(0.25 * (i / 50.0 - 1.0), 0.25 * (j / 50.0 - 1.0), 0.5 * h);
        if (sample.wsSample(x) >= 0.0F) ++gaps[flows ? 1 : 0];
      }
    }
  }
  EXPECT_GT(gaps[0], 1000);
  EXPECT_EQ(gaps[1], 0);
}

// The volume of a ball and of drops is kept nearly; what is alone is as round as it was.
TEST_F(FlowKernelsTest, VolumesAreNearlyKept) {
  const double h = 0.02;
  Specimen body = ball(h, 0.2);
  shake(body, 0.4);
  const double volume = static_cast<double>(body.rest.size()) * h * h * h;
  const double found = openvdb::tools::levelSetVolume(*surface(body, true));
  RecordProperty("ball", std::to_string(found / volume));
  EXPECT_NEAR(found / volume, 1.0, 3.0 * 0.3 * h / 0.2);

  Specimen drops = lattice_body(h, h, [](const Vec3d&) { return true; });
  drops.move(Mat3d::Identity() * 10.0, Vec3d::Zero());  // eight particles, each by itself
  for (Mat3f& gradient : drops.deformation) gradient = Mat3f::Identity();
  EXPECT_FLOAT_EQ(static_cast<float>(openvdb::tools::levelSetVolume(*surface(drops, true))),
                  static_cast<float>(openvdb::tools::levelSetVolume(*surface(drops, false))));
}

// In the bulk kernels stay what they were; the bits are those of any number of threads.
TEST_F(FlowKernelsTest, TheBulkIsLeftAlone) {
  Specimen body = cube(0.02, 0.2);
  const capture::ParticleView view = body.view();
  Arena one(1);
  Arena three(3);
  const FlowKernels kernels = flow_kernels(view, one, interrupter_);
  const FlowKernels again = flow_kernels(view, three, interrupter_);
  int bulk = 0;
  for (std::size_t i = 0; i < view.size(); ++i) {
    EXPECT_TRUE(kernels.centres[i] == again.centres[i] && kernels.shapes[i] == again.shapes[i]);
    if (body.rest[i].cwiseAbs().maxCoeff() > 0.2 - 6.0 * 0.02) continue;
    ++bulk;
    EXPECT_LT((kernels.centres[i] - body.rest[i]).norm(), 1e-6);
    EXPECT_LT((kernels.shapes[i] - Mat3d::Identity()).norm(), 1e-5);
  }
  EXPECT_GT(bulk, 300);
}

TEST_F(FlowKernelsTest, IsCancelled) {
  Specimen body = cube(0.02, 0.1);
  const capture::ParticleView view = body.view();
  Arena arena(2);
  interrupter_.cancel();
  EXPECT_THROW((void)flow_kernels(view, arena, interrupter_), Error);
}

}  // namespace
}  // namespace matterfit::bake
