// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_pins.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <set>

#include "base/error.hpp"
#include "mpm/pin_region.hpp"
#include "mpm/total_stencil.hpp"

namespace matterfit::mpm {
namespace {

void merge(std::vector<std::uint32_t>& sorted, const std::vector<std::uint32_t>& more) {
  sorted.insert(sorted.end(), more.begin(), more.end());
  std::sort(sorted.begin(), sorted.end());
  sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
}

}  // namespace

TotalPins::TotalPins(const Body& body, const TotalGrid& grid) : grid_(grid) {
  for (std::size_t i = 0; i < body.pins.size(); ++i) {
    const Pin& pin = body.pins[i];
    Clamp clamp;
    clamp.pin = pin;
    bool done = false;
    if (pin.region == Pin::Region::kAll) {
      for (std::uint32_t n = 0; n < grid.mass().size(); ++n) {
        if (grid.mass()[n] > 0.0) clamp.prescribed.push_back(n);
      }
      done = true;
    } else if (pin.region == Pin::Region::kPlane) {
      const Vec3d normal = grid.axes().transpose() * pin.normal.normalized();
      for (int axis = 0; axis < 3 && !done; ++axis) {
        if (std::abs(std::abs(normal[axis]) - 1.0) > 1e-6) continue;
        const double at = grid.node_coordinate(grid.to_local(pin.point), axis);
        if (std::abs(at - std::floor(at) - 0.5) > 1e-6) continue;
        done = add_plane(clamp, axis, normal[axis] > 0 ? 1 : -1);
      }
    }
    if (!done) add_constraints(clamp, body);
    if (clamp.prescribed.empty() && clamp.mirrors.empty() && clamp.constraints.rows.empty()) {
      throw_input("Body '" + body.name + "': pin " + std::to_string(i) +
                  " holds no part of the body. Move its region onto the body.");
    }
    merge(nodes_, clamp.prescribed);
    for (const Mirror& m : clamp.mirrors) merge(nodes_, {m.free, m.ghost});
    for (const NodeWeights& row : clamp.constraints.rows) merge(nodes_, row.nodes);
    clamps_.push_back(std::move(clamp));
  }
  for (const AttachedMass& attached : body.masses) {
    Mass mass{grid.point_weights(grid.to_local(attached.position)), attached.mass, attached.attach};
    merge(nodes_, mass.weights.nodes);
    masses_.push_back(std::move(mass));
  }
  couple_masses();
  deferred_.assign(grid.mass().size(), 0);
  for (const std::uint32_t n : nodes_) deferred_[n] = 1;
}

void TotalPins::couple_masses() {
  std::stable_sort(masses_.begin(), masses_.end(),
                   [](const Mass& a, const Mass& b) { return a.attach < b.attach; });
  // Rows of W M^(−½).
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(masses_.size()),
                                               static_cast<Eigen::Index>(nodes_.size()));
  for (std::size_t k = 0; k < masses_.size(); ++k) {
    const NodeWeights& w = masses_[k].weights;
    for (std::size_t n = 0; n < w.nodes.size(); ++n) {
      const auto at = std::lower_bound(nodes_.begin(), nodes_.end(), w.nodes[n]) - nodes_.begin();
      rows(static_cast<Eigen::Index>(k), at) +=
          w.weights[n] * std::sqrt(grid_.inverse_mass()[w.nodes[n]]);
    }
  }
  for (std::size_t k = 0; k < masses_.size(); ++k) {
    if (k + 1 < masses_.size() && masses_[k + 1].attach == masses_[k].attach) continue;
    const auto count = static_cast<Eigen::Index>(k + 1);
    MassGroup group;
    group.count = k + 1;
    group.from = masses_[k].attach;
    group.compliance = rows.topRows(count) * rows.topRows(count).transpose();
    Eigen::MatrixXd system = group.compliance;
    for (Eigen::Index j = 0; j < count; ++j)
      system.col(j) *= masses_[static_cast<std::size_t>(j)].mass;
    system.diagonal().array() += 1.0;
    group.inverse = system.inverse();
    mass_groups_.push_back(std::move(group));
  }
}

bool TotalPins::add_plane(Clamp& clamp, int axis, int side) {
  const double plane = grid_.node_coordinate(grid_.to_local(clamp.pin.point), axis);
  const int behind = static_cast<int>(std::lround(plane - 0.5 * side));
  for (std::uint32_t p = 0; p < grid_.particles(); ++p) {
    if (side * (grid_.node_coordinate(grid_.rest(p), axis) - plane) < -1e-9) return false;
  }
  for (std::uint32_t n = 0; n < grid_.mass().size(); ++n) {
    Vec3i at = grid_.node_coordinates(n);
    if (!(grid_.mass()[n] > 0.0) || at[axis] != behind) continue;
    at[axis] += side;
    clamp.mirrors.push_back({grid_.find_node(at), n});
  }
  return true;
}

