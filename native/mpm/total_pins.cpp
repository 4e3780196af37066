// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_pins.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "base/error.hpp"
#include "mpm/pin_region.hpp"
#include "mpm/total_stencil.hpp"

namespace matterfit::mpm {
namespace {

class TotalPin : public TotalNodeTerm {
 public:
  TotalPin(const Pin& pin, const TotalGrid& grid) : grid_(grid), pin_(pin) {}
  [[nodiscard]] double release() const override { return pin_.release; }

 protected:
  /// The velocity that takes the material point at rest `local` from `present`, a displacement, to
  /// where the pin has it at the end of the substep.
  [[nodiscard]] Vec3d wanted(const NodeMoment& moment, const Vec3d& local,
                             const Vec3d& present) const {
    return (target(local, moment.time + moment.dt) - present) / moment.dt;
  }
  [[nodiscard]] const TotalGrid& grid() const { return grid_; }

 private:
  /// Displacement that the pin prescribes.
  [[nodiscard]] Vec3d target(const Vec3d& local, double time) const;

  const TotalGrid& grid_;
  Pin pin_;
};

Vec3d TotalPin::target(const Vec3d& local, double time) const {
  if (!pin_.motion.animated()) {
    const shape::Pose still = pin_.motion.at(0.0);
    if (still.position.isZero() && still.rotation.isApprox(Quatd::Identity(), 0.0)) {
      return Vec3d::Zero();
    }
  }
  const shape::Pose pose = pin_.motion.at(time);
  const Vec3d world = grid_.to_world(local);
  const Vec3d moved = pin_.pivot + pose.rotation * (world - pin_.pivot) + pose.position;
  return grid_.axes().transpose() * (moved - world);
}

// --- every node
// -----------------------------------------------------------------------------------

class WholePin final : public TotalPin {
 public:
  WholePin(const Pin& pin, const TotalGrid& grid);
  [[nodiscard]] std::vector<std::uint32_t> nodes() const override { return nodes_; }
  [[nodiscard]] bool holds_all() const override { return true; }
  void move(const NodeMoment& moment, NodeMotion& motion) const override;
  void move_adjoint(const NodeMoment& moment, NodeMotionBar& bar) const override;

 private:
  std::vector<std::uint32_t> nodes_;
};

WholePin::WholePin(const Pin& pin, const TotalGrid& grid) : TotalPin(pin, grid) {
  for (std::uint32_t n = 0; n < grid.mass().size(); ++n) {
    if (grid.mass()[n] > 0.0) nodes_.push_back(n);
  }
}

void WholePin::move(const NodeMoment& moment, NodeMotion& motion) const {
  for (const std::uint32_t node : nodes_) {
    motion.velocity[motion.list.index(node)] =
        wanted(moment, grid().node_position(node), field_value(motion.displacement_was, node));
  }
}

void WholePin::move_adjoint(const NodeMoment& moment, NodeMotionBar& bar) const {
  for (const std::uint32_t node : nodes_) {
    const std::size_t i = bar.list.index(node);
    bar.displacement_was[i] -= bar.velocity[i] / moment.dt;
    bar.velocity[i].setZero();
  }
}

// --- a plane between nodes
// ------------------------------------------------------------------------

struct Mirror {
  std::uint32_t free;
  std::uint32_t ghost;
};

/// None if there is material behind the plane: then points are constrained.
std::optional<std::vector<Mirror>> mirrors_of(const Pin& pin, const TotalGrid& grid, int axis,
                                              int side) {
  const double plane = grid.node_coordinate(grid.to_local(pin.point), axis);
  const int behind = static_cast<int>(std::lround(plane - 0.5 * side));
  for (std::uint32_t p = 0; p < grid.particles(); ++p) {
    if (side * (grid.node_coordinate(grid.rest(p), axis) - plane) < -1e-9) return std::nullopt;
  }
  std::vector<Mirror> mirrors;
  for (std::uint32_t n = 0; n < grid.mass().size(); ++n) {
    Vec3i at = grid.node_coordinates(n);
    if (!(grid.mass()[n] > 0.0) || at[axis] != behind) continue;
    at[axis] += side;
    mirrors.push_back({grid.find_node(at), n});
  }
  return mirrors;
}

class PlanePin final : public TotalPin {
 public:
  PlanePin(const Pin& pin, const TotalGrid& grid, std::vector<Mirror> mirrors)
      : TotalPin(pin, grid), mirrors_(std::move(mirrors)) {}
  [[nodiscard]] std::vector<std::uint32_t> nodes() const override;
  void move(const NodeMoment& moment, NodeMotion& motion) const override;
  void move_adjoint(const NodeMoment& moment, NodeMotionBar& bar) const override;

