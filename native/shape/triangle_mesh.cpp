// SPDX-License-Identifier: GPL-3.0-or-later
#include "shape/triangle_mesh.hpp"

#include <algorithm>
#include <cstring>
#include <map>
#include <numeric>
#include <tuple>

#include "base/cancel_check.hpp"

namespace matterfit::shape {
namespace {

/// One side of a triangle, by its undirected edge.
struct Side {
  std::int32_t low, high;
  std::int32_t triangle;
  std::int8_t edge;
  bool forward;  ///< runs low → high
};

std::vector<Side> sorted_sides(const std::vector<Triangle>& triangles, CancelCheck& check) {
  std::vector<Side> sides;
  sides.reserve(3 * triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (int e = 0; e < 3; ++e) {
      const std::int32_t a = triangles[t][static_cast<std::size_t>(e)];
      const std::int32_t b = triangles[t][static_cast<std::size_t>((e + 1) % 3)];
      sides.push_back({std::min(a, b), std::max(a, b), static_cast<std::int32_t>(t),
                       static_cast<std::int8_t>(e), a < b});
    }
  }
  std::sort(sides.begin(), sides.end(), [&](const Side& a, const Side& b) {
    check();
    return std::tie(a.low, a.high, a.triangle, a.edge) <
           std::tie(b.low, b.high, b.triangle, b.edge);
  });
  return sides;
}

/// Calls visit(first, last) for each group of sides on the same edge.
template <class Visit>
void for_each_edge(const std::vector<Side>& sides, const Visit& visit) {
  for (std::size_t first = 0; first < sides.size();) {
    std::size_t last = first + 1;
    while (last < sides.size() && sides[last].low == sides[first].low &&
           sides[last].high == sides[first].high) {
      ++last;
    }
    visit(first, last);
    first = last;
  }
}

std::size_t count_boundary(const std::vector<Side>& sides) {
  std::size_t count = 0;
  for_each_edge(sides, [&](std::size_t first, std::size_t last) { count += last - first == 1; });
  return count;
}

std::size_t drop_degenerate(std::vector<Triangle>& triangles) {
  const auto end = std::remove_if(triangles.begin(), triangles.end(), [](const Triangle& t) {
    return t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
  });
  const auto dropped = static_cast<std::size_t>(triangles.end() - end);
  triangles.erase(end, triangles.end());
  return dropped;
}

/// For each vertex the first one that coincides with it in every frame.
std::vector<std::int32_t> coincident(std::span<const std::vector<Vec3f>> frames,
                                     CancelCheck& check) {
  const std::size_t count = frames[0].size();
  std::vector<std::int32_t> order(count);
  std::iota(order.begin(), order.end(), 0);
  const auto compare = [&](std::int32_t a, std::int32_t b) {
    for (const auto& frame : frames) {
      for (int axis = 0; axis < 3; ++axis) {
        const float x = frame[static_cast<std::size_t>(a)][axis];
        const float y = frame[static_cast<std::size_t>(b)][axis];
        if (x != y) return x < y ? -1 : 1;
      }
    }
    return 0;
  };
  std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
    check();
    const int side = compare(a, b);
    return side != 0 ? side < 0 : a < b;
  });
  std::vector<std::int32_t> map(count);
  for (std::size_t i = 0; i < count; ++i) {
    const bool same = i > 0 && compare(order[i - 1], order[i]) == 0;
    map[static_cast<std::size_t>(order[i])] =
        same ? map[static_cast<std::size_t>(order[i - 1])] : order[i];
  }
  return map;
}

}  // namespace

