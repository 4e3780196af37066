// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/simulation.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <sstream>
#include <utility>

#include "base/error.hpp"
#include "mpm/body_contact.hpp"
#include "mpm/kernels.hpp"
#include "mpm/scene_check.hpp"
#include "mpm/total_body.hpp"
#include "mpm/total_contact.hpp"
#include "mpm/unstable_error.hpp"
#include "mpm/updated_group.hpp"

namespace matterfit::mpm {
namespace {

/// Of saved states.
constexpr std::uint32_t kStateVersion = 3;

struct TotalMember {
  std::size_t index;  ///< into scene.bodies
  std::unique_ptr<TotalBody<float>> body;
  std::unique_ptr<TotalContact<float>> contact;
  double last_dt = 0.0;  ///< of the substep before; 0: the next one starts with a half kick
  double elastic_dt = 0.0;
  int unsmoothed = 0;   ///< substeps since the velocities were last smoothed
  int since_probe = 0;  ///< substeps since the probe for the fastest mode that gave elastic_dt
  BlockExtremes<float> probed{1.0F, 1.0F};  ///< then
  BlockExtremes<float> latest{1.0F, 1.0F};  ///< in the last substep

  /// A force evaluation for each of the probe's iterations: not where little has changed.
  [[nodiscard]] bool needs_probe() const {
    constexpr int kOften = 64;
    constexpr float kChange = 0.05F;
    return since_probe >= kOften ||
           std::abs(latest.min_volume_ratio - probed.min_volume_ratio) > kChange ||
           std::abs(latest.max_volume_ratio - probed.max_volume_ratio) > kChange;
  }
};

/// A substep and what set it.
struct Step {
  double dt = std::numeric_limits<double>::infinity();
  std::string limit;
  void limit_to(double other, const std::string& reason) {
    if (other < dt) {
      dt = other;
      limit = reason;
    }
  }
};

constexpr int kFirstIterations = 60;
constexpr int kFrameIterations = 16;
constexpr int kMostRetries = 3;
constexpr double kMostSubsteps = 5e6;
/// Share of the unresolved part of a total Lagrangian body's velocity that a substep at the
/// stability limit takes away, applied every few substeps (docs/why.md: what it costs a beam).
constexpr double kSmoothing = 0.02;
constexpr int kSmoothingInterval = 8;

}  // namespace

struct Simulation::Impl {
  Scene scene;
  std::shared_ptr<Arena> arena;
  Options options;
  std::vector<TotalMember> total;
  std::unique_ptr<UpdatedGroup<float>> updated;
  std::vector<std::size_t> updated_bodies;
  std::unique_ptr<BodyContacts> body_contacts;
  int frame = 0;

  Impl(Scene scene_in, std::shared_ptr<Arena> arena_in, Options options_in)
      : scene(std::move(scene_in)), arena(std::move(arena_in)), options(options_in) {
    check_scene(scene);
    const MemoryEstimate needed = estimate(scene);
    if (needed.bytes > options.memory_limit) {
      std::ostringstream text;
      text << "The scene needs about " << (needed.bytes >> 20U) << " MB for " << needed.particles
           << " particles, more than the limit of " << (options.memory_limit >> 20U)
           << " MB. Use a larger particle separation or raise the memory limit.";
      throw_input(text.str());
    }
    frame = scene.first_frame;
    if (scene.walls) add_walls();
    check_start();
    const Kernels<float>& table = kernels<float>(options.target);
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
      if (!is_total(scene.bodies[i])) {
        updated_bodies.push_back(i);
        continue;
      }
      TotalMember member;
      member.index = i;
      member.body = std::make_unique<TotalBody<float>>(scene.bodies[i], scene, table);
      member.contact = std::make_unique<TotalContact<float>>(scene.bodies[i], scene, *member.body);
      total.push_back(std::move(member));
    }
    if (!updated_bodies.empty()) {
      updated =
          std::make_unique<UpdatedGroup<float>>(scene, updated_bodies, table, options.memory_limit);
    }
    std::vector<BodyContacts::Member> members;
    for (const TotalMember& member : total) members.push_back({member.index, member.body.get()});
    body_contacts =
        std::make_unique<BodyContacts>(scene, std::move(members), updated.get(), updated_bodies);
  }

