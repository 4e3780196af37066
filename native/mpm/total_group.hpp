// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "mpm/kernels.hpp"
#include "mpm/scene.hpp"
#include "mpm/simulation.hpp"
#include "mpm/state_bytes.hpp"
#include "mpm/total_body.hpp"
#include "mpm/total_contact.hpp"
#include "mpm/total_terms.hpp"

namespace matterfit::mpm {

/// A substep [s] and what set it.
struct StepLimit {
  double dt = std::numeric_limits<double>::infinity();
  std::string reason;
  void limit_to(double other, const std::string& why) {
    if (other < dt) {
      dt = other;
      reason = why;
    }
  }
};

/// One body between two substeps, with all that the next ones depend on.
template <class S>
struct TotalMemberState {
  TotalState<S> body;
  ContactState contact;
  double last_dt = 0.0;
  double elastic_dt = 0.0;
  int unsmoothed = 0;

  [[nodiscard]] std::size_t bytes() const;
};

/// The total Lagrangian bodies of a scene, each with its contact with the colliders, and how a
/// substep of them goes. (Their counterpart is UpdatedGroup.)
template <class S>
class TotalGroup {
 public:
  TotalGroup(const Scene& scene, const Kernels<S>& kernels,
             const Interrupter* interrupter = nullptr);

  [[nodiscard]] std::size_t size() const { return members_.size(); }
  /// Into scene.bodies.
  [[nodiscard]] std::size_t index(std::size_t member) const { return members_[member].index; }
  [[nodiscard]] TotalBody<S>& body(std::size_t member) { return *members_[member].body; }
  [[nodiscard]] bool all_held(double time) const;

  /// Contact between bodies, as far as it bears on the substep.
  struct OtherContact {
    bool any = false;
    double frequency_squared = 0.0;  ///< [1/s²]
  };
  /// Lowers `limit` to what the bodies can take in the frame that begins at `time`; looks for their
  /// fastest modes where they may have changed.
  void limit_step(Arena& arena, double time, const OtherContact& other, StepLimit& limit,
                  const Interrupter& interrupter);
  /// The substep of the unforced bodies, as limit_step() found them last [s]; 0: not yet. What the
  /// velocities' smoothing is measured by.
  [[nodiscard]] std::vector<double> elastic_dt() const;
  void set_elastic_dt(const std::vector<double>& dt);

  /// Before the limits of the frame that it belongs to are looked for.
  void nudge(const Nudge& nudge);
  /// Throws Error(kInput) where the body, into Scene::bodies, is not one of the group.
  void change(std::size_t body, const RigidChange& change);
  void begin_frame(double time);
  /// The largest acceleration [m/s²] that terms give to a body in the frame that began last.
  [[nodiscard]] double term_acceleration() const { return term_acceleration_; }
  /// Begins the bodies' loads, to which others may add: contact with colliders, then terms.
  void touch(Arena& arena, double time, double dt);
  /// Forces and motion. Throws UnstableError where a cell turns inside out. `frame` for its text.
  void step(Arena& arena, double time, double dt, const Vec3d& gravity, int frame,
            FrameReport& report);
  /// The last one of each body.
  [[nodiscard]] const std::vector<TotalSubstep>& last_substeps() const { return last_; }

  /// At the end of a frame that began at `time`: throws UnstableError for a body that has more
  /// energy than it had and was given. Watches elastic bodies that nothing holds and no term acts
  /// on, in steady gravity, off moving surfaces; `alone`: no other body can touch them.
  void watch_energy(Arena& arena, double time, bool alone, int frame);

  void sample(Arena& arena, std::vector<BodyState>& bodies) const;
  void report(FrameReport& report) const;
  void save(ByteWriter& out) const;
  void load(ByteReader& in);
  [[nodiscard]] std::vector<TotalMemberState<S>> record() const;
  void restore(const std::vector<TotalMemberState<S>>& states);

 private:
  struct Member {
    std::size_t index;
    std::unique_ptr<TotalBody<S>> body;
    std::unique_ptr<TotalContact<S>> contact;
    std::unique_ptr<TotalTerms<S>> terms;
    std::vector<TotalLoad<S>*> loads;  ///< those two, where they have something to act with
    double last_dt = 0.0;  ///< of the substep before; 0: the next one starts with a half kick
    double elastic_dt = 0.0;
    int unsmoothed = 0;   ///< substeps since the velocities were last smoothed
    int since_probe = 0;  ///< substeps since the probe for the fastest mode that gave elastic_dt
    BlockExtremes<S> probed{S(1), S(1)};  ///< then
    BlockExtremes<S> latest{S(1), S(1)};  ///< in the last substep
    Vec3d start = Vec3d::Zero();          ///< mass moment at rest: where height counts from
    double budget = 0.0;                  ///< energy at the end of the frame before [J]
    bool budget_known = false;

    [[nodiscard]] bool needs_probe() const;
  };
  [[noreturn]] void fail(const Member& member, double time, int frame) const;

  const Scene& scene_;
  double term_acceleration_ = 0.0;
  std::vector<Member> members_;
  std::vector<TotalSubstep> last_;
};

extern template struct TotalMemberState<float>;
extern template struct TotalMemberState<double>;
extern template class TotalGroup<float>;
extern template class TotalGroup<double>;

}  // namespace matterfit::mpm
