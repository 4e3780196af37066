// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_group.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "base/error.hpp"
#include "mpm/contact_law.hpp"
#include "mpm/halo.hpp"
#include "mpm/node_contact.hpp"
#include "mpm/pin_region.hpp"
#include "mpm/spline_weights.hpp"
#include "mpm/unstable_error.hpp"
#include "mpm/updated_blocks.hpp"

namespace matterfit::mpm {
namespace {

[[nodiscard]] Mat3d deformation_gradient(const Chunk& chunk, std::size_t lane) {
  Mat3d f = Mat3d::Identity();
  for (std::size_t i = 0; i < 9; ++i) {
    f(static_cast<int>(i / 3), static_cast<int>(i % 3)) +=
        static_cast<double>(chunk.a[Chunk::kH + i][lane]);
  }
  return f;
}

[[nodiscard]] Vec3d velocity(const Chunk& chunk, std::size_t lane) {
  return {static_cast<double>(chunk.a[Chunk::kVelocity][lane]),
          static_cast<double>(chunk.a[Chunk::kVelocity + 1][lane]),
          static_cast<double>(chunk.a[Chunk::kVelocity + 2][lane])};
}

/// A pinned particle is this many times as heavy for the grid: its nodes follow the pin.
constexpr float kPinWeight = 1e4F;

struct Member {
  std::size_t index = 0;  ///< into scene.bodies
  std::string name;
  material::Material material;
  material::LawConstants<float> law;
  double density = 0.0;
  std::size_t particles = 0;
  std::vector<ContactLaw> contacts;   ///< per particle-wise collider
  std::vector<ContactMemory> memory;  ///< per particle
  std::vector<float> maxwell;         ///< per particle and branch [6] (UpdatedView)
  std::vector<Pin> pins;
  std::vector<std::uint8_t> pin_of;  ///< per particle: pin + 1, 0: free; empty without pins
  Points rest;                       ///< kept for pins only
};

}  // namespace

struct UpdatedGroup::Impl {
  const Scene* scene;
  const Kernels<float>* kernels;
  std::size_t memory_limit;
  double dx;
  std::vector<Member> members;
  std::vector<ColliderPtr> particle_colliders;
  std::vector<ColliderPtr> node_colliders;
  UpdatedBlocks blocks;
  double last_dt = 0.0;
  double max_speed = 0.0;
  double largest_edge = 0.0;  ///< of any particle at rest [m]
  double min_j = 1.0;
  double frame_seconds = 0.0;
  double pull = 0.0;

  Impl(const Scene& s, const std::vector<std::size_t>& bodies, const Kernels<float>& k,
       std::size_t limit)
      : scene(&s), kernels(&k), memory_limit(limit), dx(s.dx), blocks(bodies.size()) {
    frame_seconds = 1.0 / s.fps;
    for (const ColliderPtr& collider : s.colliders) {
      (collider->contact().method == ContactMethod::kNode ? node_colliders : particle_colliders)
          .push_back(collider);
    }
    for (const std::size_t index : bodies) add_member(s.bodies[index], index);
    scatter_all();
  }