  /// Closed walls touch like any other collider.
  void add_walls() {
    for (int axis = 0; axis < 3; ++axis) {
      for (const int side : {-1, 1}) {
        const double at = side < 0 ? scene.walls->low[axis] : scene.walls->high[axis];
        if (!std::isfinite(at)) continue;
        Vec3d point = Vec3d::Zero();
        Vec3d normal = Vec3d::Zero();
        point[axis] = at;
        normal[axis] = -side;
        scene.colliders.push_back(
            make_plane(std::string("wall ") + (side < 0 ? "-" : "+") + "xyz"[axis],
                       scene.walls->contact, point, normal));
      }
    }
  }

  /// A body that starts deep inside a collider would be shot out of it, or torn: say so instead.
  /// Bodies with pins may be set into what holds them.
  void check_start() const {
    constexpr std::size_t kMostQueries = 20'000;
    for (const Body& body : scene.bodies) {
      if (!body.pins.empty()) continue;
      const std::size_t step = 1 + body.rest.size() / kMostQueries;
      for (const ColliderPtr& collider : scene.colliders) {
        double deepest = 0.0;
        Vec3d where = Vec3d::Zero();
        for (std::size_t p = 0; p < body.rest.size(); p += step) {
          const double depth = -collider->closest(body.rest[p], 0.0).distance;
          if (depth <= deepest) continue;
          deepest = depth;
          where = body.rest[p];
        }
        if (deepest <= scene.dx) continue;
        std::ostringstream text;
        text << "Body '" << body.name << "' starts up to " << deepest << " m inside '"
             << collider->name() << "', at (" << where[0] << ", " << where[1] << ", " << where[2]
             << ") m. Move one of them so that they touch at most.";
        throw_input(text.str());
      }
    }
  }

  /// A particle more than a cell beyond a wall has broken through.
  void check_walls(const FrameState& state) const {
    if (!scene.walls) return;
    const Vec3d low = scene.walls->low - Vec3d::Constant(scene.dx);
    const Vec3d high = scene.walls->high + Vec3d::Constant(scene.dx);
    for (std::size_t b = 0; b < state.bodies.size(); ++b) {
      const auto& positions = state.bodies[b].positions;
      for (std::size_t p = 0; p < positions.size(); ++p) {
        const Vec3d x = positions[p].cast<double>();
        if ((x - low).minCoeff() >= 0.0 && (high - x).minCoeff() >= 0.0) continue;
        std::ostringstream text;
        text << "Body '" << scene.bodies[b].name << "', frame " << state.frame << ": particle " << p
             << " at (" << x[0] << ", " << x[1] << ", " << x[2]
             << ") m is more than a cell beyond the walls. Start the body inside them, raise the "
                "walls' contact stiffness, or use gentler motion.";
        throw_compute(text.str());
      }
    }
  }

  [[nodiscard]] double time_of(int at) const { return (at - scene.first_frame) / scene.fps; }

