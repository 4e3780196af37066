// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/body_contact.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

#include "mpm/cell_hash.hpp"

namespace matterfit::mpm {
namespace {

/// Contact of a pair as the scene gives it, or the default.
shape::Contact pair_contact(const Scene& scene, const std::string& a, const std::string& b) {
  for (const BodyContact& c : scene.contacts) {
    if ((c.first == a && c.second == b) || (c.first == b && c.second == a)) return c.contact;
  }
  return {};
}

using Cell = std::array<int, 3>;

}  // namespace

/// A skin's points in reach, hashed.
struct BodyContacts::Surface {
  const Skin& skin;
  double reach;
  std::unordered_map<Cell, std::vector<std::uint32_t>, CellHash> cells;

  Surface(const Skin& s, double r, const Vec3d& low, const Vec3d& high) : skin(s), reach(r) {
    for (std::uint32_t i = 0; i < s.positions.size(); ++i) {
      const Vec3d& x = s.positions[i];
      // Written so that what is not a number is left out: the body's own check names it.
      const bool near =
          (x.array() >= low.array() - r).all() && (x.array() <= high.array() + r).all();
      if (!near) continue;
      cells[cell(x)].push_back(i);
    }
  }
  [[nodiscard]] Cell cell(const Vec3d& x) const {
    return {static_cast<int>(std::floor(x[0] / reach)), static_cast<int>(std::floor(x[1] / reach)),
            static_cast<int>(std::floor(x[2] / reach))};
  }

  struct Seen {
    double distance = 1e30;
    Vec3d normal = Vec3d::Zero();
    Vec3d velocity = Vec3d::Zero();
    std::vector<std::pair<std::uint32_t, double>> weights;
  };
  [[nodiscard]] Seen see(const Vec3d& x) const {
    Seen seen;
    const Cell middle = cell(x);
    double sum = 0.0;
    double distance = 0.0;
    for (int k = 0; k < 27; ++k) {
      const Cell at{middle[0] + k / 9 - 1, middle[1] + k / 3 % 3 - 1, middle[2] + k % 3 - 1};
      const auto found = cells.find(at);
      if (found == cells.end()) continue;
      for (const std::uint32_t i : found->second) {
        const double q = (x - skin.positions[i]).squaredNorm() / (reach * reach);
        if (q >= 1.0) continue;
        const double w = (1.0 - q) * (1.0 - q) * (1.0 - q);
        sum += w;
        distance += w * (x - skin.positions[i]).dot(skin.normals[i]);
        seen.normal += w * skin.normals[i];
        seen.velocity += w * skin.velocities[i];
        seen.weights.emplace_back(i, w);
      }
    }
    if (!(sum > 0.0) || !(seen.normal.norm() > 0.1 * sum)) {
      seen.weights.clear();
      return seen;
    }
    seen.distance = distance / sum;
    seen.velocity /= sum;
    seen.normal.normalize();
    for (auto& [i, w] : seen.weights) w /= sum;
    return seen;
  }
};

BodyContacts::BodyContacts(const Scene& scene, const std::vector<Member>& total,
                           ParticleBodies<float>* particles,
                           const std::vector<std::size_t>& without_skin)
    : particles_(particles) {
  if (total.empty() || total.size() + without_skin.size() < 2) return;
  for (const Member& member : total) {
    Skin skin{};
    skin.index = member.index;
    skin.body = member.body;
    skin.density = member.body->density();
    skin.edge = 0.5 * scene.dx;
    skin.response = member.body->grid().contact_response();
    for (std::uint32_t p = 0; p < member.body->particles(); ++p) {
      if (!member.body->is_surface(p)) continue;
      skin.particles.push_back(p);
      skin.rest_normals.push_back(member.body->grid().axes() *
                                  member.body->grid().outward_normal(p));
      const Vec3d& out = skin.rest_normals.back();
      skin.offsets.push_back(member.body->grid().reach(p, out).distance * out);
    }
    skins_.push_back(std::move(skin));
  }
  const auto add = [&](std::size_t surface, std::size_t skin, std::size_t body, double share) {
    const Body& looking = scene.bodies[body];
    const Body& seen = scene.bodies[skins_[surface].index];
    const shape::Contact contact = pair_contact(scene, looking.name, seen.name);
    Pair pair;
    pair.surface = surface;
    pair.skin = skin;
    pair.looking = body;
    pair.law = resolve_contact(contact, looking, scene.dx);
    pair.law.stiffness =
        share * std::min(pair.law.stiffness, resolve_contact(contact, seen, scene.dx).stiffness);
    pair.law.firm_at = 0.0;  // both sides give way anyhow
    pair.memory.resize(looking.rest.size());
    // Both sides give way; a pair of skins has half the stiffness in each of its two directions.
    const double other =
        skin == kWithoutSkin ? 1.0 / (looking.density * 0.5 * scene.dx) : skins_[skin].response;
    frequency_squared_ = std::max(frequency_squared_,
                                  pair.law.stiffness / share * (skins_[surface].response + other));
    pairs_.push_back(std::move(pair));
  };
  for (std::size_t a = 0; a < skins_.size(); ++a) {
    for (std::size_t b = 0; b < skins_.size(); ++b) {
      if (a != b) add(a, b, skins_[b].index, 0.5);
    }
    for (const std::size_t body : without_skin) add(a, kWithoutSkin, body, 1.0);
  }
}

void BodyContacts::wake() {
  for (Pair& pair : pairs_) pair.wake = -1e300;
}

void BodyContacts::refresh(Arena& arena, Skin& skin, double time, bool with_normals) {
  const std::size_t count = skin.particles.size();
  const bool fresh = skin.at == time && (!with_normals || skin.normals.size() == count);
  if (fresh) return;
  skin.positions.resize(count);
  skin.velocities.resize(count);
  skin.normals.resize(with_normals ? count : 0);
  arena.parallel_for(0, count, 64, [&](std::size_t i) {
    const std::uint32_t p = skin.particles[i];
    const auto state = skin.body->state(skin.body->point(p, skin.offsets[i]));
    skin.positions[i] = state.position;
    skin.velocities[i] = state.velocity;
    if (!with_normals) return;
    const Mat3d f = skin.body->deformation_gradient(skin.body->point(p));
    skin.normals[i] = (f.inverse().transpose() * skin.rest_normals[i]).normalized();
  });
  skin.low = Vec3d::Constant(1e300);
  skin.high = Vec3d::Constant(-1e300);
  skin.speed = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    skin.low = skin.low.cwiseMin(skin.positions[i]);
    skin.high = skin.high.cwiseMax(skin.positions[i]);
    skin.speed = std::max(skin.speed, skin.velocities[i].norm());
  }
  skin.at = time;
}

