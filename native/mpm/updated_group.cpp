// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_group.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <utility>

#include "base/cancel_check.hpp"
#include "base/error.hpp"
#include "mpm/halo.hpp"
#include "mpm/initial_velocity.hpp"
#include "mpm/law_kernels.hpp"
#include "mpm/node_contact.hpp"
#include "mpm/updated_check.hpp"
#include "mpm/updated_contact.hpp"
#include "mpm/updated_grid.hpp"
#include "mpm/updated_limit.hpp"
#include "mpm/updated_loads.hpp"
#include "mpm/updated_record.hpp"

namespace matterfit::mpm {

template <class S>
struct UpdatedGroup<S>::Impl {
  using Chunk = UpdatedChunk<S>;
  const Scene* scene;
  const Kernels<S>* kernels;
  std::size_t memory_limit;
  double dx;
  std::vector<UpdatedMember<S>> members;
  std::vector<shape::ColliderPtr> node_colliders;
  std::optional<UpdatedLoads<S>> loads;  ///< of the members, when all are there
  UpdatedGrid<S> grid;
  UpdatedBlocks<S>& blocks;
  std::shared_ptr<const UpdatedTopology> topology;  ///< of `blocks`, or null: not taken yet
  double last_dt = 0.0;
  double max_speed = 0.0;
  double min_j = 1.0;
  double frame_seconds = 0.0;
  double pull = 0.0;  ///< the largest acceleration by gravity and terms in this frame [m/s²]
  double term_acceleration = 0.0;

  Impl(const Scene& s, const std::vector<std::size_t>& bodies, const Kernels<S>& k,
       std::size_t limit, const Interrupter* interrupter)
      : scene(&s),
        kernels(&k),
        memory_limit(limit),
        dx(s.dx),
        node_colliders(colliders_met(s, true)),
        grid(s.dx, bodies.size()),
        blocks(grid.blocks) {
    frame_seconds = 1.0 / s.fps;
    CancelCheck check(interrupter);
    const std::vector<shape::ColliderPtr> met = colliders_met(s, false);
    for (const std::size_t index : bodies) add_member(s.bodies[index], index, met, check);
    loads.emplace(s, bodies, members);
    scatter_all(check);
  }

  void add_member(const Body& body, std::size_t index, const std::vector<shape::ColliderPtr>& met,
                  CancelCheck& check) {
    members.push_back(make_updated_member<S>(body, index, met, dx));
    const std::size_t slot = members.size() - 1;
    const Vec3d center = center_of_volume(body);
    for (std::size_t p = 0; p < body.rest.size(); ++p) {
      check();
      max_speed = std::max(max_speed, start_velocity(body, p, center).norm());
      const UpdatedStart<S> start = updated_start<S>(body, p, dx, center);
      const std::uint32_t at = blocks.ensure(start.block);
      blocks.occupy(at);
      blocks[at].leaving[slot].push_back(start.particle);
    }
  }

  /// The first transfer: every particle enters its block.
  void scatter_all(CancelCheck& check) {
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      for (std::size_t m = 0; m < members.size(); ++m) {
        for (const Crosser<S>& particle : blocks[b].leaving[m]) {
          check();
          blocks[b].bodies[m].insert(particle);
          scatter(blocks[b], m, particle, S(0));
        }
        blocks[b].leaving[m].clear();
      }
    }
  }

  void scatter(UpdatedBlock<S>& block, std::size_t m, const Crosser<S>& particle, S dt) const {
    const int cell[3] = {particle.cell / 16, particle.cell / 4 % 4, particle.cell % 4};
    kernels->updated_scatter(particle, cell, static_cast<S>(members[m].density), static_cast<S>(dx),
                             dt, block.halo.data());
  }

  [[nodiscard]] std::shared_ptr<const UpdatedTopology> present_topology() {
    if (!topology || topology->coordinates.size() != blocks.size())
      topology = take_topology(blocks);
    return topology;
  }

  // --- grid -------------------------------------------------------------------------------------