  [[nodiscard]] Step choose_step(double time, const Interrupter& interrupter) {
    Step step;
    if (scene.dt > 0.0) step.limit_to(scene.dt, "scene.solver.dt");
    for (TotalMember& member : total) {
      // A body let go within the frame needs its own limit from the start of the frame.
      if (member.body->held(time + 1.0 / scene.fps - 1e-9)) continue;
      const bool first = member.elastic_dt <= 0.0;
      if (first || (!(scene.dt > 0.0) && member.needs_probe())) {
        const double found = member.body->stable_time_step(
            *arena, first ? kFirstIterations : kFrameIterations, interrupter);
        // A body that flows answers softly to the probe, and stiffly as soon as it unloads.
        const bool flows = !scene.bodies[member.index].material.is_elastic();
        member.elastic_dt = flows && !first ? std::min(member.elastic_dt, found) : found;
        member.probed = member.latest;
        member.since_probe = 0;
      }
      if (scene.dt > 0.0) continue;
      if (member.contact->any() || body_contacts->any()) {
        // A face must not cross a collider, nor what resists it, within a substep.
        const double speed = member.body->max_speed() + scene.gravity.at(time).norm() / scene.fps;
        if (speed > 0.0) step.limit_to(scene.cfl * scene.dx / speed, "CFL");
      }
      const double omega = 2.0 / member.elastic_dt;
      const double contact =
          member.contact->frequency_squared() + body_contacts->frequency_squared();
      const double fastest = std::sqrt(omega * omega + contact);
      // Explicit damping lowers the limit 2/ω to (2/ω)(√(1 + ξ²) − ξ), ξ its share of critical
      // (Belytschko, Liu and Moran, Nonlinear Finite Elements, §6.6.6); the rate of a damping is
      // 27 η/(2 ρ dx²) at most, as that of the same modulus in place of it.
      const material::Material& m = scene.bodies[member.index].material;
      const double viscous = 2.0 * m.damping_shear + m.damping_bulk;
      const double rate =
          13.3 * viscous / (scene.bodies[member.index].density * scene.dx * scene.dx);
      const double xi = 0.5 * rate / fastest;
      const bool by_damping = xi > 1.0;
      const bool by_contact = contact > omega * omega;
      const char* reason = by_damping   ? "damping of "
                           : by_contact ? "contact of "
                                        : "elastic wave of ";
      step.limit_to(scene.dt_safety * 2.0 / fastest * (std::sqrt(1.0 + xi * xi) - xi),
                    reason + member.body->name());
    }
    if (!(scene.dt > 0.0) && body_contacts->frequency_squared() > 0.0) {
      // Bodies that are held, and updated ones, feel it too.
      step.limit_to(scene.dt_safety * std::sqrt(2.0 / body_contacts->frequency_squared()),
                    "contact between bodies");
    }
    if (updated) {
      const auto [dt, reason] = updated->begin_frame(time);
      if (!(scene.dt > 0.0)) step.limit_to(scene.dt_safety * dt, reason);
    }
    return step;
  }

  /// How many substeps a frame takes, as a number that may be too large for an int.
  [[nodiscard]] double substeps(const Step& step) const {
    return std::max(1.0, std::ceil(1.0 / (scene.fps * step.dt) * (1.0 - 1e-12)));
  }

  /// Of the present frame, where the scene says; else 0.
  [[nodiscard]] int fixed_substeps() const {
    const auto k = static_cast<std::size_t>(frame - scene.first_frame);
    return k < scene.substeps.size() ? scene.substeps[k] : 0;
  }

  /// One frame in `substeps` equal substeps. Throws Error(kCompute) if the run fails.
  void run_frame(int substeps, const Interrupter& interrupter, FrameReport& report) {
    begin_frame();
    const double dt = 1.0 / (scene.fps * substeps);
    for (int k = 0; k < substeps; ++k) {
      interrupter.check();
      run_substep(time_of(frame) + k * dt, dt, report);
    }
  }

  void begin_frame() {
    const double start = time_of(frame);
    const double frame_seconds = 1.0 / scene.fps;
    double pull = scene.gravity.at(start).norm();
    pull = std::max(pull, scene.gravity.at(start + frame_seconds).norm());
    for (TotalMember& member : total) member.contact->wake(frame_seconds, pull);
    body_contacts->wake();
  }