  void add_member(const Body& body, std::size_t index) {
    if (!body.masses.empty()) {
      throw_input("Body '" + body.name +
                  "': attached masses need the total Lagrangian formulation. Set formulation to "
                  "'total', or remove the masses.");
    }
    Member m;
    m.index = index;
    m.name = body.name;
    m.material = body.material;
    m.law = material::law_constants<float>(body.material);
    m.density = body.density;
    m.particles = body.rest.size();
    m.memory.resize(particle_colliders.empty() ? 0 : m.particles);
    m.maxwell.assign(m.particles * m.law.maxwell_count * 6, 0.0F);
    for (const ColliderPtr& collider : particle_colliders) {
      m.contacts.push_back(resolve_contact(collider->contact(), body, dx));
    }
    if (!body.pins.empty()) {
      m.pins = body.pins;
      m.rest = body.rest;
      m.pin_of.assign(m.particles, 0);
      constexpr std::size_t kMostPins = 250;
      if (m.pins.size() > kMostPins) {
        throw_input("Body '" + body.name + "' has " + std::to_string(m.pins.size()) +
                    " pins; an updated body takes 250. Join some, or set formulation to 'total'.");
      }
      for (std::size_t k = 0; k < m.pins.size(); ++k) {
        bool holds = false;
        for (std::size_t p = 0; p < m.particles; ++p) {
          // A plane on the body's end face holds the layer of particles that it touches.
          const double reach =
              m.pins[k].region == Pin::Region::kPlane ? 0.51 * std::cbrt(body.volumes[p]) : 0.0;
          if (region_distance(m.pins[k], body.rest[p]).distance > reach) continue;
          holds = true;
          // Of pins that overlap the one that holds longest counts.
          std::uint8_t& of = m.pin_of[p];
          if (of == 0 || m.pins[k].release >= m.pins[of - 1U].release) {
            of = static_cast<std::uint8_t>(k + 1);
          }
        }
        if (!holds) {
          throw_input("Body '" + body.name + "': pin " + std::to_string(k) +
                      " holds no part of the body. Move its region onto the body.");
        }
      }
    }
    members.push_back(std::move(m));
    const std::size_t slot = members.size() - 1;

    Vec3d center = Vec3d::Zero();
    double volume = 0.0;
    for (std::size_t p = 0; p < body.rest.size(); ++p) {
      center += body.volumes[p] * body.rest[p];
      volume += body.volumes[p];
      largest_edge = std::max(largest_edge, std::cbrt(body.volumes[p]));
    }
    center /= volume;
    Mat3d spin;
    spin << 0, -body.spin[2], body.spin[1], body.spin[2], 0, -body.spin[0], -body.spin[1],
        body.spin[0], 0;
    for (std::size_t p = 0; p < body.rest.size(); ++p) {
      Crosser<float> particle{};
      particle.id = static_cast<std::uint32_t>(p);
      Vec3i block;
      int cell = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const double x = body.rest[p][axis] / dx;
        const double base = std::floor(x - 0.5);
        if (!(std::abs(base) < 1e8)) {
          throw_input("Body '" + body.name + "': particle " + std::to_string(p) +
                      " is too far from the origin for this particle separation.");
        }
        const int b = static_cast<int>(base);
        block[axis] = b >> 2;
        cell = cell * 4 + (b & 3);
        particle.f[axis] = static_cast<float>(x - base);
      }
      Vec3d v = body.velocity + spin * (body.rest[p] - center);
      if (!body.particle_velocities.empty()) v += body.particle_velocities[p];
      for (int i = 0; i < 3; ++i) {
        particle.velocity[i] = static_cast<float>(v[i]);
        for (int j = 0; j < 3; ++j) particle.affine[3 * i + j] = static_cast<float>(spin(i, j));
      }
      max_speed = std::max(max_speed, v.norm());
      particle.volume = static_cast<float>(body.volumes[p]);
      particle.cell = static_cast<std::uint8_t>(cell);
      const std::uint32_t at = blocks.ensure(block);
      blocks.occupy(at);
      blocks[at].leaving[slot].push_back(particle);
    }
  }