 private:
  std::vector<Mirror> mirrors_;
};

std::vector<std::uint32_t> PlanePin::nodes() const {
  std::vector<std::uint32_t> nodes;
  for (const Mirror& m : mirrors_) nodes.insert(nodes.end(), {m.free, m.ghost});
  return nodes;
}

// Relative to the plane the ghost moves opposite to the free node: one degree of freedom with both
// masses, driven by the difference of both forces.
void PlanePin::move(const NodeMoment& moment, NodeMotion& motion) const {
  const std::vector<double>& displacement = motion.displacement_was;
  const std::vector<double>& velocity = motion.velocity_was;
  for (const Mirror& mirror : mirrors_) {
    const std::size_t f = motion.list.index(mirror.free);
    const std::size_t g = motion.list.index(mirror.ghost);
    const Vec3d middle =
        0.5 * (grid().node_position(mirror.free) + grid().node_position(mirror.ghost));
    const Vec3d plane_now =
        0.5 * (field_value(displacement, mirror.free) + field_value(displacement, mirror.ghost));
    const Vec3d plane = wanted(moment, middle, plane_now);
    const Vec3d plane_old =
        0.5 * (field_value(velocity, mirror.free) + field_value(velocity, mirror.ghost));
    const double mass_free = grid().mass()[mirror.free];
    const double mass_ghost = grid().mass()[mirror.ghost];
    const Vec3d impulse =
        moment.kick * (mass_free * motion.acceleration[f] - mass_ghost * motion.acceleration[g]) -
        (mass_free - mass_ghost) * (plane - plane_old);
    const Vec3d relative =
        0.5 * (field_value(velocity, mirror.free) - field_value(velocity, mirror.ghost)) +
        impulse / (mass_free + mass_ghost);
    motion.velocity[f] = plane + relative;
    motion.velocity[g] = plane - relative;
  }
}

void PlanePin::move_adjoint(const NodeMoment& moment, NodeMotionBar& bar) const {
  for (auto mirror = mirrors_.rbegin(); mirror != mirrors_.rend(); ++mirror) {
    const std::size_t f = bar.list.index(mirror->free);
    const std::size_t g = bar.list.index(mirror->ghost);
    const double mass_free = grid().mass()[mirror->free];
    const double mass_ghost = grid().mass()[mirror->ghost];
    const Vec3d relative = bar.velocity[f] - bar.velocity[g];
    const Vec3d impulse = relative / (mass_free + mass_ghost);
    const Vec3d plane_old = (mass_free - mass_ghost) * impulse;
    const Vec3d plane = bar.velocity[f] + bar.velocity[g] - plane_old;
    bar.velocity_was[f] += 0.5 * (relative + plane_old);
    bar.velocity_was[g] += 0.5 * (plane_old - relative);
    bar.acceleration[f] += moment.kick * mass_free * impulse;
    bar.acceleration[g] -= moment.kick * mass_ghost * impulse;
    bar.displacement_was[f] -= 0.5 / moment.dt * plane;
    bar.displacement_was[g] -= 0.5 / moment.dt * plane;
    bar.velocity[f].setZero();
    bar.velocity[g].setZero();
  }
}

// --- points
// ---------------------------------------------------------------------------------------

/// Rows of C, and the factor of C M⁻¹ Cᵀ.
struct Constraints {
  std::vector<Vec3d> points;  ///< local, at rest
  std::vector<NodeWeights> rows;
  Eigen::MatrixXd factor;  ///< lower Cholesky factor
};

/// The nodes of all rows, each as often as it is named.
std::vector<std::uint32_t> nodes_of(const std::vector<NodeWeights>& rows) {
  std::vector<std::uint32_t> nodes;
  for (const NodeWeights& row : rows) {
    nodes.insert(nodes.end(), row.nodes.begin(), row.nodes.end());
  }
  return nodes;
}

/// None for a pin that holds nothing.
Constraints constraints_of(const Pin& pin, const Body& body, const TotalGrid& grid) {
  // Candidates: points of the region's surface that lie in the body, first, because they are the
  // clamp; then the particles inside, which hold the rest of the region.
  const double near = 0.5 * grid.dx();
  struct Candidate {
    std::uint32_t particle;  ///< in whose cell it lies, or nearly
    Vec3d point;
  };
  std::vector<Candidate> surface;
  std::vector<Candidate> inside;
  for (std::uint32_t p = 0; p < body.rest.size(); ++p) {
    const auto [d, nearest] = region_distance(pin, body.rest[p]);
    if (std::abs(d) <= near && pin.region != Pin::Region::kPoints) {
      surface.push_back({p, grid.to_local(nearest)});
    }
    if (d <= 0.0) inside.push_back({p, grid.to_local(body.rest[p])});
  }
  if (inside.empty() && surface.empty()) return {};
  // One candidate a half cell is plenty: nodes are a cell apart.
  std::vector<Candidate> candidates;
  std::set<std::tuple<long, long, long>> seen;
  for (const std::vector<Candidate>* group : {&surface, &inside}) {
    for (const Candidate& candidate : *group) {
      const Vec3d q = candidate.point / (0.45 * grid.dx());
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
  for (const Candidate& c : candidates) rows.push_back(grid.field_weights(c.particle, c.point));
  // Pivoted Cholesky of C M⁻¹ Cᵀ: keeps constraints that are independent of those kept already.
  std::vector<Eigen::VectorXd> dense;  // M^(−½) rows, on the nodes involved
  NodeList nodes;
  nodes.add(nodes_of(rows));
  const auto column = [&](std::uint32_t node) {
    return static_cast<Eigen::Index>(nodes.index(node));
  };
  std::vector<Eigen::VectorXd> basis;
  std::vector<std::size_t> kept;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    Eigen::VectorXd v = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(nodes.size()));
    for (std::size_t n = 0; n < rows[r].nodes.size(); ++n) {
      v[column(rows[r].nodes[n])] +=
          rows[r].weights[n] * std::sqrt(grid.inverse_mass()[rows[r].nodes[n]]);
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
  Constraints out;
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
  return out;
}

class PointsPin final : public TotalPin {
 public:
  PointsPin(const Pin& pin, const TotalGrid& grid, Constraints constraints)
      : TotalPin(pin, grid), constraints_(std::move(constraints)) {}
  [[nodiscard]] std::vector<std::uint32_t> nodes() const override;
  void move(const NodeMoment& moment, NodeMotion& motion) const override;
  void move_adjoint(const NodeMoment& moment, NodeMotionBar& bar) const override;

 private:
  /// Takes (C M⁻¹ Cᵀ)⁻¹ times it.
  void solve(Eigen::MatrixXd& defect) const {
    const auto lower = constraints_.factor.triangularView<Eigen::Lower>();
    lower.solveInPlace(defect);
    lower.transpose().solveInPlace(defect);
  }
  Constraints constraints_;
};

std::vector<std::uint32_t> PointsPin::nodes() const { return nodes_of(constraints_.rows); }

void PointsPin::move(const NodeMoment& moment, NodeMotion& motion) const {
  const std::vector<NodeWeights>& rows = constraints_.rows;
  std::vector<Vec3d>& v = motion.velocity;
  Eigen::MatrixXd defect(static_cast<Eigen::Index>(rows.size()), 3);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const NodeWeights& row = rows[r];
    Vec3d moving = Vec3d::Zero();
    Vec3d present = Vec3d::Zero();
    for (std::size_t n = 0; n < row.nodes.size(); ++n) {
      moving += row.weights[n] * v[motion.list.index(row.nodes[n])];
      present += row.weights[n] * field_value(motion.displacement_was, row.nodes[n]);
    }
    defect.row(static_cast<Eigen::Index>(r)) =
        (moving - wanted(moment, constraints_.points[r], present)).transpose();
  }
  solve(defect);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const NodeWeights& row = rows[r];
    for (std::size_t n = 0; n < row.nodes.size(); ++n) {
      v[motion.list.index(row.nodes[n])] -= row.weights[n] * grid().inverse_mass()[row.nodes[n]] *
                                            defect.row(static_cast<Eigen::Index>(r)).transpose();
    }
  }
}

void PointsPin::move_adjoint(const NodeMoment& moment, NodeMotionBar& bar) const {
  const std::vector<NodeWeights>& rows = constraints_.rows;
  Eigen::MatrixXd q(static_cast<Eigen::Index>(rows.size()), 3);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const NodeWeights& row = rows[r];
    Vec3d sum = Vec3d::Zero();
    for (std::size_t n = 0; n < row.nodes.size(); ++n) {
      sum += row.weights[n] * grid().inverse_mass()[row.nodes[n]] *
             bar.velocity[bar.list.index(row.nodes[n])];
    }
    q.row(static_cast<Eigen::Index>(r)) = sum.transpose();
  }
  solve(q);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const NodeWeights& row = rows[r];
    const Vec3d back = q.row(static_cast<Eigen::Index>(r)).transpose();
    for (std::size_t n = 0; n < row.nodes.size(); ++n) {
      const std::size_t i = bar.list.index(row.nodes[n]);
      bar.velocity[i] -= row.weights[n] * back;
      bar.displacement_was[i] -= row.weights[n] / moment.dt * back;
    }
  }
}

