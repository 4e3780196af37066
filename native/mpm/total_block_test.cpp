// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_block.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <random>
#include <vector>

#include "mpm/total_body.hpp"

namespace matterfit::mpm {
namespace {

constexpr double kBlockH = 0.025;

/// Five blocks of cells long, turned, with random node displacements and velocities.
struct Bar {
  Scene scene;
  std::unique_ptr<TotalBody<double>> body;
  Bar() {
    scene.dx = 2.0 * kBlockH;
    Body bar;
    bar.name = "bar";
    bar.density = 1000.0;
    bar.formulation = Formulation::kTotal;
    bar.lattice.regular = true;
    bar.lattice.spacing = kBlockH;
    bar.lattice.axes = Quatd(Eigen::AngleAxisd(0.4, Vec3d(1, 2, 3).normalized()));
    for (int i = 0; i < 40; ++i)
      for (int j = 0; j < 4; ++j)
        for (int k = 0; k < 4; ++k) {
          bar.rest.emplace_back(bar.lattice.axes * (kBlockH * Vec3d(i + 0.5, j + 0.5, k + 0.5)));
          bar.volumes.push_back(kBlockH * kBlockH * kBlockH);
        }
    scene.bodies.push_back(bar);
    body = std::make_unique<TotalBody<double>>(scene.bodies[0], scene,
                                               kernels<double>(SimdTarget::kAuto));
    TotalState<double> state = body->record();
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform(-1e-3, 1e-3);
    for (double& u : state.displacement) u = uniform(random);
    for (double& v : state.velocity) v = uniform(random);
    body->restore(state);
  }
};

TEST(TotalBlock, TellsOfPointsHereAndElsewhereWhatTheBodyDoes) {
  const Bar bar;
  std::size_t here = 0;
  std::size_t elsewhere = 0;
  for (std::size_t b = 0; b < bar.body->blocks(); ++b) {
    const TotalBlock<double> block(*bar.body, b);
    for (std::uint32_t p = 0; p < bar.body->particles(); p += 7) {
      const auto place = bar.body->place(p, Vec3d(0.3 * kBlockH, -0.2 * kBlockH, 0.1 * kBlockH));
      ++(block.holds(place) ? here : elsewhere);
      const auto point = bar.body->point(place);
      const auto expected = bar.body->state(point);
      const auto found = block.state(place);
      EXPECT_LT((found.position - expected.position).norm(), 1e-15);
      EXPECT_LT((found.velocity - expected.velocity).norm(), 1e-16);
      const Mat3d f = bar.body->deformation_gradient(point);
      EXPECT_LT((block.deformation_gradient(place) - f).norm(), 1e-13);
    }
  }
  EXPECT_GT(here, 50U);
  EXPECT_GT(elsewhere, 50U);
}

TEST(BlockField, AddsTheTransposeOfWhatItTells) {
  const Bar bar;
  const TotalGrid& grid = bar.body->grid();
  const auto place = bar.body->place(77, Vec3d(0.3 * kBlockH, -0.2 * kBlockH, 0.1 * kBlockH));
  const std::size_t block = place.cell.block;
  BlockField field;
  field.gather(grid, block, bar.body->displacement().data());
  const BlockField::Stencil s(place.cell, grid.dx());
  const Vec3d value(0.3, -1.0, 2.0);
  const Mat3d rows = (Mat3d() << 1, -2, 3, 0.5, 4, -1, 2, 1, -3).finished();
  const double expected = value.dot(field.at(s)) + rows.cwiseProduct(field.gradient(s)).sum();

  BlockField bar_of;
  bar_of.clear();
  bar_of.add(s, value, rows);
  std::vector<double> nodes(grid.node_blocks() * kNodeBlock, 0.0);
  for (std::size_t b = 0; b < grid.node_blocks(); ++b) {
    for (std::size_t k = 0; k < 8; ++k) {
      if (grid.node_sources(b)[k] == block) bar_of.add_to(k, nodes.data() + b * kNodeBlock);
    }
  }
  double found = 0.0;
  for (std::size_t i = 0; i < nodes.size(); ++i) found += nodes[i] * bar.body->displacement()[i];
  EXPECT_NEAR(found, expected, 1e-12 * std::abs(expected));
}

}  // namespace
}  // namespace matterfit::mpm