  void run_substep(double time, double dt, FrameReport& report) {
    const Vec3d gravity = scene.gravity.at(time);
    for (TotalMember& member : total) {
      member.contact->apply(*arena, *member.body, time, dt);
    }
    if (body_contacts->any()) {
      body_contacts->apply(*arena, time, dt, gravity.norm(), 1.0 / scene.fps);
    }
    for (TotalMember& member : total) {
      if (member.body->releases_between(time - dt, time)) member.last_dt = 0.0;
      if (member.body->held(time)) {
        member.body->step_nodes(*arena, 0.0, dt, gravity, time);
        member.last_dt = 0.0;
        continue;
      }
      member.body->compute_forces(*arena, dt, true);
      member.body->step_nodes(*arena, 0.5 * (member.last_dt + dt), dt, gravity, time);
      if (++member.unsmoothed == kSmoothingInterval) {
        member.unsmoothed = 0;
        member.body->smooth_velocities(
            *arena, std::min(0.5, kSmoothing * kSmoothingInterval * dt / member.elastic_dt));
      }
      member.last_dt = dt;
      ++member.since_probe;
      const auto extremes = member.body->extremes();
      member.latest = extremes;
      report.min_volume_ratio =
          std::min(report.min_volume_ratio, static_cast<double>(extremes.min_volume_ratio));
      report.max_volume_ratio =
          std::max(report.max_volume_ratio, static_cast<double>(extremes.max_volume_ratio));
      if (!(extremes.min_volume_ratio > 0.0F)) fail_total(member, time);
    }
    if (updated) {
      const auto extremes = updated->step(*arena, time, dt, gravity);
      report.min_volume_ratio = std::min(report.min_volume_ratio, extremes.first);
      report.max_volume_ratio = std::max(report.max_volume_ratio, extremes.second);
    }
  }

  [[noreturn]] void fail_total(const TotalMember& member, double time) const {
    const TotalBody<float>& body = *member.body;
    std::uint32_t worst = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::uint32_t p = 0; p < body.particles(); ++p) {
      const double j = body.deformation_gradient(p).determinant();
      if (!std::isfinite(j)) {
        worst = p;
        least = j;
        break;
      }
      if (j < least) {
        least = j;
        worst = p;
      }
    }
    const Vec3d x = body.point_state(worst).position;
    std::ostringstream text;
    text << "Body '" << body.name() << "', frame " << frame << " (" << time << " s): particle "
         << worst << " at (" << x[0] << ", " << x[1] << ", " << x[2] << ") m ";
    if (std::isfinite(least)) {
      text << "is turned inside out (volume ratio " << least << ").";
    } else {
      text << "is not a number.";
    }
    text << " The deformation is larger than this grid can follow: use a smaller particle "
            "separation, a smaller scene.solver.dt_safety, gentler motion, or formulation "
            "'updated' if the body flows or tears.";
    throw UnstableError(text.str());
  }

  [[nodiscard]] std::string save() const {
    ByteWriter out;
    out.put(kStateVersion);
    out.put(frame);
    for (const TotalMember& member : total) {
      out.put(member.last_dt);
      out.put(member.elastic_dt);
      out.put(member.unsmoothed);
      out.put(member.since_probe);
      out.put(member.probed);
      out.put(member.latest);
      member.body->save(out);
      member.contact->save(out);
    }
    if (updated) updated->save(out);
    body_contacts->save(out);
    return out.take();
  }

  void load(const std::string& bytes) {
    ByteReader in(bytes);
    std::uint32_t version = 0;
    in.get(version);
    if (version != kStateVersion)
      throw_input("The checkpoint is of another version. Simulate again.");
    in.get(frame);
    for (TotalMember& member : total) {
      in.get(member.last_dt);
      in.get(member.elastic_dt);
      in.get(member.unsmoothed);
      in.get(member.since_probe);
      in.get(member.probed);
      in.get(member.latest);
      member.body->load(in);
      member.contact->load(in);
    }
    if (updated) updated->load(in);
    body_contacts->load(in);
    in.expect_end();
  }
};

Simulation::Simulation(Scene scene, std::shared_ptr<Arena> arena, Options options)
    : impl_(std::make_unique<Impl>(std::move(scene), std::move(arena), options)) {}
Simulation::Simulation(Scene scene, std::shared_ptr<Arena> arena)
    : Simulation(std::move(scene), std::move(arena), Options{}) {}
Simulation::~Simulation() = default;

const Scene& Simulation::scene() const { return impl_->scene; }
int Simulation::frame() const { return impl_->frame; }