std::unique_ptr<TotalNodeTerm> find_total_pin(const Pin& pin, const Body& body,
                                              const TotalGrid& grid) {
  if (pin.region == Pin::Region::kAll) return std::make_unique<WholePin>(pin, grid);
  if (pin.region == Pin::Region::kPlane) {
    const Vec3d normal = grid.axes().transpose() * pin.normal.normalized();
    for (int axis = 0; axis < 3; ++axis) {
      if (std::abs(std::abs(normal[axis]) - 1.0) > 1e-6) continue;
      const double at = grid.node_coordinate(grid.to_local(pin.point), axis);
      if (std::abs(at - std::floor(at) - 0.5) > 1e-6) continue;
      auto mirrors = mirrors_of(pin, grid, axis, normal[axis] > 0 ? 1 : -1);
      if (mirrors) return std::make_unique<PlanePin>(pin, grid, std::move(*mirrors));
    }
  }
  Constraints constraints = constraints_of(pin, body, grid);
  if (constraints.rows.empty()) return nullptr;
  return std::make_unique<PointsPin>(pin, grid, std::move(constraints));
}

}  // namespace

std::unique_ptr<TotalNodeTerm> make_total_pin(const Body& body, std::size_t i,
                                              const TotalGrid& grid) {
  std::unique_ptr<TotalNodeTerm> term = find_total_pin(body.pins[i], body, grid);
  if (term == nullptr || term->nodes().empty()) {
    throw_input("Body '" + body.name + "': pin " + std::to_string(i) +
                " holds no part of the body. Move its region onto the body.");
  }
  return term;
}

}  // namespace matterfit::mpm