  /// The first transfer: every particle enters its block.
  void scatter_all() {
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      for (std::size_t m = 0; m < members.size(); ++m) {
        for (const Crosser<float>& particle : blocks[b].leaving[m]) {
          blocks[b].bodies[m].insert(particle);
          scatter(blocks[b], m, particle, 0.0F);
        }
        blocks[b].leaving[m].clear();
      }
    }
  }

  void scatter(UpdatedBlock& block, std::size_t m, const Crosser<float>& particle, float dt) const {
    const int cell[3] = {particle.cell / 16, particle.cell / 4 % 4, particle.cell % 4};
    kernels->updated_scatter(particle, cell, static_cast<float>(members[m].density),
                             static_cast<float>(dx), dt, block.halo.data());
  }

  [[nodiscard]] Vec3d block_origin(const UpdatedBlock& block) const {
    return block.coordinates.cast<double>() * (4.0 * dx);
  }

  /// World position of a lane's particle: cell (x, y, z) of the block plus f.
  [[nodiscard]] Vec3d position(const UpdatedBlock& block, std::size_t slab, const Chunk& chunk,
                               std::size_t lane) const {
    const Vec3d cell(static_cast<double>(slab), static_cast<double>(lane / 4),
                     static_cast<double>(lane % 4));
    const Vec3d f(static_cast<double>(chunk.a[0][lane]), static_cast<double>(chunk.a[1][lane]),
                  static_cast<double>(chunk.a[2][lane]));
    return block_origin(block) + (cell + f) * dx;
  }

  /// Calls visit(slab, chunk, lane) for each particle of a body in a block.
  template <class Visit>
  static void for_each(const BodyBlock& body, const Visit& visit) {
    for (std::size_t s = 0; s < kSlabs; ++s) {
      for (std::size_t l = 0; l < kLanes; ++l) {
        for (std::size_t k = 0; k < body.count[s][l]; ++k) visit(s, body.slab[s][k], l);
      }
    }
  }

  // --- grid -------------------------------------------------------------------------------------

  void update_grid(Arena& arena, double time, double kick, const Vec3d& gravity) {
    arena.parallel_for(0, blocks.size(), 4, [&](std::size_t b) {
      UpdatedBlock& block = blocks[b];
      float sum[4 * kBlockNodes] = {};
      for (std::size_t k = 0; k < 8; ++k) {
        const std::uint32_t other = block.neighbours[13 - (9 * (k / 4) + 3 * (k / 2 % 2) + k % 2)];
        if (other == kNoBlock || !blocks[other].occupied) continue;
        for (std::size_t c = 0; c < 4; ++c) {
          add_halo(k, blocks[other].halo.data() + c * kHaloNodes, sum + c * kBlockNodes);
        }
      }
      const float* mass = sum + 3 * kBlockNodes;
      for (std::size_t c = 0; c < 3; ++c) {
        const auto g = static_cast<float>(kick * gravity[static_cast<int>(c)]);
        for (std::size_t n = 0; n < kBlockNodes; ++n) {
          block.velocity[c * kBlockNodes + n] =
              mass[n] > 0.0F ? sum[c * kBlockNodes + n] / mass[n] + g : 0.0F;
        }
      }
      for (const ColliderPtr& collider : node_colliders) {
        apply_node_contact(*collider, block_origin(block), dx, time, mass, block.velocity.data());
      }
    });
  }

  // --- particles --------------------------------------------------------------------------------

  void move_block(std::size_t b, double dt) {
    UpdatedBlock& block = blocks[b];
    block.leaving_to = 0;
    block.sent_wake_time = block.wake_time;
    block.extremes = {1.0F, 1.0F};
    block.fastest = 0.0F;
    if (!block.occupied) return;
    std::fill(block.halo.begin(), block.halo.end(), 0.0F);
    UpdatedView<float> view{};
    for (std::size_t k = 0; k < 8; ++k) {
      const std::uint32_t other = block.neighbours[13 + 9 * (k / 4) + 3 * (k / 2 % 2) + k % 2];
      view.node_velocity[k] = blocks[other].velocity.data();
    }
    view.dx = static_cast<float>(dx);
    view.dt = static_cast<float>(dt);
    view.halo = block.halo.data();
    for (std::size_t m = 0; m < members.size(); ++m) {
      BodyBlock& body = block.bodies[m];
      bool any = false;
      for (std::size_t s = 0; s < kSlabs; ++s) {
        view.slab[s] = body.slab[s].data();
        view.chunks[s] = static_cast<std::uint32_t>(body.slab[s].size());
        any = any || view.chunks[s] > 0;
      }
      std::vector<Crosser<float>>& leaving = block.leaving[m];
      leaving.clear();
      if (!any) continue;
      view.law = members[m].law;
      view.density = static_cast<float>(members[m].density);
      view.maxwell = members[m].maxwell.empty() ? nullptr : members[m].maxwell.data();
      view.crossers = &leaving;
      kernels->updated_block(view);
      block.extremes.min_volume_ratio =
          std::min(block.extremes.min_volume_ratio, view.extremes.min_volume_ratio);
      block.extremes.max_volume_ratio =
          std::max(block.extremes.max_volume_ratio, view.extremes.max_volume_ratio);
      block.fastest = std::max(block.fastest, view.fastest);
      if (leaving.empty()) continue;
      for (Crosser<float>& p : leaving) address(block, p);
      body.remove(leaving);
    }
  }

  /// Where a leaver goes: neighbour block, cell there, and f relative to that cell.
  static void address(UpdatedBlock& block, Crosser<float>& p) {
    const int cell[3] = {p.slab, p.lane / 4, p.lane % 4};
    int neighbour = 0;
    int there = 0;
    for (int axis = 0; axis < 3; ++axis) {
      int c = cell[axis];
      if (p.f[axis] < 0.5F) {
        p.f[axis] += 1.0F;
        --c;
      } else if (p.f[axis] >= 1.5F) {
        p.f[axis] -= 1.0F;
        ++c;
      }
      neighbour = neighbour * 3 + (c < 0 ? 0 : c > 3 ? 2 : 1);
      there = there * 4 + (c & 3);
    }
    p.neighbour = static_cast<std::uint8_t>(neighbour);
    p.cell = static_cast<std::uint8_t>(there);
    block.leaving_to |= 1U << static_cast<unsigned>(neighbour);
  }

  /// Serial: blocks that arrivals need. In block order, so that indices never depend on threads.
  void make_room() {
    const std::size_t before = blocks.size();
    for (std::size_t b = 0; b < before; ++b) {
      const std::uint32_t to = blocks[b].leaving_to;
      if (to == 0) continue;
      for (int k = 0; k < 27; ++k) {
        if ((to >> static_cast<unsigned>(k) & 1U) == 0) continue;
        const Vec3i step(k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1);
        blocks.occupy(blocks.ensure(blocks[b].coordinates + step));
      }
    }
    if (blocks.size() != before &&
        blocks.size() * UpdatedBlocks::bytes_per_block() > memory_limit) {
      std::ostringstream text;
      text << "The grid has grown to " << blocks.size() << " blocks, more than the memory limit of "
           << (memory_limit >> 20U)
           << " MB holds: particles fly apart. Add walls or a ground, shorten the frame range, or "
              "raise the limit.";
      throw_compute(text.str());
    }
  }

  void take_in(std::size_t b, double dt) {
    UpdatedBlock& block = blocks[b];
    if (!block.occupied) return;
    for (std::size_t k = 0; k < 27; ++k) {
      const std::uint32_t other = block.neighbours[k];
      const std::size_t towards_me = 26 - k;
      if (other == kNoBlock || (blocks[other].leaving_to >> towards_me & 1U) == 0) continue;
      // Arrivals may touch as soon as they might have where they come from.
      block.wake_time = std::min(block.wake_time, blocks[other].sent_wake_time);
      for (std::size_t m = 0; m < members.size(); ++m) {
        for (const Crosser<float>& p : blocks[other].leaving[m]) {
          if (p.neighbour != towards_me) continue;
          block.bodies[m].insert(p);
          scatter(block, m, p, static_cast<float>(dt));
        }
      }
    }
  }

  /// Adds momentum (and mass) at the nodes of a particle, `offset` [m] from it.
  void add_momentum(UpdatedBlock& block, std::size_t slab, const Chunk& chunk, std::size_t lane,
                    const Vec3f& momentum, float mass, const Vec3d& offset = Vec3d::Zero()) const {
    // Towards the edge of the outer node's support the offset shrinks: a node that has mass from
    // this particle alone gets no more than four times its share.
    float f[3];
    float o[3];
    float reach = 1.0F;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      f[axis] = chunk.a[Chunk::kF + axis][lane];
      o[axis] = static_cast<float>(offset[static_cast<int>(axis)] / dx);
      const float to_edge = o[axis] < 0.0F ? 1.5F - f[axis] : f[axis] - 0.5F;
      reach = std::min(reach, to_edge / std::max(std::abs(o[axis]), 1e-6F));
    }
    float w[3][3];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      quadratic_weights(f[axis] + std::max(reach, 0.0F) * o[axis], w[axis]);
    }
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        for (std::size_t k = 0; k < 3; ++k) {
          const std::size_t node = halo_index(slab + i, lane / 4 + j, lane % 4 + k);
          const float weight = w[0][i] * w[1][j] * w[2][k];
          for (std::size_t c = 0; c < 3; ++c) {
            block.halo[c * kHaloNodes + node] += weight * momentum[static_cast<int>(c)];
          }
          block.halo[3 * kHaloNodes + node] += weight * mass;
        }
  }

  /// ∇v of the nodes at a particle [1/s], before this substep's contacts.
  [[nodiscard]] Mat3d velocity_gradient(const UpdatedBlock& block, std::size_t slab,
                                        const Chunk& chunk, std::size_t lane) const {
    const PointStencil s(Vec3d(static_cast<double>(chunk.a[Chunk::kF][lane]),
                               static_cast<double>(chunk.a[Chunk::kF + 1][lane]),
                               static_cast<double>(chunk.a[Chunk::kF + 2][lane])),
                         dx);
    Mat3d gradient = Mat3d::Zero();
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        for (std::size_t k = 0; k < 3; ++k) {
          const std::size_t x = slab + i;
          const std::size_t y = lane / 4 + j;
          const std::size_t z = lane % 4 + k;
          const std::uint32_t at = block.neighbours[13 + 9 * (x / 4) + 3 * (y / 4) + z / 4];
          const float* v = blocks[at].velocity.data() + node_index(x % 4, y % 4, z % 4);
          const Vec3d g = s.gradient(i, j, k);
          for (std::size_t c = 0; c < 3; ++c) {
            gradient.row(static_cast<int>(c)) +=
                static_cast<double>(v[c * kBlockNodes]) * g.transpose();
          }
        }
    return gradient;
  }

  void touch(std::size_t b, double time, double dt) {
    UpdatedBlock& block = blocks[b];
    if (!block.occupied || particle_colliders.empty() || time < block.wake_time) return;
    double gap = 1e30;
    double closing = 0.0;
    bool touching = false;
    // Distances change by no more than the way: one query rules out most colliders for a block.
    const Vec3d middle = block_origin(block) + Vec3d::Constant(2.5 * dx);
    const double reach = 2.0 * std::sqrt(3.0) * dx + 2.0 * largest_edge;
    bool animated = false;
    std::vector<std::size_t> near;
    for (std::size_t c = 0; c < particle_colliders.size(); ++c) {
      const SurfacePoint surface = particle_colliders[c]->closest(middle, time);
      animated = animated || particle_colliders[c]->animated();
      if (surface.distance > reach) {
        gap = std::min(gap, surface.distance - reach);
        closing = std::max(closing, max_speed + surface.velocity.norm());
      } else {
        near.push_back(c);
      }
    }
    for (std::size_t m = 0; m < members.size() && !near.empty(); ++m) {
      Member& member = members[m];
      const bool fluid = member.law.law == material::Law::kNewtonian ||
                         member.law.law == material::Law::kHerschelBulkley;
      for_each(block.bodies[m], [&](std::size_t s, const Chunk& chunk, std::size_t l) {
        const Vec3d x = position(block, s, chunk, l);
        const Vec3d v = velocity(chunk, l);
        ContactMemory& memory = member.memory[chunk.id[l]];
        for (const std::size_t c : near) {
          const SurfacePoint surface = particle_colliders[c]->closest(x, time);
          const auto id = static_cast<std::int32_t>(c);
          closing = std::max(closing, (v - surface.velocity).norm());
          if (surface.distance > 2.0 * largest_edge && memory.surface != id) {
            gap = std::min(gap, surface.distance - 2.0 * largest_edge);
            continue;
          }
          const double volume = static_cast<double>(chunk.a[Chunk::kVolume][l]);
          ContactPoint point =
              contact_point(surface, deformation_gradient(chunk, l), volume, member.density, v);
          if (fluid && (point.distance < point.radius || memory.surface == id)) {
            // A fluid sticks by its face, and is sheared from there. A solid is told by its centre,
            // whose velocity is the rate of its position to the last digit: nothing creeps.
            point.relative_velocity -=
                point.radius * (velocity_gradient(block, s, chunk, l) * point.normal);
          }
          const Vec3d force = contact_force(member.contacts[c], point, id, dt, memory);
          if (!force.isZero(0.0)) {
            const Vec3d impulse = dt * force;
            if (fluid) {
              // The normal part at the centre: on the face it would depend on where the face is in
              // its cell (a ball's rebound by 9 %).
              const Vec3d normal = point.normal.dot(impulse) * point.normal;
              add_momentum(block, s, chunk, l, normal.cast<float>(), 0.0F);
              add_momentum(block, s, chunk, l, (impulse - normal).cast<float>(), 0.0F,
                           -point.radius * point.normal);
            } else {
              add_momentum(block, s, chunk, l, impulse.cast<float>(), 0.0F);
            }
            touching = true;
            block.penetration = std::max(block.penetration, point.radius - point.distance);
          }
          gap = std::min(gap, surface.distance - point.radius);
        }
      });
    }
    if (touching || gap <= 0.0) return;
    // Particles come and go: at most a cell's worth of time, whatever is near.
    block.wake_time = time + contact_free_time(std::min(gap, dx), std::max(closing, max_speed),
                                               pull, frame_seconds, animated);
  }

  void pin(std::size_t b, double time, double dt) {
    UpdatedBlock& block = blocks[b];
    if (!block.occupied) return;
    for (std::size_t m = 0; m < members.size(); ++m) {
      const Member& member = members[m];
      if (member.pin_of.empty()) continue;
      for_each(block.bodies[m], [&](std::size_t s, const Chunk& chunk, std::size_t l) {
        const std::uint8_t k = member.pin_of[chunk.id[l]];
        if (k == 0 || time >= member.pins[k - 1U].release - 1e-12) return;
        const Pin& p = member.pins[k - 1U];
        const Pose pose = p.motion.at(time + dt);
        const Vec3d rest = member.rest[chunk.id[l]];
        const Vec3d target = p.pivot + pose.rotation * (rest - p.pivot) + pose.position;
        const Vec3d velocity = (target - position(block, s, chunk, l)) / dt;
        const float mass =
            kPinWeight * static_cast<float>(member.density) * chunk.a[Chunk::kVolume][l];
        add_momentum(block, s, chunk, l, mass * velocity.cast<float>(), mass);
      });
    }
  }

  /// Throws if a particle has gone wrong in the substep from `time`: it is named, with the reason.
  void check(double time, double dt, double least, float fastest) const {
    if (least > 0.0 && fastest < 1.0F) return;
    const double fastest_speed = 0.999 * static_cast<double>(fastest) * dx / dt;
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      for (std::size_t m = 0; m < members.size(); ++m) {
        const auto look = [&](std::uint32_t id, const Vec3d& x, const Mat3d& f, const Vec3d& v) {
          const double j = f.determinant();
          std::string what;
          if (!std::isfinite(j) || !v.allFinite()) {
            what = "is not a number";
          } else if (!(j > 0.0)) {
            what = "is turned inside out (volume ratio " + std::to_string(j) + ")";
          } else if (fastest >= 1.0F && v.cwiseAbs().maxCoeff() >= fastest_speed) {
            what = "moves more than a cell in one substep, at " + std::to_string(v.norm()) + " m/s";
          }
          if (!what.empty()) fail(time, m, id, x, what);
        };
        for_each(blocks[b].bodies[m], [&](std::size_t s, const Chunk& chunk, std::size_t l) {
          look(chunk.id[l], position(blocks[b], s, chunk, l), deformation_gradient(chunk, l),
               velocity(chunk, l));
        });
        for (const Crosser<float>& p : blocks[b].leaving[m]) {
          Mat3d f = Mat3d::Identity();
          for (int i = 0; i < 9; ++i) f(i / 3, i % 3) += static_cast<double>(p.h[i]);
          const Vec3d x = block_origin(blocks[b]) + Vec3d::Constant(2.5 * dx);
          look(p.id, x, f, Vec3f(p.velocity[0], p.velocity[1], p.velocity[2]).cast<double>());
        }
      }
    }
    fail(time, 0, 0, Vec3d::Zero(), "or another one is turned inside out or not a number");
  }

  [[noreturn]] void fail(double time, std::size_t member, std::uint32_t particle, const Vec3d& x,
                         const std::string& what) const {
    const int frame = scene->first_frame + static_cast<int>(std::floor(time * scene->fps + 1e-6));
    std::ostringstream text;
    text << "Body '" << members[member].name << "', frame " << frame << " (" << time
         << " s): particle " << particle << " at (" << x[0] << ", " << x[1] << ", " << x[2]
         << ") m " << what
         << ". Use a smaller scene.solver.dt_safety or particle separation, or gentler motion.";
    throw UnstableError(text.str());
  }
};

