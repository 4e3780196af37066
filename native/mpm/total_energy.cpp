// SPDX-License-Identifier: GPL-3.0-or-later
// What a total Lagrangian body's energy is made of.
#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "material/classical/elastic_energy.hpp"
#include "mpm/total_body.hpp"
#include "mpm/total_stencil.hpp"

namespace matterfit::mpm {
template <class S>
double TotalBody<S>::elastic_energy(Arena& arena, double dt) const {
  std::vector<double> shape(displacement_.size());
  for (std::size_t i = 0; i < shape.size(); ++i) {
    shape[i] = displacement_[i] - 0.5 * dt * velocity_[i];
  }
  const std::vector<QuadraturePoint>& points = grid_.quadrature();
  std::vector<std::size_t> cells;  // the first point of each, and the end
  for (std::size_t q = 0; q < points.size(); ++q) {
    if (q == 0 || points[q].cell != points[q - 1].cell) cells.push_back(q);
  }
  cells.push_back(points.size());
  const material::LawConstants<double>& law = energy_law_;
  std::vector<double> energies(cells.size() - 1);
  arena.parallel_for(0, energies.size(), 64, [&](std::size_t c) {
    NodesOfCell nodes_of(grid_);
    const std::array<std::uint32_t, 27>& nodes = nodes_of(points[cells[c]].cell);
    std::array<Vec3d, 27> values;
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = field_value(shape, nodes[i]);
    double volume = 0.0;
    double change = 0.0;
    double sum = 0.0;
    for (std::size_t q = cells[c]; q < cells[c + 1]; ++q) {
      const PointStencil s(points[q].f, grid_.dx());
      Mat3d f = Mat3d::Identity();
      for (int k = 0; k < 3; ++k)
        f.row(k) += gradient_of(s, [&](std::size_t n) { return values[n][k]; });
      const double j = f.determinant();
      volume += points[q].volume;
      change += points[q].volume * j;
      sum += points[q].volume * (material::shape_energy(law, f) + material::crush_energy(law, j));
      if (law_.own_volume) sum += points[q].volume * material::volume_energy(law, j);
    }
    if (!law_.own_volume) sum += volume * material::volume_energy(law, change / volume);
    energies[c] = sum;
  });
  double energy = 0.0;
  for (const double of_cell : energies) energy += of_cell;
  if (!ties_) return energy;
  double pull[kNodeBlock];
  for (std::size_t b = 0; b < grid_.node_blocks(); ++b) {
    std::fill(pull, pull + kNodeBlock, 0.0);
    ties_->add_forces(b, law.mu, shape.data(), pull);
    for (std::size_t i = 0; i < kNodeBlock; ++i)
      energy -= 0.5 * pull[i] * shape[b * kNodeBlock + i];
  }
  return energy;
}

template <class S>
Vec3d TotalBody<S>::mass_moment(double dt) const {
  Vec3d moment = Vec3d::Zero();
  for (std::uint32_t n = 0; n < grid_.mass().size(); ++n) {
    if (!(grid_.mass()[n] > 0.0)) continue;
    const Vec3d now = field_value(displacement_, n) - 0.5 * dt * field_value(velocity_, n);
    moment += grid_.mass()[n] * grid_.to_world(grid_.node_position(n) + now);
  }
  return moment;
}

template double TotalBody<float>::elastic_energy(Arena&, double) const;
template double TotalBody<double>::elastic_energy(Arena&, double) const;
template Vec3d TotalBody<float>::mass_moment(double) const;
template Vec3d TotalBody<double>::mass_moment(double) const;

}  // namespace matterfit::mpm