void TotalPins::add_constraints(Clamp& clamp, const Body& body) {
  // Candidates: points of the region's surface that lie in the body, first, because they are the
  // clamp; then the particles inside, which hold the rest of the region.
  const double near = 0.5 * grid_.dx();
  struct Candidate {
    std::uint32_t particle;  ///< in whose cell it lies, or nearly
    Vec3d point;
  };
  std::vector<Candidate> surface;
  std::vector<Candidate> inside;
  for (std::uint32_t p = 0; p < body.rest.size(); ++p) {
    const auto [d, nearest] = region_distance(clamp.pin, body.rest[p]);
    if (std::abs(d) <= near && clamp.pin.region != Pin::Region::kPoints) {
      surface.push_back({p, grid_.to_local(nearest)});
    }
    if (d <= 0.0) inside.push_back({p, grid_.to_local(body.rest[p])});
  }
  if (inside.empty() && surface.empty()) return;
  // One candidate a half cell is plenty: nodes are a cell apart.
  std::vector<Candidate> candidates;
  std::set<std::tuple<long, long, long>> seen;
  for (const std::vector<Candidate>* group : {&surface, &inside}) {
    for (const Candidate& candidate : *group) {
      const Vec3d q = candidate.point / (0.45 * grid_.dx());
      if (seen.emplace(std::lround(q[0]), std::lround(q[1]), std::lround(q[2])).second) {
        candidates.push_back(candidate);
      }
    }
  }
  constexpr std::size_t kMost = 6000;
  if (candidates.size() > kMost) {
    throw_input("Body '" + body.name + "': a pin of " + std::to_string(candidates.size()) +
                " points is too large. Pin the plane or the whole body instead, or use a larger "
                "particle separation.");
  }
  // The body's own field, not the smoothed one of point_weights: that leaves the light nodes at the
  // surface free, and with them the clamp gives way by a tenth of a cantilever's frequency.
  std::vector<NodeWeights> rows;
  rows.reserve(candidates.size());
  for (const Candidate& c : candidates) rows.push_back(grid_.field_weights(c.particle, c.point));
  // Pivoted Cholesky of C M⁻¹ Cᵀ: keeps constraints that are independent of those kept already.
  std::vector<Eigen::VectorXd> dense;  // M^(−½) rows, on the nodes involved
  std::vector<std::uint32_t> nodes;
  for (const NodeWeights& row : rows) merge(nodes, row.nodes);
  const auto column = [&](std::uint32_t node) {
    return std::lower_bound(nodes.begin(), nodes.end(), node) - nodes.begin();
  };
  std::vector<Eigen::VectorXd> basis;
  std::vector<std::size_t> kept;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    Eigen::VectorXd v = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(nodes.size()));
    for (std::size_t n = 0; n < rows[r].nodes.size(); ++n) {
      v[column(rows[r].nodes[n])] +=
          rows[r].weights[n] * std::sqrt(grid_.inverse_mass()[rows[r].nodes[n]]);
    }
    Eigen::VectorXd rest = v;
    for (int pass = 0; pass < 2; ++pass) {
      for (const Eigen::VectorXd& b : basis) rest -= b.dot(rest) * b;
    }
    if (rest.norm() < 0.1 * v.norm()) continue;
    basis.push_back(rest.normalized());
    dense.push_back(std::move(v));
    kept.push_back(r);
  }
  PointConstraints& out = clamp.constraints;
  Eigen::MatrixXd gram(static_cast<Eigen::Index>(kept.size()),
                       static_cast<Eigen::Index>(kept.size()));
  for (std::size_t i = 0; i < kept.size(); ++i) {
    out.points.push_back(candidates[kept[i]].point);
    out.rows.push_back(rows[kept[i]]);
    for (std::size_t j = 0; j < kept.size(); ++j) {
      gram(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = dense[i].dot(dense[j]);
    }
  }
  const Eigen::LLT<Eigen::MatrixXd> llt(gram);
  if (llt.info() != Eigen::Success) {
    throw_compute("Body '" + body.name + "': the constraints of a pin are dependent.");
  }
  out.factor = llt.matrixL();
}

bool TotalPins::held(double time) const {
  return std::any_of(clamps_.begin(), clamps_.end(), [&](const Clamp& clamp) {
    return clamp.pin.region == Pin::Region::kAll && time < clamp.pin.release - 1e-12;
  });
}

bool TotalPins::releases_between(double from, double to) const {
  return std::any_of(clamps_.begin(), clamps_.end(), [&](const Clamp& clamp) {
    return clamp.pin.release - 1e-12 > from && clamp.pin.release - 1e-12 <= to;
  });
}

Vec3d TotalPins::target(const Pin& pin, const Vec3d& local, double time) const {
  if (!pin.motion.animated()) {
    const shape::Pose still = pin.motion.at(0.0);
    if (still.position.isZero() && still.rotation.isApprox(Quatd::Identity(), 0.0)) {
      return Vec3d::Zero();
    }
  }
  const shape::Pose pose = pin.motion.at(time);
  const Vec3d world = grid_.to_world(local);
  const Vec3d moved = pin.pivot + pose.rotation * (world - pin.pivot) + pose.position;
  return grid_.axes().transpose() * (moved - world);
}