  void update_grid(Arena& arena, double time, double kick, const Vec3d& gravity,
                   UpdatedRecord<S>* record) {
    arena.parallel_for(0, blocks.size(), 4, [&](std::size_t b) {
      UpdatedBlock<S>& block = blocks[b];
      S sum[4 * kBlockNodes] = {};
      for (std::size_t k = 0; k < 8; ++k) {
        const std::uint32_t other = block.neighbours[13 - (9 * (k / 4) + 3 * (k / 2 % 2) + k % 2)];
        if (other == kNoBlock || !blocks[other].occupied) continue;
        for (std::size_t c = 0; c < 4; ++c) {
          add_halo(k, blocks[other].halo.data() + c * kHaloNodes, sum + c * kBlockNodes);
        }
      }
      const S* mass = sum + 3 * kBlockNodes;
      for (std::size_t c = 0; c < 3; ++c) {
        const auto g = static_cast<S>(kick * gravity[static_cast<int>(c)]);
        for (std::size_t n = 0; n < kBlockNodes; ++n) {
          block.velocity[c * kBlockNodes + n] =
              mass[n] > S(0) ? sum[c * kBlockNodes + n] / mass[n] + g : S(0);
        }
      }
      if (record != nullptr) {
        std::copy_n(mass, kBlockNodes, record->node_mass.data() + b * kBlockNodes);
        std::copy(block.velocity.begin(), block.velocity.end(),
                  record->node_velocity.data() + b * 3 * kBlockNodes);
      }
      for (const shape::ColliderPtr& collider : node_colliders) {
        apply_node_contact(*collider, grid.origin(b), dx, time, mass, block.velocity.data());
      }
    });
  }

  // --- particles --------------------------------------------------------------------------------

  void move_block(std::size_t b, double dt) {
    UpdatedBlock<S>& block = blocks[b];
    block.leaving_to = 0;
    block.sent_wake_time = block.wake_time;
    block.extremes = {S(1), S(1)};
    block.fastest = S(0);
    if (!block.occupied) return;
    std::fill(block.halo.begin(), block.halo.end(), S(0));
    UpdatedView<S> view{};
    for (std::size_t k = 0; k < 8; ++k) {
      const std::uint32_t other = block.neighbours[13 + 9 * (k / 4) + 3 * (k / 2 % 2) + k % 2];
      view.node_velocity[k] = blocks[other].velocity.data();
    }
    view.dx = static_cast<S>(dx);
    view.dt = static_cast<S>(dt);
    view.halo = block.halo.data();
    for (std::size_t m = 0; m < members.size(); ++m) {
      BodyBlock<S>& body = block.bodies[m];
      bool any = false;
      for (std::size_t s = 0; s < kSlabs; ++s) {
        view.slab[s] = body.slab[s].data();
        view.chunks[s] = static_cast<std::uint32_t>(body.slab[s].size());
        any = any || view.chunks[s] > 0;
      }
      std::vector<Crosser<S>>& leaving = block.leaving[m];
      leaving.clear();
      if (!any) continue;
      view.law = members[m].law;
      view.density = static_cast<S>(members[m].density);
      view.maxwell = members[m].maxwell.empty() ? nullptr : members[m].maxwell.data();
      view.crossers = &leaving;
      view.published = members[m].published.empty() ? nullptr : members[m].published.data();
      updated_block_of(*kernels, view.law.law)(view);
      block.extremes.min_volume_ratio =
          std::min(block.extremes.min_volume_ratio, view.extremes.min_volume_ratio);
      block.extremes.max_volume_ratio =
          std::max(block.extremes.max_volume_ratio, view.extremes.max_volume_ratio);
      block.fastest = std::max(block.fastest, view.fastest);
      if (leaving.empty()) continue;
      for (Crosser<S>& p : leaving) address(block, p);
      body.remove(leaving);
    }
  }