UpdatedGroup::UpdatedGroup(const Scene& scene, const std::vector<std::size_t>& bodies,
                           const Kernels<float>& kernels, std::size_t memory_limit)
    : impl_(std::make_unique<Impl>(scene, bodies, kernels, memory_limit)) {}
UpdatedGroup::~UpdatedGroup() = default;

std::pair<double, std::string> UpdatedGroup::begin_frame(double time) {
  Impl& s = *impl_;
  s.blocks.tidy();
  s.pull = std::max(s.scene->gravity.at(time).norm(),
                    s.scene->gravity.at(time + s.frame_seconds).norm());
  for (std::size_t b = 0; b < s.blocks.size(); ++b) {
    s.blocks[b].wake_time = -1e30;
    s.blocks[b].penetration = 0.0;
  }
  double best = std::numeric_limits<double>::infinity();
  std::string reason;
  const auto limit = [&](double dt, const std::string& why) {
    if (dt < best) {
      best = dt;
      reason = why;
    }
  };
  for (const Member& m : s.members) {
    double stiffening = 1.0;
    if (m.law.law == material::Law::kNewtonian) {
      // Tangent of (K/7)(J − J⁻⁶) against K.
      stiffening = (1.0 + 6.0 * std::pow(std::clamp(s.min_j, 0.3, 1.0), -7.0)) / 7.0;
    }
    const double c = m.material.wave_speed(m.density) * std::sqrt(stiffening);
    double rate = c / (0.5 * s.dx);
    double contact = 0.0;
    for (const ContactLaw& law : m.contacts) {
      contact = std::max(contact, law.stiffness / (m.density * 0.5 * s.dx));
    }
    rate = std::sqrt(rate * rate + 0.5 * contact);
    limit(1.0 / rate, (contact > rate * rate ? "contact of " : "elastic wave of ") + m.name);
    double viscosity = 2.0 * m.material.damping_shear + m.material.damping_bulk;
    if (m.law.law == material::Law::kNewtonian) viscosity += 2.0 * m.material.viscosity;
    if (viscosity > 0.0) {
      limit(0.15 * m.density * s.dx * s.dx / viscosity, "viscosity of " + m.name);
    }
  }
  const double speed = s.max_speed + s.pull * s.frame_seconds;
  if (speed > 0.0) limit(s.scene->cfl * s.dx / speed, "CFL");
  return {best, reason};
}