void BodyContacts::add_load(const Skin& skin, std::size_t i, const Vec3d& force) {
  const std::uint32_t p = skin.particles[i];
  skin.body->add_load(p, skin.body->point(p, skin.offsets[i]), force);
}

void BodyContacts::apply(Arena& arena, double time, double dt, double acceleration,
                         double frame_seconds) {
  struct Looking {
    Vec3d position, velocity;
    double radius, area, mass;
    std::uint32_t id;
    std::size_t source;
  };
  for (Pair& pair : pairs_) {
    if (time < pair.wake) continue;
    Skin& seen = skins_[pair.surface];
    refresh(arena, seen, time, false);
    const double reach = 2.5 * seen.edge;
    std::vector<Looking> looking;
    std::vector<BodyPoint<float>> points;
    double distance = 0.0;  // between the bounding boxes
    double speed = seen.speed + (pair.skin == kWithoutSkin ? particles_->max_speed() : 0.0);
    if (pair.skin != kWithoutSkin) {
      Skin& other = skins_[pair.skin];
      refresh(arena, other, time, false);
      distance = (seen.low - other.high).cwiseMax(other.low - seen.high).cwiseMax(0.0).norm();
      speed += other.speed;
      if (distance <= reach) {
        const Vec3d low = seen.low - Vec3d::Constant(reach);
        const Vec3d high = seen.high + Vec3d::Constant(reach);
        for (std::size_t i = 0; i < other.particles.size(); ++i) {
          const Vec3d& x = other.positions[i];
          if (!((x.array() >= low.array()).all() && (x.array() <= high.array()).all())) continue;
          const std::uint32_t p = other.particles[i];
          const double volume = other.body->volume(p);
          const double edge = std::cbrt(volume);
          looking.push_back(
              {x, other.velocities[i], 0.0, edge * edge, other.density * volume, p, i});
        }
      }
    } else {
      particles_->collect(seen.low - Vec3d::Constant(reach), seen.high + Vec3d::Constant(reach),
                          points);
      for (std::size_t i = 0; i < points.size(); ++i) {
        if (points[i].body != pair.looking) continue;
        const double edge = std::cbrt(points[i].volume);
        looking.push_back({points[i].position, points[i].velocity, 0.5 * edge, edge * edge,
                           points[i].mass, points[i].id, i});
      }
    }
    if (looking.empty()) {
      const double fastest = 2.0 * speed + 2.0 * acceleration * frame_seconds + 1e-9;
      // Particles without a skin were not seen: they may be just outside the reach.
      const double gap = pair.skin == kWithoutSkin ? 0.25 * reach : std::max(distance, 0.1 * reach);
      pair.wake = time + std::min(0.25 * frame_seconds, 0.25 * gap / fastest);
      continue;
    }
    refresh(arena, seen, time, true);
    Vec3d low = looking.front().position;
    Vec3d high = low;
    for (const Looking& l : looking) {
      low = low.cwiseMin(l.position);
      high = high.cwiseMax(l.position);
    }
    const Surface surface(seen, reach, low, high);
    std::vector<Vec3d> forces(looking.size(), Vec3d::Zero());
    std::vector<Surface::Seen> views(looking.size());
    arena.parallel_for(0, looking.size(), 32, [&](std::size_t i) {
      const Looking& l = looking[i];
      Surface::Seen view = surface.see(l.position);
      if (view.weights.empty()) {
        pair.memory[l.id] = {};
        return;
      }
      ContactPoint point;
      point.distance = view.distance;
      point.radius = l.radius;
      point.area = l.area;
      point.mass = l.mass;
      point.normal = view.normal;
      point.relative_velocity = l.velocity - view.velocity;
      forces[i] = contact_force(pair.law, point, 0, dt, pair.memory[l.id]);
      views[i] = std::move(view);
    });
    // In order, on one thread: sums must not depend on threads.
    for (std::size_t i = 0; i < looking.size(); ++i) {
      if (forces[i].isZero(0.0)) continue;
      if (pair.skin == kWithoutSkin) {
        particles_->push(points[looking[i].source], forces[i], dt);
      } else {
        add_load(skins_[pair.skin], looking[i].source, forces[i]);
      }
      for (const auto& [k, w] : views[i].weights) {
        add_load(seen, k, -w * forces[i]);
      }
    }
  }
}

void BodyContacts::save(ByteWriter& out) const {
  for (const Pair& pair : pairs_) out.put(pair.memory);
}

void BodyContacts::load(ByteReader& in) {
  for (Pair& pair : pairs_) {
    in.get_same_size(pair.memory);
    pair.wake = -1e300;
  }
  for (Skin& skin : skins_) skin.at = -1e300;
}

}  // namespace matterfit::mpm