MeshTopology analyse_topology(std::vector<Triangle> triangles,
                              std::span<const std::vector<Vec3f>> frames,
                              const Interrupter* interrupter) {
  CancelCheck check(interrupter);
  MeshTopology out;
  out.degenerate_triangles = drop_degenerate(triangles);
  std::vector<Side> sides = sorted_sides(triangles, check);
  const std::size_t boundary = count_boundary(sides);
  if (boundary > 0) {
    const std::vector<std::int32_t> map = coincident(frames, check);
    std::vector<Triangle> welded = triangles;
    for (Triangle& t : welded) {
      for (std::int32_t& corner : t) corner = map[static_cast<std::size_t>(corner)];
    }
    const std::size_t collapsed = drop_degenerate(welded);
    std::vector<Side> welded_sides = sorted_sides(welded, check);
    if (count_boundary(welded_sides) < boundary) {
      for (std::size_t i = 0; i < map.size(); ++i) {
        out.welded_vertices += map[i] != static_cast<std::int32_t>(i);
      }
      out.degenerate_triangles += collapsed;
      triangles = std::move(welded);
      sides = std::move(welded_sides);
    }
  }

  const std::size_t count = triangles.size();
  out.twins.assign(3 * count, MeshTopology::kBoundary);
  std::vector<std::uint8_t> agrees(3 * count, 1);  // does the neighbour face the same way?
  std::vector<std::vector<std::int32_t>> fans;     // triangles around each non-manifold edge
  for_each_edge(sides, [&](std::size_t first, std::size_t last) {
    check();
    if (last - first == 1) {
      ++out.boundary_edges;
    } else if (last - first == 2) {
      const Side& a = sides[first];
      const Side& b = sides[first + 1];
      const auto ia = static_cast<std::size_t>(3 * a.triangle + a.edge);
      const auto ib = static_cast<std::size_t>(3 * b.triangle + b.edge);
      out.twins[ia] = b.triangle;
      out.twins[ib] = a.triangle;
      agrees[ia] = agrees[ib] = a.forward != b.forward;
    } else {
      ++out.non_manifold_edges;
      std::vector<std::int32_t>& fan = fans.emplace_back();
      for (std::size_t i = first; i < last; ++i) {
        out.twins[static_cast<std::size_t>(3 * sides[i].triangle + sides[i].edge)] =
            MeshTopology::kNonManifold;
        fan.push_back(sides[i].triangle);
      }
    }
  });

  // Shells by flooding over edges shared by two; edges shared by more join what they touch later.
  out.shells.assign(count, -1);
  std::vector<std::uint8_t> turned(count, 0);
  std::vector<std::int32_t> stack;
  std::int32_t shell_count = 0;
  for (std::size_t seed = 0; seed < count; ++seed) {
    if (out.shells[seed] >= 0) continue;
    std::vector<std::int32_t> members;
    stack.push_back(static_cast<std::int32_t>(seed));
    out.shells[seed] = shell_count;
    std::size_t turns = 0;
    while (!stack.empty()) {
      check();
      const auto t = static_cast<std::size_t>(stack.back());
      stack.pop_back();
      members.push_back(static_cast<std::int32_t>(t));
      turns += turned[t];
      for (std::size_t e = 0; e < 3; ++e) {
        const std::int32_t twin = out.twins[3 * t + e];
        if (twin < 0 || out.shells[static_cast<std::size_t>(twin)] >= 0) continue;
        out.shells[static_cast<std::size_t>(twin)] = shell_count;
        turned[static_cast<std::size_t>(twin)] = agrees[3 * t + e] ? turned[t] : !turned[t];
        stack.push_back(twin);
      }
    }
    if (2 * turns > members.size()) {
      for (const std::int32_t t : members) turned[static_cast<std::size_t>(t)] ^= 1;
    }
    ++shell_count;
  }
  // Union over non-manifold edges.
  std::vector<std::int32_t> parent(static_cast<std::size_t>(shell_count));
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](std::int32_t s) {
    while (parent[static_cast<std::size_t>(s)] != s) s = parent[static_cast<std::size_t>(s)];
    return s;
  };
  for (const auto& fan : fans) {
    for (const std::int32_t t : fan) {
      const std::int32_t a = root(out.shells[static_cast<std::size_t>(fan[0])]);
      const std::int32_t b = root(out.shells[static_cast<std::size_t>(t)]);
      parent[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
    }
  }
  std::vector<std::int32_t> number(static_cast<std::size_t>(shell_count), -1);
  std::int32_t merged = 0;
  for (std::int32_t s = 0; s < shell_count; ++s) {
    if (root(s) == s) number[static_cast<std::size_t>(s)] = merged++;
  }
  for (std::int32_t& s : out.shells) s = number[static_cast<std::size_t>(root(s))];

  out.shell_boundary.assign(static_cast<std::size_t>(merged), 0);
  for (std::size_t t = 0; t < count; ++t) {
    check();
    for (std::size_t e = 0; e < 3; ++e) {
      out.shell_boundary[static_cast<std::size_t>(out.shells[t])] +=
          out.twins[3 * t + e] == MeshTopology::kBoundary;
    }
    if (turned[t]) {
      // (a, b, c) → (b, a, c): edges ab, bc, ca become ba, ac, cb.
      std::swap(triangles[t][0], triangles[t][1]);
      std::swap(out.twins[3 * t + 1], out.twins[3 * t + 2]);
      ++out.turned_triangles;
    }
  }

  const std::size_t vertices = frames[0].size();
  out.vertex_offsets.assign(vertices + 1, 0);
  for (const Triangle& t : triangles) {
    for (const std::int32_t v : t) ++out.vertex_offsets[static_cast<std::size_t>(v) + 1];
  }
  std::partial_sum(out.vertex_offsets.begin(), out.vertex_offsets.end(),
                   out.vertex_offsets.begin());
  out.vertex_triangles.resize(3 * count);
  std::vector<std::int32_t> next(out.vertex_offsets.begin(), out.vertex_offsets.end() - 1);
  for (std::size_t t = 0; t < count; ++t) {
    check();
    for (const std::int32_t v : triangles[t]) {
      out.vertex_triangles[static_cast<std::size_t>(next[static_cast<std::size_t>(v)]++)] =
          static_cast<std::int32_t>(t);
    }
  }
  out.triangles = std::move(triangles);
  return out;
}