std::pair<double, double> UpdatedGroup::step(Arena& arena, double time, double dt,
                                             const Vec3d& gravity) {
  Impl& s = *impl_;
  s.update_grid(arena, time, 0.5 * (s.last_dt + dt), gravity);
  const std::size_t count = s.blocks.size();
  arena.parallel_for(0, count, 1, [&](std::size_t b) { s.move_block(b, dt); });
  double least = 1.0;
  double most = 1.0;
  float fastest = 0.0F;
  for (std::size_t b = 0; b < count; ++b) {
    least = std::min(least, static_cast<double>(s.blocks[b].extremes.min_volume_ratio));
    most = std::max(most, static_cast<double>(s.blocks[b].extremes.max_volume_ratio));
    fastest = std::max(fastest, s.blocks[b].fastest);
  }
  s.check(time, dt, least, fastest);
  s.min_j = least;
  s.max_speed = static_cast<double>(fastest) * s.dx / dt * std::sqrt(3.0);
  s.make_room();
  arena.parallel_for(0, s.blocks.size(), 1, [&](std::size_t b) {
    s.take_in(b, dt);
    s.touch(b, time + dt, dt);
    s.pin(b, time + dt, dt);
  });
  s.last_dt = dt;
  return {least, most};
}

void UpdatedGroup::collect(const Vec3d& low, const Vec3d& high,
                           std::vector<UpdatedPoint>& out) const {
  const Impl& s = *impl_;
  out.clear();
  for (std::size_t b = 0; b < s.blocks.size(); ++b) {
    const UpdatedBlock& block = s.blocks[b];
    if (!block.occupied) continue;
    const Vec3d from = s.block_origin(block);
    if ((from.array() > high.array()).any() ||
        ((from + Vec3d::Constant(5.0 * s.dx)).array() < low.array()).any()) {
      continue;
    }
    for (std::size_t m = 0; m < s.members.size(); ++m) {
      for (std::size_t slab = 0; slab < kSlabs; ++slab)
        for (std::size_t l = 0; l < kLanes; ++l)
          for (std::size_t k = 0; k < block.bodies[m].count[slab][l]; ++k) {
            const Chunk& chunk = block.bodies[m].slab[slab][k];
            const Vec3d x = s.position(block, slab, chunk, l);
            if ((x.array() < low.array()).any() || (x.array() > high.array()).any()) continue;
            UpdatedPoint p;
            p.block = static_cast<std::uint32_t>(b);
            p.body = static_cast<std::uint32_t>(s.members[m].index);
            p.member = static_cast<std::uint32_t>(m);
            p.slab = static_cast<std::uint32_t>(slab);
            p.chunk = static_cast<std::uint32_t>(k);
            p.lane = static_cast<std::uint32_t>(l);
            p.id = chunk.id[l];
            p.position = x;
            p.velocity = velocity(chunk, l);
            p.volume = static_cast<double>(chunk.a[Chunk::kVolume][l]);
            p.mass = p.volume * s.members[m].density;
            out.push_back(p);
          }
    }
  }
}