void TotalPins::step(double kick, double dt, double time, const Vec3d& gravity,
                     const std::vector<Vec3d>& acceleration, std::vector<double>& displacement,
                     std::vector<double>& velocity) const {
  const auto index = [&](std::uint32_t node) {
    return static_cast<std::size_t>(std::lower_bound(nodes_.begin(), nodes_.end(), node) -
                                    nodes_.begin());
  };

  std::vector<Vec3d> a = acceleration;
  // Attached masses: a_c − g = (I + W M⁻¹ Wᵀ m)⁻¹ (W a − g), and the body feels m (g − a_c) at
  // each.
  const MassGroup* group = nullptr;
  for (const MassGroup& g : mass_groups_) {
    if (time + 1e-12 >= g.from) group = &g;
  }
  if (group != nullptr) {
    Eigen::MatrixX3d relative(static_cast<Eigen::Index>(group->count), 3);
    for (std::size_t k = 0; k < group->count; ++k) {
      const NodeWeights& w = masses_[k].weights;
      Vec3d free = -gravity;
      for (std::size_t n = 0; n < w.nodes.size(); ++n) free += w.weights[n] * a[index(w.nodes[n])];
      relative.row(static_cast<Eigen::Index>(k)) = free.transpose();
    }
    const Eigen::MatrixX3d solved = group->inverse * relative;
    for (std::size_t k = 0; k < group->count; ++k) {
      const Vec3d force = -masses_[k].mass * solved.row(static_cast<Eigen::Index>(k)).transpose();
      const NodeWeights& w = masses_[k].weights;
      for (std::size_t n = 0; n < w.nodes.size(); ++n) {
        a[index(w.nodes[n])] += w.weights[n] * grid_.inverse_mass()[w.nodes[n]] * force;
      }
    }
  }
  std::vector<Vec3d> v(nodes_.size());
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    v[i] = field_value(velocity, nodes_[i]) + kick * a[i];

  for (const Clamp& clamp : clamps_) {
    if (time >= clamp.pin.release - 1e-12) continue;
    const auto wanted = [&](const Vec3d& local, const Vec3d& present) -> Vec3d {
      return (target(clamp.pin, local, time + dt) - present) / dt;
    };
    const PointConstraints& points = clamp.constraints;
    if (!points.rows.empty()) {
      Eigen::MatrixXd defect(static_cast<Eigen::Index>(points.rows.size()), 3);
      for (std::size_t r = 0; r < points.rows.size(); ++r) {
        const NodeWeights& row = points.rows[r];
        Vec3d moving = Vec3d::Zero();
        Vec3d present = Vec3d::Zero();
        for (std::size_t n = 0; n < row.nodes.size(); ++n) {
          moving += row.weights[n] * v[index(row.nodes[n])];
          present += row.weights[n] * field_value(displacement, row.nodes[n]);
        }
        defect.row(static_cast<Eigen::Index>(r)) =
            (moving - wanted(points.points[r], present)).transpose();
      }
      const auto lower = points.factor.triangularView<Eigen::Lower>();
      lower.solveInPlace(defect);
      lower.transpose().solveInPlace(defect);
      for (std::size_t r = 0; r < points.rows.size(); ++r) {
        const NodeWeights& row = points.rows[r];
        for (std::size_t n = 0; n < row.nodes.size(); ++n) {
          v[index(row.nodes[n])] -= row.weights[n] * grid_.inverse_mass()[row.nodes[n]] *
                                    defect.row(static_cast<Eigen::Index>(r)).transpose();
        }
      }
    }
    for (const std::uint32_t node : clamp.prescribed) {
      v[index(node)] = wanted(grid_.node_position(node), field_value(displacement, node));
    }
    for (const Mirror& mirror : clamp.mirrors) {
      // Relative to the plane the ghost moves opposite to the free node: one degree of freedom
      // with both masses, driven by the difference of both forces.
      const Vec3d middle =
          0.5 * (grid_.node_position(mirror.free) + grid_.node_position(mirror.ghost));
      const Vec3d plane_now =
          0.5 * (field_value(displacement, mirror.free) + field_value(displacement, mirror.ghost));
      const Vec3d plane = wanted(middle, plane_now);
      const Vec3d plane_old =
          0.5 * (field_value(velocity, mirror.free) + field_value(velocity, mirror.ghost));
      const double mass_free = grid_.mass()[mirror.free];
      const double mass_ghost = grid_.mass()[mirror.ghost];
      const Vec3d impulse =
          kick * (mass_free * a[index(mirror.free)] - mass_ghost * a[index(mirror.ghost)]) -
          (mass_free - mass_ghost) * (plane - plane_old);
      const Vec3d relative =
          0.5 * (field_value(velocity, mirror.free) - field_value(velocity, mirror.ghost)) +
          impulse / (mass_free + mass_ghost);
      v[index(mirror.free)] = plane + relative;
      v[index(mirror.ghost)] = plane - relative;
    }
  }
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    set_field_value(velocity, nodes_[i], v[i]);
    set_field_value(displacement, nodes_[i], field_value(displacement, nodes_[i]) + dt * v[i]);
  }
}

}  // namespace matterfit::mpm
