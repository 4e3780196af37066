// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_grid.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>

#include "base/cancel_check.hpp"
#include "base/error.hpp"
#include "mpm/grid_alignment.hpp"
#include "mpm/spline_weights.hpp"

namespace matterfit::mpm {
namespace {

struct Before {
  bool operator()(const Vec3i& a, const Vec3i& b) const { return before(a, b); }
};

std::uint32_t find(const std::vector<Vec3i>& sorted, const Vec3i& value) {
  const auto place = std::lower_bound(sorted.begin(), sorted.end(), value, before);
  if (place == sorted.end() || *place != value) return kNoBlock;
  return static_cast<std::uint32_t>(place - sorted.begin());
}

Vec3i corner(int k) { return {k / 4, (k / 2) % 2, k % 2}; }

Vec3i floor_divide(const Vec3i& v) { return {v[0] >> 2, v[1] >> 2, v[2] >> 2}; }

/// Where along the lattice the grid's nodes lie, in cells: a pinned plane, or else the body's
/// lowest face, is the boundary of a cell (half way between two nodes), so that outer cells are
/// full. Half a cell at a clamp either locks (its mean dilatation on its own) or gives
/// (docs/why.md).
Vec3d grid_phase(const Body& body, double dx, const Mat3d& axes, const Vec3d& origin,
                 const Points& rest) {
  Vec3d low = rest.front();
  for (const Vec3d& x : rest) low = low.cwiseMin(x);
  const double half = body.lattice.regular ? 0.5 * body.lattice.spacing : 0.25 * dx;
  Vec3d phase;
  for (int axis = 0; axis < 3; ++axis) phase[axis] = (low[axis] - half) / dx - 0.5;
  for (const Pin& pin : body.pins) {
    if (const std::optional<int> axis = held_axis(pin, axes)) {
      phase[*axis] = (axes.transpose() * (pin.point - origin))[*axis] / dx - 0.5;
    }
  }
  // The lowest cell is cell 0, so that a small body touches as few blocks as it can.
  for (int axis = 0; axis < 3; ++axis) {
    phase[axis] += std::floor(low[axis] / dx - phase[axis] - 0.5 + 1e-9);
  }
  return phase;
}

}  // namespace

TotalGrid::TotalGrid(const Body& body, const Scene& scene, const Interrupter* interrupter)
    : dx_(scene.dx),
      axes_(body.lattice.axes.normalized().toRotationMatrix()),
      origin_(body.lattice.origin),
      volumes_(body.volumes) {
  rest_.reserve(body.rest.size());
  for (const Vec3d& x : body.rest) rest_.push_back(to_local(x));
  // A shifted grid starts a cell lower.
  phase_ = grid_phase(body, dx_, axes_, origin_, rest_) + scene.grid_shift -
           scene.grid_shift.cwiseSign().cwiseAbs();
  for (std::size_t p = 0; p < rest_.size(); ++p) {
    for (int axis = 0; axis < 3; ++axis) {
      if (std::abs(node_coordinate(rest_[p], axis)) < 1e8) continue;
      throw_input("Body '" + body.name + "': particle " + std::to_string(p) +
                  " is too far from the others for this particle separation. Is the unit right?");
    }
  }
  check_cancel(interrupter);
  find_surface(body.lattice);
  check_cancel(interrupter);
  index_skin(body.skin);
  check_cancel(interrupter);
  Points coordinates(rest_.size());
  for (std::size_t p = 0; p < rest_.size(); ++p) {
    for (int axis = 0; axis < 3; ++axis) coordinates[p][axis] = node_coordinate(rest_[p], axis);
  }
  const double edge = body.lattice.regular ? body.lattice.spacing / dx_ : 0.0;
  quadrature_ = cell_quadrature(coordinates, volumes_, edge);
  check_cancel(interrupter);
  place_points();
  check_cancel(interrupter);
  link_blocks();
  lump_mass(body.density);
}

std::pair<Vec3i, Vec3d> TotalGrid::cell(const Vec3d& local) const {
  Vec3i base;
  Vec3d f;
  for (int axis = 0; axis < 3; ++axis) {
    const double x = node_coordinate(local, axis);
    base[axis] = static_cast<int>(std::floor(x - 0.5));
    f[axis] = x - base[axis];
  }
  return {base, f};
}

CellPoint TotalGrid::point_in(std::uint32_t particle, const Vec3d& local) const {
  const Vec3i own = quadrature_.cells[particle];
  Vec3i base = cell(local).first;
  if (base != own) base = quadrature_.cell_at(base, own);
  std::uint32_t block = particle_block_[particle];
  const Vec3i at = floor_divide(base);
  if (at != block_coordinates_[block]) block = find(block_coordinates_, at);
  return point_in_cell(block, base, local);
}

CellPoint TotalGrid::point_of(std::uint32_t particle) const {
  return point_in_cell(particle_block_[particle], quadrature_.cells[particle], rest_[particle]);
}

CellPoint TotalGrid::point_in_cell(std::uint32_t block, const Vec3i& cell,
                                   const Vec3d& local) const {
  const Vec3i c = cell - 4 * block_coordinates_[block];
  CellPoint point{block, static_cast<std::size_t>(c[0]), static_cast<std::size_t>(c[1]),
                  static_cast<std::size_t>(c[2]), Vec3d::Zero()};
  for (int axis = 0; axis < 3; ++axis) point.f[axis] = node_coordinate(local, axis) - cell[axis];
  return point;
}

void TotalGrid::place_points() {
  const std::vector<QuadraturePoint>& points = quadrature_.points;
  std::set<Vec3i, Before> coordinates;
  for (const QuadraturePoint& q : points) coordinates.insert(floor_divide(q.cell));
  block_coordinates_.assign(coordinates.begin(), coordinates.end());
  particle_block_.resize(rest_.size());
  block_particles_.resize(block_coordinates_.size());
  for (std::size_t p = 0; p < rest_.size(); ++p) {
    particle_block_[p] = find(block_coordinates_, floor_divide(quadrature_.cells[p]));
    block_particles_[particle_block_[p]].push_back(static_cast<std::uint32_t>(p));
  }
  std::vector<std::vector<std::uint32_t>> block_points(block_coordinates_.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    block_points[find(block_coordinates_, floor_divide(points[i].cell))].push_back(i);
  }
  place_.resize(points.size());
  slab_chunks_.assign(1, 0);
  for (std::size_t b = 0; b < block_coordinates_.size(); ++b) {
    std::array<std::array<std::uint32_t, kLanes>, kSlabs> filled{};
    std::vector<std::uint32_t> slot(block_points[b].size());
    for (std::size_t i = 0; i < slot.size(); ++i) {
      const Vec3i c = points[block_points[b][i]].cell - 4 * block_coordinates_[b];
      const int cell_lane = 4 * c[1] + c[2];
      slot[i] = filled[static_cast<std::size_t>(c[0])][static_cast<std::size_t>(cell_lane)]++;
    }
    const std::size_t first_slab = slab_chunks_.size() - 1;
    for (const auto& cells : filled) {
      slab_chunks_.push_back(slab_chunks_.back() + *std::max_element(cells.begin(), cells.end()));
    }
    for (std::size_t i = 0; i < slot.size(); ++i) {
      const std::uint32_t q = block_points[b][i];
      const Vec3i c = points[q].cell - 4 * block_coordinates_[b];
      const std::uint32_t chunk =
          slab_chunks_[first_slab + static_cast<std::size_t>(c[0])] + slot[i];
      place_[q] =
          chunk * static_cast<std::uint32_t>(kLanes) + static_cast<std::uint32_t>(4 * c[1] + c[2]);
    }
  }
}

void TotalGrid::link_blocks() {
  std::set<Vec3i, Before> coordinates;
  for (const Vec3i& b : block_coordinates_) {
    for (int k = 0; k < 8; ++k) coordinates.insert(b + corner(k));
  }
  node_block_coordinates_.assign(coordinates.begin(), coordinates.end());
  block_nodes_.resize(block_coordinates_.size());
  node_sources_.resize(node_block_coordinates_.size());
  for (std::size_t b = 0; b < block_coordinates_.size(); ++b) {
    for (int k = 0; k < 8; ++k) {
      block_nodes_[b][static_cast<std::size_t>(k)] =
          find(node_block_coordinates_, block_coordinates_[b] + corner(k));
    }
  }
  for (std::size_t n = 0; n < node_block_coordinates_.size(); ++n) {
    for (int k = 0; k < 8; ++k) {
      node_sources_[n][static_cast<std::size_t>(k)] =
          find(block_coordinates_, node_block_coordinates_[n] - corner(k));
    }
  }
}

void TotalGrid::find_surface(const Lattice& lattice) {
  surface_.assign(rest_.size(), 1);
  if (!lattice.regular || !(lattice.spacing > 0.0)) return;
  std::vector<Vec3i> places(rest_.size());
  for (std::size_t p = 0; p < rest_.size(); ++p) {
    for (int axis = 0; axis < 3; ++axis) {
      places[p][axis] = static_cast<int>(std::floor(rest_[p][axis] / lattice.spacing));
    }
  }
  std::vector<Vec3i> sorted = places;
  std::sort(sorted.begin(), sorted.end(), before);
  for (std::size_t p = 0; p < rest_.size(); ++p) {
    bool open = false;
    for (int axis = 0; axis < 3; ++axis) {
      for (const int step : {-1, 1}) {
        Vec3i next = places[p];
        next[axis] += step;
        open = open || !std::binary_search(sorted.begin(), sorted.end(), next, before);
      }
    }
    surface_[p] = open ? 1 : 0;
  }
}

void TotalGrid::lump_mass(double density) {
  lumped_mass_.assign(node_blocks() * kBlockNodes, 0.0);
  NodesOfCell nodes_of(*this);
  for (const QuadraturePoint& q : quadrature_.points) {
    const std::array<std::uint32_t, 27>& nodes = nodes_of(q.cell);
    double w[3][3];
    for (int axis = 0; axis < 3; ++axis) quadratic_weights(q.f[axis], w[axis]);
    const double m = density * q.volume;
    for (std::size_t i = 0; i < 27; ++i) {
      lumped_mass_[nodes[i]] += m * w[0][i / 9] * w[1][i / 3 % 3] * w[2][i % 3];
    }
  }
  center_.setZero();
  for (std::uint32_t p = 0; p < rest_.size(); ++p) {
    const double m = density * volumes_[p];
    total_mass_ += m;
    center_ += m * rest_[p];
  }
  center_ /= total_mass_;
  raise_light_nodes(density);
  inverse_mass_.resize(mass_.size());
  for (std::size_t n = 0; n < mass_.size(); ++n) {
    inverse_mass_[n] = mass_[n] > 0.0 ? 1.0 / mass_[n] : 0.0;
  }
}

Vec3d TotalGrid::outward_normal(std::uint32_t particle) const {
  const Vec3i base = quadrature_.cells[particle];
  Vec3d f;
  for (int axis = 0; axis < 3; ++axis) {
    f[axis] = node_coordinate(rest_[particle], axis) - base[axis];
  }
  Vec3d gradient = Vec3d::Zero();
  for (int i = 0; i < 27; ++i) {
    const Vec3i step(i / 9, i / 3 % 3, i % 3);
    Vec3d w;
    Vec3d g;
    for (int axis = 0; axis < 3; ++axis) {
      const double d = f[axis] - step[axis];
      w[axis] = std::abs(d) < 0.5 ? 0.75 - d * d : 0.5 * (1.5 - std::abs(d)) * (1.5 - std::abs(d));
      g[axis] = std::abs(d) < 0.5 ? -2.0 * d : (d > 0 ? d - 1.5 : d + 1.5);
    }
    gradient += mass_[find_node(base + step)] *
                Vec3d(g[0] * w[1] * w[2], w[0] * g[1] * w[2], w[0] * w[1] * g[2]);
  }
  const double length = gradient.norm();
  return length > 0.0 ? Vec3d(-gradient / length) : Vec3d::UnitZ();
}

Vec3i TotalGrid::node_coordinates(std::uint32_t node) const {
  const auto n = static_cast<int>(node % kBlockNodes);
  return 4 * node_block_coordinates_[node / kBlockNodes] + Vec3i(n / 16, (n / 4) % 4, n % 4);
}

Vec3d TotalGrid::node_position(std::uint32_t node) const {
  return (node_coordinates(node).cast<double>() + phase_) * dx_;
}

std::uint32_t TotalGrid::find_block(const Vec3i& coordinates) const {
  return find(block_coordinates_, coordinates);
}

std::uint32_t TotalGrid::node_of_block(std::uint32_t block, const Vec3i& place) const {
  const Vec3i b = floor_divide(place);
  const Vec3i n = place - 4 * b;
  return block_nodes_[block][static_cast<std::size_t>(4 * b[0] + 2 * b[1] + b[2])] *
             static_cast<std::uint32_t>(kBlockNodes) +
         static_cast<std::uint32_t>((n[0] * 4 + n[1]) * 4 + n[2]);
}

std::uint32_t TotalGrid::find_node(const Vec3i& coordinates) const {
  const Vec3i b = floor_divide(coordinates);
  const std::uint32_t block = find(node_block_coordinates_, b);
  if (block == kNoBlock) return kNoBlock;
  const Vec3i n = coordinates - 4 * b;
  return block * static_cast<std::uint32_t>(kBlockNodes) +
         static_cast<std::uint32_t>((n[0] * 4 + n[1]) * 4 + n[2]);
}

const std::array<std::uint32_t, 27>& NodesOfCell::operator()(const Vec3i& cell) {
  if (cell == cell_) return nodes_;
  cell_ = cell;
  const Vec3i at = floor_divide(cell);
  if (at != at_) {
    at_ = at;
    block_ = grid_.find_block(at);
  }
  for (int i = 0; i < 27; ++i) {
    const Vec3i step(i / 9, i / 3 % 3, i % 3);
    nodes_[static_cast<std::size_t>(i)] = grid_.node_of_block(block_, cell + step - 4 * at);
  }
  return nodes_;
}

NodeWeights TotalGrid::point_weights(const Vec3d& local) const {
  const Vec3i middle = cell(local).first + Vec3i(1, 1, 1);
  const double full = 8.0 * total_mass_ / static_cast<double>(particles());
  for (int reach = 1; reach <= 8; ++reach) {
    std::vector<std::uint32_t> nodes;
    std::vector<double> theta;
    const double radius = (reach + 0.5) * dx_;
    for (int i = -reach; i <= reach; ++i)
      for (int j = -reach; j <= reach; ++j)
        for (int k = -reach; k <= reach; ++k) {
          const std::uint32_t node = find_node(middle + Vec3i(i, j, k));
          if (node == kNoBlock || mass_[node] < 1e-3 * full) continue;
          const double distance = (node_position(node) - local).norm() / radius;
          if (distance >= 1.0) continue;
          nodes.push_back(node);
          // A smooth bump, and less of what carries little mass.
          theta.push_back((1 - distance) * (1 - distance) * (1 - distance) * (3 * distance + 1) *
                          std::min(1.0, mass_[node] / full));
        }
    if (nodes.size() < 8) continue;
    Eigen::Matrix4d moment = Eigen::Matrix4d::Zero();
    std::vector<Eigen::Vector4d> basis(nodes.size());
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      const Vec3d d = (node_position(nodes[n]) - local) / dx_;
      basis[n] = Eigen::Vector4d(1.0, d[0], d[1], d[2]);
      moment += theta[n] * basis[n] * basis[n].transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(moment);
    if (solver.eigenvalues()[0] < 0.02 * solver.eigenvalues()[3] / (reach * reach)) continue;
    const Eigen::Vector4d row = moment.ldlt().solve(Eigen::Vector4d(1, 0, 0, 0));
    NodeWeights result;
    result.nodes = std::move(nodes);
    for (std::size_t n = 0; n < result.nodes.size(); ++n) {
      result.weights.push_back(theta[n] * row.dot(basis[n]));
    }
    return result;
  }
  throw_input(
      "A point at " + std::to_string(local[0]) + " " + std::to_string(local[1]) + " " +
      std::to_string(local[2]) +
      " (body axes, m) is too far from the body, or the body too thin there, to attach it.");
}

NodeWeights TotalGrid::field_weights(std::uint32_t particle, const Vec3d& local) const {
  const Vec3i base = quadrature_.cell_at(cell(local).first, quadrature_.cells[particle]);
  double w[3][3];
  for (int axis = 0; axis < 3; ++axis) {
    quadratic_weights(node_coordinate(local, axis) - base[axis], w[axis]);
  }
  NodeWeights result;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) {
        const std::uint32_t node = find_node(base + Vec3i(i, j, k));
        if (node == kNoBlock || !(mass_[node] > 0.0)) continue;
        result.nodes.push_back(node);
        result.weights.push_back(w[0][i] * w[1][j] * w[2][k]);
      }
  return result;
}

}  // namespace matterfit::mpm