void UpdatedGroup::add_impulse(const UpdatedPoint& p, const Vec3d& impulse) {
  Impl& s = *impl_;
  UpdatedBlock& block = s.blocks[p.block];
  s.add_momentum(block, p.slab, block.bodies[p.member].slab[p.slab][p.chunk], p.lane,
                 impulse.cast<float>(), 0.0F);
}

double UpdatedGroup::max_speed() const { return impl_->max_speed; }

void UpdatedGroup::sample(std::vector<BodyState>& bodies) const {
  const Impl& s = *impl_;
  for (std::size_t m = 0; m < s.members.size(); ++m) {
    BodyState& out = bodies[s.members[m].index];
    const std::size_t n = s.members[m].particles;
    out.positions.resize(n);
    out.velocities.resize(n);
    out.deformation_gradients.resize(n);
    out.plastic_strain.resize(s.members[m].law.plastic ? n : 0);
    for (std::size_t b = 0; b < s.blocks.size(); ++b) {
      Impl::for_each(
          s.blocks[b].bodies[m], [&](std::size_t slab, const Chunk& chunk, std::size_t l) {
            const std::uint32_t p = chunk.id[l];
            out.positions[p] = s.position(s.blocks[b], slab, chunk, l).cast<float>();
            for (int c = 0; c < 3; ++c) {
              out.velocities[p][c] = chunk.a[Chunk::kVelocity + static_cast<std::size_t>(c)][l];
            }
            for (int c = 0; c < 9; ++c) {
              out.deformation_gradients[p](c / 3, c % 3) =
                  chunk.a[Chunk::kH + static_cast<std::size_t>(c)][l] + (c % 4 == 0 ? 1.0F : 0.0F);
            }
            if (s.members[m].law.plastic) out.plastic_strain[p] = chunk.a[Chunk::kStrain][l];
          });
    }
  }
}

