// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/fill_lattice.hpp"

#include <fmt/format.h>
#include <openvdb/openvdb.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "base/error.hpp"
#include "capture/particle_volumes.hpp"

namespace matterfit::capture {
namespace {

using openvdb::Coord;
using DistanceTree = openvdb::FloatTree;
using Leaf = DistanceTree::LeafNodeType;

constexpr int kBlock = 8;          // cells along a side of an OpenVDB leaf
constexpr double kFlat = 0.9986;   // cosine of 3°
constexpr double kMostLost = 0.5;  // of the volume, in cells that no particle has
constexpr double kSnap = 1e-4;
constexpr double kSamePlane = 0.95;  // cosine: another tangent plane than those seen
constexpr double kDeepest = 2.0;     // of a particle below its surface, in separations
const double kHalfDiagonal = 0.5 * std::sqrt(3.0);

std::uint64_t mix(std::uint64_t z) {  // splitmix64, Steele et al. 2014
  z += 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31U);
}

/// A place in the unit cell that depends on its arguments only.
Vec3d random_place(std::uint64_t seed, const Coord& cell, int draw) {
  std::uint64_t state = mix(seed);
  for (const int i : {cell.x(), cell.y(), cell.z(), draw}) {
    state = mix(state ^ static_cast<std::uint32_t>(i));
  }
  Vec3d place;
  for (int axis = 0; axis < 3; ++axis) {
    state = mix(state);
    place[axis] = static_cast<double>(state >> 11U) * 0x1.0p-53;
  }
  return place;
}

class LatticeFill {
 public:
  LatticeFill(const FillShape& shape, const FillOptions& options)
      : shape_(shape), options_(options), h_(options.separation) {
    if (!(h_ > 0) || !std::isfinite(h_)) {
      throw_input(fmt::format("particle_separation is {} m, expected a length above 0.", h_));
    }
    if (!(options.axes.norm() > 1e-6)) {
      throw_input("The lattice's rotation is a zero quaternion; no rotation is [1, 0, 0, 0].");
    }
    axes_ = options.axes.normalized();
    const Eigen::AlignedBox3d box = shape.box(axes_);
    if (box.isEmpty() || !box.min().allFinite() || !box.max().allFinite()) {
      throw_input("The shape to fill has no finite extent.");
    }
    const double cube = h_ * h_ * h_;
    if (const auto volume = shape.volume()) refuse_above_limit(*volume / cube, "about");
    for (int axis = 0; axis < 3; ++axis) {
      const double low = box.min()[axis];
      const double high = box.max()[axis];
      if (options.anchor) {
        origin_[axis] = (axes_.conjugate() * *options.anchor)[axis];
      } else {
        const double cells = std::max(1.0, std::round((high - low) / h_));
        origin_[axis] = 0.5 * (low + high) - 0.5 * cells * h_;
      }
      const double first = std::floor((low - origin_[axis]) / h_ - 1e-6);
      const double last = std::ceil((high - origin_[axis]) / h_ + 1e-6);
      if (!(std::abs(first) < 1e8 && std::abs(last) < 1e8) || last - first > 1 << 20) {
        throw_input(fmt::format(
            "particle_separation {} m is too small for a shape of {} m: more than a million "
            "cells along one side. Use a larger separation, or check the unit and the anchor.",
            h_, high - low));
      }
      first_[axis] = static_cast<int>(first);
      last_[axis] = static_cast<int>(last);
      layers_[axis] = (high - low) / h_;
    }
  }

  FilledBody run(const std::string& notes) {
    find_blocks();
    cut_blocks();
    choose();
    return emit(notes);
  }

 private:
  [[nodiscard]] bool cancelled() const {
    return options_.interrupter != nullptr && options_.interrupter->cancelled();
  }
  [[nodiscard]] Vec3d world(const Vec3d& cells) const { return axes_ * (origin_ + h_ * cells); }
  [[nodiscard]] static Vec3d vec(const Coord& c) {
    return {double(c.x()), double(c.y()), double(c.z())};
  }