void turn_shell(MeshTopology& topology, std::int32_t shell) {
  for (std::size_t t = 0; t < topology.triangles.size(); ++t) {
    if (topology.shells[t] != shell) continue;
    std::swap(topology.triangles[t][0], topology.triangles[t][1]);
    std::swap(topology.twins[3 * t + 1], topology.twins[3 * t + 2]);
  }
}

std::vector<double> shell_volumes(const MeshTopology& topology, std::span<const Vec3f> vertices) {
  const std::size_t shells = topology.shell_count();
  std::vector<Vec3d> centre(shells, Vec3d::Zero());
  std::vector<double> corners(shells, 0.0);
  for (std::size_t t = 0; t < topology.triangles.size(); ++t) {
    const auto s = static_cast<std::size_t>(topology.shells[t]);
    for (const std::int32_t v : topology.triangles[t]) {
      centre[s] += vertices[static_cast<std::size_t>(v)].cast<double>();
    }
    corners[s] += 3.0;
  }
  std::vector<double> volumes(shells, 0.0);
  for (std::size_t t = 0; t < topology.triangles.size(); ++t) {
    const auto s = static_cast<std::size_t>(topology.shells[t]);
    const Vec3d base = centre[s] / corners[s];
    const Triangle& c = topology.triangles[t];
    const Vec3d p = vertices[static_cast<std::size_t>(c[0])].cast<double>() - base;
    const Vec3d q = vertices[static_cast<std::size_t>(c[1])].cast<double>() - base;
    const Vec3d r = vertices[static_cast<std::size_t>(c[2])].cast<double>() - base;
    volumes[s] += p.dot(q.cross(r)) / 6.0;
  }
  return volumes;
}

std::vector<Triangle> cap_holes(const MeshTopology& topology, std::vector<Vec3f>& vertices,
                                std::size_t& holes) {
  // Half-edges along the holes, by the vertex where each starts.
  std::multimap<std::int32_t, std::int32_t> open;
  for (std::size_t t = 0; t < topology.triangles.size(); ++t) {
    for (std::size_t e = 0; e < 3; ++e) {
      if (topology.twins[3 * t + e] != MeshTopology::kBoundary) continue;
      // The cap runs against the triangle.
      open.emplace(topology.triangles[t][(e + 1) % 3], topology.triangles[t][e]);
    }
  }
  std::vector<Triangle> out = topology.triangles;
  holes = 0;
  while (!open.empty()) {
    std::vector<std::int32_t> loop;
    auto edge = open.begin();
    const std::int32_t start = edge->first;
    while (edge != open.end()) {
      loop.push_back(edge->first);
      const std::int32_t to = edge->second;
      open.erase(edge);
      if (to == start) break;
      edge = open.find(to);
      if (edge == open.end()) loop.push_back(to);
    }
    ++holes;
    if (loop.size() < 3) continue;
    if (loop.size() == 3) {
      out.push_back({loop[0], loop[1], loop[2]});
      continue;
    }
    Vec3d middle = Vec3d::Zero();
    for (const std::int32_t v : loop)
      middle += vertices[static_cast<std::size_t>(v)].cast<double>();
    const auto centre = static_cast<std::int32_t>(vertices.size());
    vertices.push_back((middle / static_cast<double>(loop.size())).cast<float>());
    for (std::size_t i = 0; i < loop.size(); ++i) {
      out.push_back({loop[i], loop[(i + 1) % loop.size()], centre});
    }
  }
  return out;
}

}  // namespace matterfit::shape
