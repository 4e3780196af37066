// SPDX-License-Identifier: GPL-3.0-or-later
#include "shape/triangle_tree.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace matterfit::shape {
namespace {

constexpr std::size_t kLeafSize = 4;

double solid_angle(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  // Van Oosterom and Strackee 1983.
  const double la = a.norm();
  const double lb = b.norm();
  const double lc = c.norm();
  const double det = a.dot(b.cross(c));
  const double div = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
  return 2.0 * std::atan2(det, div);
}

}  // namespace

NearestTriangle nearest_on_triangle(const Vec3d& x, const Vec3d& a, const Vec3d& b,
                                    const Vec3d& c) {
  const Vec3d ab = b - a;
  const Vec3d ac = c - a;
  const Vec3d ax = x - a;
  const auto result = [&](int feature, double u, double v, double w) {
    NearestTriangle out;
    out.feature = feature;
    out.weights = Vec3d(u, v, w);
    // From `a`, so that digits are kept far from the origin.
    out.point = a + v * ab + w * ac;
    out.distance2 = (x - out.point).squaredNorm();
    return out;
  };
  const double d1 = ab.dot(ax);
  const double d2 = ac.dot(ax);
  if (d1 <= 0 && d2 <= 0) return result(0, 1, 0, 0);
  const Vec3d bx = x - b;
  const double d3 = ab.dot(bx);
  const double d4 = ac.dot(bx);
  if (d3 >= 0 && d4 <= d3) return result(1, 0, 1, 0);
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double v = d1 / (d1 - d3);
    return result(3, 1 - v, v, 0);
  }
  const Vec3d cx = x - c;
  const double d5 = ab.dot(cx);
  const double d6 = ac.dot(cx);
  if (d6 >= 0 && d5 <= d6) return result(2, 0, 0, 1);
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double w = d2 / (d2 - d6);
    return result(5, 1 - w, 0, w);
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return result(4, 0, 1 - w, w);
  }
  const double scale = 1.0 / (va + vb + vc);
  return result(6, va * scale, vb * scale, vc * scale);
}

TriangleTree::TriangleTree(const MeshTopology& topology, std::vector<std::int32_t> members,
                           std::span<const std::vector<Vec3f>> frames,
                           const Interrupter* interrupter)
    : topology_(topology), frames_(frames), members_(std::move(members)) {
  CancelCheck check(interrupter);
  std::vector<Vec3f> centroids(topology.triangles.size());
  for (const std::int32_t t : members_) {
    Vec3f sum = Vec3f::Zero();
    for (const std::int32_t v : topology.triangles[static_cast<std::size_t>(t)]) {
      sum += frames[0][static_cast<std::size_t>(v)];
    }
    centroids[static_cast<std::size_t>(t)] = sum;
  }
  nodes_.reserve(members_.size());
  build(0, members_.size(), centroids, check);

  boxes_.resize(frames.size());
  for (std::size_t f = 0; f < frames.size(); ++f) {
    boxes_[f].resize(nodes_.size());
    for (std::size_t n = nodes_.size(); n-- > 0;) {
      check();
      Box& box = boxes_[f][n];
      if (nodes_[n].count == 0) {
        const Box& left = boxes_[f][n + 1];
        const Box& right = boxes_[f][static_cast<std::size_t>(nodes_[n].first)];
        box = {left.low.cwiseMin(right.low), left.high.cwiseMax(right.high)};
        continue;
      }
      box.low.setConstant(std::numeric_limits<float>::infinity());
      box.high = -box.low;
      for (std::int32_t i = 0; i < nodes_[n].count; ++i) {
        const auto t =
            static_cast<std::size_t>(members_[static_cast<std::size_t>(nodes_[n].first + i)]);
        for (const std::int32_t v : topology.triangles[t]) {
          const Vec3f& p = frames[f][static_cast<std::size_t>(v)];
          box.low = box.low.cwiseMin(p);
          box.high = box.high.cwiseMax(p);
        }
      }
    }
  }

  // Dipoles of the first frame, children before parents.
  dipoles_.resize(nodes_.size());
  std::vector<double> weight(nodes_.size(), 0.0);
  const VertexView at = view(0, 0.0);
  for (std::size_t n = nodes_.size(); n-- > 0;) {
    check();
    Dipole& dipole = dipoles_[n];
    dipole.area.setZero();
    dipole.centre.setZero();
    if (nodes_[n].count == 0) {
      for (const std::size_t child : {n + 1, static_cast<std::size_t>(nodes_[n].first)}) {
        dipole.area += dipoles_[child].area;
        dipole.centre += weight[child] * dipoles_[child].centre;
        weight[n] += weight[child];
      }
    } else {
      for (std::int32_t i = 0; i < nodes_[n].count; ++i) {
        const Triangle& t = topology.triangles[static_cast<std::size_t>(
            members_[static_cast<std::size_t>(nodes_[n].first + i)])];
        const Vec3d area = 0.5 * (at(t[1]) - at(t[0])).cross(at(t[2]) - at(t[0]));
        dipole.area += area;
        dipole.centre += area.norm() * (at(t[0]) + at(t[1]) + at(t[2])) / 3.0;
        weight[n] += area.norm();
      }
    }
    const Box& box = boxes_[0][n];
    const Vec3d low = box.low.cast<double>();
    const Vec3d high = box.high.cast<double>();
    dipole.centre = weight[n] > 0 ? Vec3d(dipole.centre / weight[n]) : Vec3d(0.5 * (low + high));
    dipole.radius = (dipole.centre - low).cwiseMax(high - dipole.centre).norm();
  }
}