  void refuse_above_limit(double count, const char* how) const {
    if (count <= static_cast<double>(options_.limit)) return;
    const double factor = std::cbrt(count / static_cast<double>(options_.limit));
    throw_input(fmt::format(
        "Filling at a particle_separation of {:.6g} m makes {} {:.4g} particles, more than the "
        "limit of {}. Use a separation of at least {:.3g} m.",
        h_, how, count, options_.limit, h_ * factor * 1.01));
  }

  /// Halves the box until a part is surely empty, surely full, or one block of cells.
  void split(const Coord& block, int size) {
    const auto outside = [&](int axis) {
      return (block[axis] + size) * kBlock <= first_[axis] || block[axis] * kBlock >= last_[axis];
    };
    if (outside(0) || outside(1) || outside(2)) return;
    look_at_cancel(options_);
    const Vec3d centre = world((vec(block) + Vec3d::Constant(0.5 * size)) * kBlock);
    const FillShape::Surface surface = shape_.at(centre);
    if (std::abs(surface.distance) > kHalfDiagonal * kBlock * size * h_ * (1 + 1e-9)) {
      if (!shape_.inside(centre, surface)) return;
      full_cells_ += std::pow(static_cast<double>(size) * kBlock, 3.0);
      refuse_above_limit(full_cells_, "at least");
      for (int i = 0; i < size; ++i) {
        for (int j = 0; j < size; ++j) {
          for (int k = 0; k < size; ++k) {
            const Coord at = block.offsetBy(i, j, k);
            tree_.addTile(1, Coord(at.x() * kBlock, at.y() * kBlock, at.z() * kBlock), 1.0F, true);
          }
        }
      }
      return;
    }
    if (size == 1) {
      blocks_.emplace_back(block.x() * kBlock, block.y() * kBlock, block.z() * kBlock);
      // A block cut by the surface holds at least a few cells that matter.
      refuse_above_limit(full_cells_ + static_cast<double>(blocks_.size()), "at least");
      return;
    }
    const int half = size / 2;
    for (int corner = 0; corner < 8; ++corner) {
      split(block.offsetBy((corner & 1) * half, (corner >> 1 & 1) * half, (corner >> 2) * half),
            half);
    }
  }

  void find_blocks() {
    const auto down = [](int cell) {
      return static_cast<int>(std::floor(static_cast<double>(cell) / kBlock));
    };
    const Coord low(down(first_[0]), down(first_[1]), down(first_[2]));
    int size = 1;
    for (int axis = 0; axis < 3; ++axis) {
      while ((low[axis] + size) * kBlock < last_[axis]) size *= 2;
    }
    split(low, size);
  }

  /// Middle of the n-th of the 2³ parts of a cube with low corner `low` and sides `side` [cells].
  [[nodiscard]] static Vec3d octant(const Vec3d& low, double side, int n) {
    return low + side * (0.25 * Vec3d::Ones() + 0.5 * Vec3d(n & 1, n >> 1 & 1, n >> 2 & 1));
  }
  [[nodiscard]] double plane_cut(const FillShape::Surface& surface, double side) const {
    return cube_fraction(surface.distance / (side * h_), axes_.conjugate() * surface.normal);
  }