FrameReport Simulation::advance(const Interrupter& interrupter) {
  Impl& s = *impl_;
  const auto begin = std::chrono::steady_clock::now();
  FrameReport report;
  s.arena->execute([&] {
    Step step = s.choose_step(s.time_of(s.frame), interrupter);
    const int fixed = s.fixed_substeps();
    if (fixed > 0) step = {1.0 / (s.scene.fps * fixed), "scene.substeps"};
    const bool may_retry = !(s.scene.dt > 0.0) && fixed == 0;
    const std::string before = may_retry ? s.save() : "";  // with the limits just found
    double count = fixed > 0 ? fixed : s.substeps(step);
    if (!(count < kMostSubsteps)) {
      throw_compute("Frame " + std::to_string(s.frame) + " would need " + std::to_string(count) +
                    " substeps (" + step.limit +
                    "). Soften the material, use a larger particle separation, or override "
                    "scene.solver.dt.");
    }
    // A frame that fails is tried again with half the substep before the run gives up: a hard
    // impact can stiffen the body within a frame.
    for (int attempt = 0;; ++attempt) {
      report = FrameReport{};
      report.substeps = static_cast<int>(count);
      report.dt = 1.0 / (s.scene.fps * report.substeps);
      report.dt_limit = step.limit + (attempt > 0 ? ", halved after a failed try" : "");
      try {
        s.run_frame(report.substeps, interrupter, report);
        break;
      } catch (const UnstableError&) {
        if (attempt == kMostRetries || !may_retry || 2.0 * count > kMostSubsteps) {
          throw;
        }
        s.load(before);
        count *= 2.0;
      }
    }
    ++s.frame;
    report.frame = s.frame;
    for (const TotalMember& member : s.total) {
      report.max_speed = std::max(report.max_speed, member.body->max_speed());
      report.kinetic_energy += member.body->kinetic_energy();
      report.max_penetration = std::max(report.max_penetration, member.contact->max_penetration());
    }
    if (s.updated) s.updated->report(report);
    if (s.scene.walls) s.check_walls(state());
  });
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return report;
}

SubstepCost Simulation::measure(double seconds, const Interrupter& interrupter) {
  Impl& s = *impl_;
  SubstepCost cost;
  s.arena->execute([&] {
    // While everything is held nothing is computed: the price is that of what follows.
    const auto all_held = [&] {
      return !s.updated && std::all_of(s.total.begin(), s.total.end(), [&](const TotalMember& m) {
        return m.body->held(s.time_of(s.frame));
      });
    };
    while (all_held() && s.frame + 1 < s.scene.end_frame) ++s.frame;
    const double count = s.substeps(s.choose_step(s.time_of(s.frame), interrupter));
    cost.dt = 1.0 / (s.scene.fps * count);
    FrameReport report;
    s.begin_frame();
    const auto begin = std::chrono::steady_clock::now();
    int done = 0;
    double spent = 0.0;
    while (done < count && (done == 0 || spent < seconds)) {
      s.run_substep(s.time_of(s.frame) + done * cost.dt, cost.dt, report);
      ++done;
      spent = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    }
    cost.seconds = spent / done;
  });
  return cost;
}

FrameState Simulation::state() const {
  const Impl& s = *impl_;
  FrameState out;
  out.frame = s.frame;
  out.time = s.time_of(s.frame);
  out.bodies.resize(s.scene.bodies.size());
  for (const TotalMember& member : s.total) {
    member.body->sample(*s.arena, out.bodies[member.index]);
  }
  if (s.updated) s.updated->sample(out.bodies);
  return out;
}

std::string Simulation::save() const { return impl_->save(); }
void Simulation::load(const std::string& bytes) { impl_->load(bytes); }

MemoryEstimate Simulation::estimate(const Scene& scene) {
  MemoryEstimate out;
  for (const Body& body : scene.bodies) {
    out.particles += body.rest.size();
    // Scene (rest, volumes), solver state with padding of partly filled lanes, one frame's output
    // and one saved state: measured with 1 M particles, rounded up.
    const std::size_t branch = is_total(body) ? 12 * sizeof(float) : 6 * sizeof(float);
    out.bytes += body.rest.size() * ((is_total(body) ? std::size_t{340} : std::size_t{520}) +
                                     branch * body.material.maxwell.size());
  }
  return out;
}

}  // namespace matterfit::mpm