std::int32_t TriangleTree::build(std::size_t begin, std::size_t end,
                                 const std::vector<Vec3f>& centroids, CancelCheck& check) {
  const std::size_t index = nodes_.size();
  nodes_.push_back({static_cast<std::int32_t>(begin), static_cast<std::int32_t>(end - begin)});
  if (end - begin <= kLeafSize) return static_cast<std::int32_t>(index);
  Vec3f low = Vec3f::Constant(std::numeric_limits<float>::infinity());
  Vec3f high = -low;
  for (std::size_t i = begin; i < end; ++i) {
    const Vec3f& c = centroids[static_cast<std::size_t>(members_[i])];
    low = low.cwiseMin(c);
    high = high.cwiseMax(c);
  }
  Eigen::Index axis = 0;
  (high - low).maxCoeff(&axis);
  const std::size_t middle = (begin + end) / 2;
  const auto at = [&](std::size_t i) { return members_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(middle), at(end), [&](std::int32_t a, std::int32_t b) {
    check();
    const float x = centroids[static_cast<std::size_t>(a)][axis];
    const float y = centroids[static_cast<std::size_t>(b)][axis];
    return x != y ? x < y : a < b;
  });
  build(begin, middle, centroids, check);
  const std::int32_t right = build(middle, end, centroids, check);
  nodes_[index] = {right, 0};
  return static_cast<std::int32_t>(index);
}

VertexView TriangleTree::view(std::size_t frame, double s) const {
  const std::size_t next = std::min(frame + 1, frames_.size() - 1);
  return {frames_[frame].data(), frames_[next].data(), next == frame ? 0.0 : s};
}

double TriangleTree::box_distance2(std::size_t node, const Vec3d& x, std::size_t frame,
                                   double s) const {
  const Box& a = boxes_[frame][node];
  Vec3d low = a.low.cast<double>();
  Vec3d high = a.high.cast<double>();
  if (s != 0.0 && frame + 1 < boxes_.size()) {
    // Corners that move on straight lines stay between the moving sides.
    const Box& b = boxes_[frame + 1][node];
    low += s * (b.low.cast<double>() - low);
    high += s * (b.high.cast<double>() - high);
  }
  return (low - x).cwiseMax(x - high).cwiseMax(0.0).squaredNorm();
}

double TriangleTree::box_distance(const Vec3d& x, std::size_t frame, double s) const {
  return std::sqrt(box_distance2(0, x, frame, s));
}

void TriangleTree::closest(const Vec3d& x, std::size_t frame, double s,
                           NearestTriangle& nearest) const {
  struct Entry {
    std::int32_t node;
    double distance2;
  };
  const VertexView at = view(frame, s);
  Entry stack[64];  // depth ≤ 1 + log₂ of 2³¹ triangles
  int top = 0;
  stack[top++] = {0, box_distance2(0, x, frame, s)};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.distance2 >= nearest.distance2) continue;
    const auto n = static_cast<std::size_t>(entry.node);
    const Node& node = nodes_[n];
    if (node.count == 0) {
      Entry left{entry.node + 1, box_distance2(n + 1, x, frame, s)};
      Entry right{node.first, box_distance2(static_cast<std::size_t>(node.first), x, frame, s)};
      if (left.distance2 > right.distance2) std::swap(left, right);
      stack[top++] = right;
      stack[top++] = left;
      continue;
    }
    for (std::int32_t i = 0; i < node.count; ++i) {
      const std::int32_t t = members_[static_cast<std::size_t>(node.first + i)];
      const Triangle& corners = topology_.triangles[static_cast<std::size_t>(t)];
      NearestTriangle candidate =
          nearest_on_triangle(x, at(corners[0]), at(corners[1]), at(corners[2]));
      // NaN from a triangle without area never wins.
      if (candidate.distance2 < nearest.distance2) {
        candidate.triangle = t;
        nearest = candidate;
      }
    }
  }
}

double TriangleTree::winding_below(std::size_t n, const Vec3d& x, const VertexView& at) const {
  const Dipole& dipole = dipoles_[n];
  const Vec3d r = dipole.centre - x;
  const double distance2 = r.squaredNorm();
  constexpr double kFar = 2.3;
  if (distance2 > kFar * kFar * dipole.radius * dipole.radius) {
    return r.dot(dipole.area) / (distance2 * std::sqrt(distance2));
  }
  const Node& node = nodes_[n];
  if (node.count == 0) {
    return winding_below(n + 1, x, at) + winding_below(static_cast<std::size_t>(node.first), x, at);
  }
  double sum = 0;
  for (std::int32_t i = 0; i < node.count; ++i) {
    const Triangle& t = topology_.triangles[static_cast<std::size_t>(
        members_[static_cast<std::size_t>(node.first + i)])];
    sum += solid_angle(at(t[0]) - x, at(t[1]) - x, at(t[2]) - x);
  }
  return sum;
}

double TriangleTree::winding(const Vec3d& x) const {
  return winding_below(0, x, view(0, 0.0)) / (4.0 * std::numbers::pi);
}

}  // namespace matterfit::shape