  /// The part of a cell that is inside: by the tangent planes seen from its 2³ parts where those
  /// agree, else (edges, corners, strong curvature) from its 4³ parts. Where the distance's sign
  /// and the shape's last word differ, `tangled` is set and 4³ points decide.
  [[nodiscard]] CutCell cut_cell(const Coord& cell, bool& tangled) const {
    const Vec3d low = vec(cell);
    const Vec3d middle = low + Vec3d::Constant(0.5);
    FillShape::Surface parts[8];
    bool flat = true;
    tangled = false;
    for (int n = 0; n < 8; ++n) {
      const Vec3d x = world(octant(low, 1.0, n));
      parts[n] = shape_.at(x);
      flat = flat && parts[n].normal.dot(parts[0].normal) > kFlat;
      tangled = tangled || (std::abs(parts[n].distance) > 1e-3 * h_ &&
                            shape_.inside(x, parts[n]) != (parts[n].distance < 0));
    }
    double sum = 0;
    Vec3d moment = Vec3d::Zero();
    const auto add = [&](double part, const Vec3d& at) {
      sum += part;
      moment += part * (at - middle);
    };
    for (int n = 0; n < 8; ++n) {
      const Vec3d corner = low + 0.5 * Vec3d(n & 1, n >> 1 & 1, n >> 2 & 1);
      if (!tangled && (flat || std::abs(parts[n].distance) > kHalfDiagonal * 0.5 * h_)) {
        add(plane_cut(parts[n], 0.5), octant(low, 1.0, n));
        continue;
      }
      for (int m = 0; m < 8; ++m) {
        const Vec3d at = octant(corner, 0.5, m);
        const FillShape::Surface surface = shape_.at(world(at));
        if (tangled) {
          add(shape_.inside(world(at), surface) ? 0.125 : 0.0, at);
        } else {
          add(0.125 * plane_cut(surface, 0.25), at);
        }
      }
    }
    const double fraction = sum / 8.0;
    if (fraction < kSnap) return {cell, 0.0, Vec3d::Zero()};
    if (fraction > 1 - kSnap) return {cell, 1.0, Vec3d::Zero()};
    return {cell, fraction, moment / sum};
  }

  void cut_blocks() {
    std::vector<Leaf*> leaves;
    for (const Coord& block : blocks_) leaves.push_back(tree_.touchLeaf(block));
    std::atomic<std::size_t> tangled_cells{0};
    std::vector<std::vector<CutCell>> cuts(leaves.size());
    tbb::parallel_for(std::size_t{0}, leaves.size(), [&](std::size_t b) {
      for (openvdb::Index offset = 0; offset < Leaf::SIZE && !cancelled(); ++offset) {
        const Coord cell = leaves[b]->offsetToGlobalCoord(offset);
        const Vec3d centre = world(vec(cell) + Vec3d::Constant(0.5));
        const FillShape::Surface surface = shape_.at(centre);
        const bool inside = shape_.inside(centre, surface);
        double fraction = inside ? 1.0 : 0.0;
        if (std::abs(surface.distance) < kHalfDiagonal * h_) {
          bool tangled = false;
          const CutCell cut = cut_cell(cell, tangled);
          fraction = cut.fraction;
          if (fraction > 0.0 && fraction < 1.0) cuts[b].push_back(cut);
          tangled_cells += tangled;
        }
        if (fraction > 0) leaves[b]->setValueOn(offset, static_cast<float>(fraction));
      }
    });
    tangled_cells_ = tangled_cells;
    look_at_cancel(options_);
    for (const std::vector<CutCell>& of : cuts) cuts_.insert(cuts_.end(), of.begin(), of.end());
  }

  void choose() {
    inside_ = full_cells_;
    for (auto leaf = tree_.cbeginLeaf(); leaf; ++leaf) {
      for (auto value = leaf->cbeginValueOn(); value; ++value) {
        inside_ += static_cast<double>(*value);
      }
    }
    volumes_ = particle_volumes(tree_, cuts_, options_);
  }