  /// Where a leaver goes: neighbour block, cell there, and f relative to that cell.
  static void address(UpdatedBlock<S>& block, Crosser<S>& p) {
    const int cell[3] = {p.slab, p.lane / 4, p.lane % 4};
    int neighbour = 0;
    int there = 0;
    for (int axis = 0; axis < 3; ++axis) {
      int c = cell[axis];
      if (p.f[axis] < S(0.5)) {
        p.f[axis] += S(1);
        --c;
      } else if (p.f[axis] >= S(1.5)) {
        p.f[axis] -= S(1);
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
        blocks.size() * UpdatedBlocks<S>::bytes_per_block() > memory_limit) {
      std::ostringstream text;
      text << "The grid has grown to " << blocks.size() << " blocks, more than the memory limit of "
           << (memory_limit >> 20U)
           << " MB holds: particles fly apart. Add walls or a ground, shorten the frame range, or "
              "raise the limit.";
      throw_compute(text.str());
    }
  }

  void take_in(std::size_t b, double dt) {
    UpdatedBlock<S>& block = blocks[b];
    for (std::size_t k = 0; k < 27; ++k) {
      const std::uint32_t other = block.neighbours[k];
      const std::size_t towards_me = 26 - k;
      if (other == kNoBlock || (blocks[other].leaving_to >> towards_me & 1U) == 0) continue;
      // Arrivals may touch as soon as they might have where they come from.
      block.wake_time = std::min(block.wake_time, blocks[other].sent_wake_time);
      for (std::size_t m = 0; m < members.size(); ++m) {
        for (const Crosser<S>& p : blocks[other].leaving[m]) {
          if (p.neighbour != towards_me) continue;
          block.bodies[m].insert(p);
          scatter(block, m, p, static_cast<S>(dt));
        }
      }
    }
  }
};

template <class S>
UpdatedGroup<S>::UpdatedGroup(const Scene& scene, const std::vector<std::size_t>& bodies,
                              const Kernels<S>& kernels, std::size_t memory_limit,
                              const Interrupter* interrupter)
    : impl_(std::make_unique<Impl>(scene, bodies, kernels, memory_limit, interrupter)) {}
template <class S>
UpdatedGroup<S>::~UpdatedGroup() = default;

template <class S>
std::pair<double, std::string> UpdatedGroup<S>::begin_frame(double time) {
  Impl& s = *impl_;
  s.blocks.tidy();
  s.topology.reset();
  s.term_acceleration = s.loads->terms().acceleration_bound(s.max_speed);
  s.pull = std::max(s.scene->gravity.at(time).norm(),
                    s.scene->gravity.at(time + s.frame_seconds).norm()) +
           s.term_acceleration;
  s.loads->begin_frame(s.frame_seconds, s.pull);
  for (std::size_t b = 0; b < s.blocks.size(); ++b) {
    s.blocks[b].wake_time = -1e30;
    s.blocks[b].penetration = 0.0;
  }
  return updated_limit(*s.scene, s.members, s.loads->terms(), s.min_j, s.max_speed, s.pull);
}

template <class S>
std::pair<double, double> UpdatedGroup<S>::step(Arena& arena, double time, double dt,
                                                const Vec3d& gravity, UpdatedRecord<S>* record) {
  Impl& s = *impl_;
  const double kick = 0.5 * (s.last_dt + dt);
  const std::size_t count = s.blocks.size();
  if (record != nullptr) {
    record->time = time;
    record->dt = dt;
    record->kick = kick;
    record->gravity = gravity;
    record->before = s.present_topology();
    record->node_mass.resize(count * kBlockNodes);
    record->node_velocity.resize(count * 3 * kBlockNodes);
    keep_particles(arena, s.blocks, s.members, s.loads->push_by_velocity(), *record);
  }
  s.loads->push(arena, s.grid, {time, gravity}, kick);
  s.update_grid(arena, time, kick, gravity, record);
  arena.parallel_for(0, count, 1, [&](std::size_t b) { s.move_block(b, dt); });
  double least = 1.0;
  double most = 1.0;
  S fastest = S(0);
  for (std::size_t b = 0; b < count; ++b) {
    least = std::min(least, static_cast<double>(s.blocks[b].extremes.min_volume_ratio));
    most = std::max(most, static_cast<double>(s.blocks[b].extremes.max_volume_ratio));
    fastest = std::max(fastest, s.blocks[b].fastest);
  }
  if (!(least > 0.0 && fastest < S(1))) {
    fail_updated(*s.scene, s.grid, s.members, time, dt, static_cast<double>(fastest));
  }
  s.min_j = least;
  s.max_speed = static_cast<double>(fastest) * s.dx / dt * std::sqrt(3.0);
  s.make_room();
  const UpdatedMoment moment{time + dt, dt, s.max_speed};
  std::vector<std::vector<UpdatedActsPtr>> acts(record != nullptr ? s.blocks.size() : 0);
  arena.parallel_for(0, s.blocks.size(), 1, [&](std::size_t b) {
    if (!s.blocks[b].occupied) return;
    s.take_in(b, dt);
    s.loads->act(s.grid, b, moment, record != nullptr ? &acts[b] : nullptr);
  });
  if (record != nullptr) {
    record->after = s.present_topology();
    record->acts.clear();
    for (std::vector<UpdatedActsPtr>& of_block : acts) record->add_acts(std::move(of_block));
  }
  s.last_dt = dt;
  return {least, most};
}

template <class S>
void UpdatedGroup<S>::collect(const Vec3d& low, const Vec3d& high,
                              std::vector<BodyPoint<S>>& out) const {
  collect_points(impl_->grid, impl_->members, low, high, out);
}

template <class S>
void UpdatedGroup<S>::push(const BodyPoint<S>& point, const Vec3d& force, double dt) {
  const Vec3d impulse = dt * force;
  impl_->grid.add_momentum(point.place, impulse.cast<S>(), S(0));
}

template <class S>
double UpdatedGroup<S>::term_acceleration() const {
  return impl_->term_acceleration;
}

template <class S>
double UpdatedGroup<S>::max_speed() const {
  return impl_->max_speed;
}

template <class S>
std::vector<UpdatedParticle> UpdatedGroup<S>::particles(std::size_t body) const {
  return particles_of(impl_->grid, impl_->members, body);
}

template <class S>
void UpdatedGroup<S>::sample(std::vector<BodyState>& bodies) const {
  sample_particles(impl_->grid, impl_->members, bodies);
}

template <class S>
void UpdatedGroup<S>::report(FrameReport& report) const {
  report.max_speed = std::max(report.max_speed, impl_->max_speed);
  report_particles(impl_->grid, impl_->members, report);
}

template <class S>
void UpdatedGroup<S>::save(ByteWriter& out) const {
  const Impl& s = *impl_;
  s.blocks.save(out);
  out.put(s.last_dt);
  out.put(s.max_speed);
  out.put(s.min_j);
  for (const UpdatedMember<S>& m : s.members) {
    out.put(m.memory);
    out.put(m.maxwell);
  }
}

template <class S>
void UpdatedGroup<S>::load(ByteReader& in) {
  Impl& s = *impl_;
  s.blocks.load(in);
  s.topology.reset();
  in.get(s.last_dt);
  in.get(s.max_speed);
  in.get(s.min_j);
  for (UpdatedMember<S>& m : s.members) {
    in.get_same_size(m.memory);
    in.get_same_size(m.maxwell);
  }
  for (std::size_t b = 0; b < s.blocks.size(); ++b) {
    for (std::size_t m = 0; m < s.members.size(); ++m) {
      s.blocks[b].bodies[m].for_each([&](std::size_t, const UpdatedChunk<S>& chunk, std::size_t l) {
        if (chunk.id[l] >= s.members[m].particles) ByteReader::fail();
      });
    }
  }
}

template <class S>
void UpdatedGroup<S>::save_sleep(ByteWriter& out) const {
  std::vector<double> wake_times;
  for (std::size_t b = 0; b < impl_->blocks.size(); ++b) {
    wake_times.push_back(impl_->blocks[b].wake_time);
  }
  out.put(wake_times);
  out.put(impl_->pull);
}

template <class S>
void UpdatedGroup<S>::load_sleep(ByteReader& in) {
  std::vector<double> wake_times(impl_->blocks.size());
  in.get_same_size(wake_times);
  for (std::size_t b = 0; b < wake_times.size(); ++b) impl_->blocks[b].wake_time = wake_times[b];
  in.get(impl_->pull);
  impl_->loads->begin_frame(impl_->frame_seconds, impl_->pull);
}

template class UpdatedGroup<float>;
template class UpdatedGroup<double>;

}  // namespace matterfit::mpm