void UpdatedGroup::report(FrameReport& report) const {
  const Impl& s = *impl_;
  report.max_speed = std::max(report.max_speed, s.max_speed);
  for (std::size_t b = 0; b < s.blocks.size(); ++b) {
    report.max_penetration = std::max(report.max_penetration, s.blocks[b].penetration);
    for (std::size_t m = 0; m < s.members.size(); ++m) {
      double sum = 0.0;
      Impl::for_each(s.blocks[b].bodies[m], [&](std::size_t, const Chunk& chunk, std::size_t l) {
        double v2 = 0.0;
        for (std::size_t c = 0; c < 3; ++c) {
          const auto v = static_cast<double>(chunk.a[Chunk::kVelocity + c][l]);
          v2 += v * v;
        }
        sum += v2 * static_cast<double>(chunk.a[Chunk::kVolume][l]);
      });
      report.kinetic_energy += 0.5 * s.members[m].density * sum;
    }
  }
}

void UpdatedGroup::save(ByteWriter& out) const {
  const Impl& s = *impl_;
  s.blocks.save(out);
  out.put(s.last_dt);
  out.put(s.max_speed);
  out.put(s.min_j);
  for (const Member& m : s.members) {
    out.put(m.memory);
    out.put(m.maxwell);
  }
}

void UpdatedGroup::load(ByteReader& in) {
  Impl& s = *impl_;
  s.blocks.load(in);
  in.get(s.last_dt);
  in.get(s.max_speed);
  in.get(s.min_j);
  for (Member& m : s.members) {
    in.get_same_size(m.memory);
    in.get_same_size(m.maxwell);
  }
  for (std::size_t b = 0; b < s.blocks.size(); ++b) {
    for (std::size_t m = 0; m < s.members.size(); ++m) {
      Impl::for_each(s.blocks[b].bodies[m], [&](std::size_t, const Chunk& chunk, std::size_t l) {
        if (chunk.id[l] >= s.members[m].particles) ByteReader::fail();
      });
    }
  }
}

}  // namespace matterfit::mpm