  FilledBody emit(const std::string& notes) {
    const double cube = h_ * h_ * h_;
    volumes_->voxelizeActiveTiles(false);
    const auto count = static_cast<std::size_t>(volumes_->activeVoxelCount());
    if (count == 0) {
      throw_input(fmt::format(
          "Nothing to fill at a particle_separation of {:.6g} m: the shape, {:.4g} × {:.4g} × "
          "{:.4g} m, holds no cell of which a part is inside.{} Use a smaller separation, or check "
          "that the shape is closed and its unit.",
          h_, layers_[0] * h_, layers_[1] * h_, layers_[2] * h_, notes.empty() ? "" : " " + notes));
    }
    refuse_above_limit(static_cast<double>(count), "exactly");

    double whole = 0;
    double cut = 0;
    for (auto value = volumes_->cbeginValueOn(); value; ++value) {
      (*value == 1.0F ? whole : cut) += static_cast<double>(*value);
    }
    if (whole + cut < (1 - kMostLost) * inside_) {
      throw_input(fmt::format(
          "At a particle_separation of {:.6g} m particles hold only {:.0f} % of the shape: the "
          "rest is wires and walls that are far thinner. Use a smaller separation, or make them "
          "thicker.",
          h_, 100.0 * (whole + cut) / inside_));
    }
    FilledBody body;
    body.volume = inside_ * cube;
    const auto exact = shape_.volume();
    if (exact && tangled_cells_ == 0 && std::abs(*exact - body.volume) < 0.05 * body.volume) {
      body.volume = *exact;
    }
    const double scale = cut > 1e-3 ? (body.volume / cube - whole) / cut : 1.0;
    const bool scaled = scale > 0.5 && scale < 2.0;

    body.lattice.origin = axes_ * origin_;
    body.lattice.axes = axes_;
    body.lattice.spacing = h_;
    body.lattice.regular = !options_.jitter;
    body.positions.reserve(count);
    body.volumes.reserve(count);
    double sum = 0;
    Eigen::AlignedBox3i cells;
    openvdb::tree::ValueAccessor<const DistanceTree> part(tree_);
    for (auto value = volumes_->cbeginValueOn(); value; ++value) {
      const Coord cell = value.getCoord();
      const bool full = part.getValue(cell) == 1.0F;
      look_at_cancel(options_);
      cells.extend(Eigen::Vector3i(cell.x(), cell.y(), cell.z()));
      body.positions.push_back(position(cell, full));
      body.volumes.push_back(static_cast<double>(*value) * cube *
                             (*value == 1.0F || !scaled ? 1 : scale));
      sum += body.volumes.back();
    }
    if (body.lattice.regular) find_skin(body);
    const Eigen::Vector3i across = cells.sizes() + Eigen::Vector3i::Ones();
    body.report = fmt::format(
        "{} particles {:.4g} m apart ({} × {} × {} cells); the surface cuts {} cells; volume "
        "{:.6g} m³, particles hold {:.2f} % of it.",
        count, h_, across.x(), across.y(), across.z(), cuts_.size(), body.volume,
        100.0 * sum / body.volume);
    if (tangled_cells_ > 0) {
      body.report += fmt::format(
          " The surface crosses or doubles itself near {} cells; the winding number decided there.",
          tangled_cells_);
    }
    if (across.minCoeff() < 4) {
      body.report += fmt::format(
          " Only {} layer{} across the thinnest side ({:.4g} m); a separation of {:.3g} m gives "
          "12.",
          across.minCoeff(), across.minCoeff() == 1 ? "" : "s", layers_.minCoeff() * h_,
          layers_.minCoeff() * h_ / 12);
    }
    if (!notes.empty()) body.report += " " + notes;
    return body;
  }

  /// The surface near particles of which a neighbour along an axis is missing or that are cut: its
  /// tangent planes as seen from the middle and from the cell's 2³ parts, those that differ.
  void find_skin(FilledBody& body) const {
    std::vector<Coord> cells;
    cells.reserve(body.positions.size());
    for (auto value = volumes_->cbeginValueOn(); value; ++value) cells.push_back(value.getCoord());
    std::vector<std::vector<mpm::SkinPlane>> found(cells.size());
    tbb::parallel_for(std::size_t{0}, cells.size(), [&](std::size_t p) {
      if (cancelled()) return;
      openvdb::tree::ValueAccessor<const DistanceTree> kept(*volumes_);
      openvdb::tree::ValueAccessor<const DistanceTree> part(tree_);
      bool surface = part.getValue(cells[p]) != 1.0F;
      for (int n = 0; n < 6 && !surface; ++n) {
        Coord next = cells[p];
        next[n / 2] += n % 2 == 0 ? -1 : 1;
        surface = !kept.isValueOn(next);
      }
      if (!surface) return;
      const Vec3d centre = body.positions[p];
      const auto look = [&](const Vec3d& from) {
        const FillShape::Surface seen = shape_.at(from);
        for (const mpm::SkinPlane& plane : found[p]) {
          if (plane.normal.dot(seen.normal) > kSamePlane) return;
        }
        const double depth = -seen.distance - seen.normal.dot(centre - from);
        if (std::abs(depth) > kDeepest * h_) return;
        found[p].push_back({static_cast<std::uint32_t>(p), seen.normal, depth});
      };
      look(centre);
      for (int n = 0; n < 8; ++n) look(world(octant(vec(cells[p]), 1.0, n)));
    });
    look_at_cancel(options_);
    for (const auto& planes : found)
      body.skin.insert(body.skin.end(), planes.begin(), planes.end());
  }

  [[nodiscard]] Vec3d position(const Coord& cell, bool whole) const {
    Vec3d centre = world(vec(cell) + Vec3d::Constant(0.5));
    if (!options_.jitter) return centre;
    // In a cut cell a few draws, so that the particle lies inside the shape.
    for (int draw = 0; draw < 16; ++draw) {
      Vec3d x = world(vec(cell) + random_place(options_.seed, cell, draw));
      if (whole || shape_.inside(x, shape_.at(x))) return x;
    }
    return centre;
  }

  const FillShape& shape_;
  const FillOptions& options_;
  double h_;
  Quatd axes_;
  Vec3d origin_ = Vec3d::Zero();                     ///< in the lattice's own axes
  Vec3d layers_ = Vec3d::Zero();                     ///< sides of the shape in cells
  Eigen::Vector3i first_ = Eigen::Vector3i::Zero();  ///< cells that may be touched: [first, last)
  Eigen::Vector3i last_ = Eigen::Vector3i::Zero();
  DistanceTree tree_{0.0F};                ///< part of each cell that is inside
  std::unique_ptr<DistanceTree> volumes_;  ///< of each particle, in cells
  std::vector<Coord> blocks_;              ///< low corners of blocks the surface may cut
  std::vector<CutCell> cuts_;              ///< cells that the surface cuts
  double full_cells_ = 0;                  ///< in blocks that are wholly inside
  double inside_ = 0;                      ///< volume inside, in cells
  std::size_t tangled_cells_ = 0;
};

}  // namespace

double cube_fraction(double distance, const Vec3d& n) {
  // By symmetry the plane m·y = a in the cube [0, 1]³ with m ≥ 0, Σ m = 1.
  Vec3d m = n.cwiseAbs().cwiseMax(1e-4 * n.norm());
  const double total = m.sum();
  m /= total;
  double a = 0.5 - distance / total;
  if (a <= 0) return 0.0;
  if (a >= 1) return 1.0;
  // The smaller side, where the cubes do not cancel.
  const bool upper = a > 0.5;
  if (upper) a = 1.0 - a;
  const auto cubed = [](double v) { return v > 0 ? v * v * v : 0.0; };
  double sum = cubed(a);
  for (int i = 0; i < 3; ++i) {
    sum -= cubed(a - m[i]);
    sum += cubed(a - m[i] - m[(i + 1) % 3]);
  }
  const double fraction = std::clamp(sum / (6.0 * m.prod()), 0.0, 1.0);
  return upper ? 1.0 - fraction : fraction;
}

FilledBody fill_lattice(const FillShape& shape, const FillOptions& options,
                        const std::string& notes) {
  openvdb::initialize();
  return LatticeFill(shape, options).run(notes);
}

void take_filled(mpm::Body& body, FilledBody&& filled) {
  body.rest = std::move(filled.positions);
  body.volumes = std::move(filled.volumes);
  body.lattice = filled.lattice;
  body.skin = std::move(filled.skin);
}

void place(FilledBody& body, const Vec3d& position, const Quatd& rotation) {
  const Quatd turn = rotation.normalized();
  for (Vec3d& x : body.positions) x = turn * x + position;
  body.lattice.origin = turn * body.lattice.origin + position;
  body.lattice.axes = (turn * body.lattice.axes).normalized();
  for (mpm::SkinPlane& plane : body.skin) plane.normal = turn * plane.normal;
}

}  // namespace matterfit::capture
