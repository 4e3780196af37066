// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/vec.hpp"
#include "fit/numerics/parameter.hpp"

/// What the discrepancy engine asks of a simulator. The engine (diagnose.hpp) knows no physics: it
/// asks for positions at the captured samples, differentiates them by finite differences, and does
/// the statistics. Whoever implements Model
///   1. lists the captures with what was measured, which samples were used by the fit and which
///      were held out (captures());
///   2. lists what was fitted, with the fitted values (parameters());
///   3. lists the candidate causes (effects());
///   4. simulates: for each Point the positions of all tracks at all frames of all captures, held
///      out ones included (simulate());
///   5. optionally lists recordings that could be made and simulates those (experiments(),
///      simulate_experiment()).
/// Lists are constant during a diagnosis. simulate() is deterministic and differentiable as far as
/// the solver is: equal points give equal bits.
namespace matterfit::diagnose {

/// What happens to a sample.
enum class Use : std::uint8_t {
  kUsed,     ///< the fit saw it, scores and refits see it
  kHeldOut,  ///< nobody sees it but the held-out gain
  kIgnored,  ///< not measured, hidden, or thrown out: looked at by nobody
};

/// One recording: F frames of N tracks. Sample (f, i) is number f * N + i; its coordinates are rows
/// 3 * (f * N + i) + axis of `positions`.
struct Capture {
  std::string name;
  std::vector<double> times;  ///< [s], F ascending ones; simulated positions are at these times
  std::vector<int> frames;    ///< F frame numbers for reports; empty: 0, 1, …
  std::vector<Vec3d> rest;    ///< N positions on the body [m], which define its regions
  Eigen::VectorXd positions;  ///< measured [m], 3 F N; what is ignored may be anything finite
  std::vector<Use> use;       ///< F N
  std::array<bool, 3> axes{true, true, true};  ///< coordinates that were measured
  double noise = 0.0;         ///< stated standard deviation of a coordinate [m]; 0: not known
  std::vector<bool> at_rest;  ///< F: frames in which nothing moves; empty: none known

  [[nodiscard]] Eigen::Index tracks() const { return Eigen::Index(rest.size()); }
  [[nodiscard]] Eigen::Index samples() const { return Eigen::Index(times.size() * rest.size()); }
};

/// Causes of measurement that the engine itself applies to simulated motion, in closed form. The
/// implementer lists them as effects and is never asked to simulate them. x(t) is the simulated
/// motion, c the effect's pivot, n its axis (unit), t₀ the capture's first time, α its number(s).
enum class Observation : std::uint8_t {
  kNone,            ///< the simulator applies it
  kTimeOffset,      ///< x(t + α) [s]
  kFrameRate,       ///< x(t₀ + (1 + α)(t − t₀)) [1]
  kScale,           ///< c + (1 + α)(x − c) [1]
  kDrift,           ///< x + α (t − t₀), three numbers [m/s]
  kOffset,          ///< x + α, three numbers [m]
  kLag,             ///< y of α ẏ = x − y, y(t₀) = x(t₀) [s]; one-sided
  kRollingShutter,  ///< x(t + α n·(x − c)) [s/m]
  kLens,            ///< c + (1 + α ρ²)(x − c) across n, ρ the distance from the axis [1/m²]
};

/// One number of an effect.
struct Number {
  std::string name;         ///< "drag_area"
  std::string unit;         ///< SI, or empty
  double neutral = 0.0;     ///< the value at which the effect is not there
  double scale = 1.0;       ///< physical, > 0: a size at which one would care for it
  double first_step = 0.0;  ///< physical, > 0: of the differences at `neutral`; 0: 1e-2 scale
  double low = -1e300;      ///< physical bounds, low <= neutral <= high
  double high = 1e300;
  bool one_sided = false;  ///< only values above neutral exist: differences go upward
  double deviation = 0.0;  ///< standard one of a normal prior about `neutral`; 0: none
};

/// A candidate cause: one row of the catalogue in one scope. Two scopes of one effect (shared, and
/// capture 2 only) are two rows.
struct Effect {
  std::string name;   ///< the catalogue's: "drag_quadratic"
  std::string scope;  ///< "shared", "body NAME", "capture NAME", "camera NAME"
  std::string group;  ///< "outside", "contact", "material", "state", "measurement"
  Observation observation = Observation::kNone;
  std::vector<Number> numbers;  ///< one or more that act together (a vector)
  /// Shapes that vanish at the neutral value (a place, a relaxation time), one description each
  /// ("at the left end", "time 0.02 s"); the engine scans all and takes the best. Empty: one shape
  /// without description. Point::Cause::variant says which.
  std::vector<std::string> variants;
  /// When each variant sets in [s], as something that is run into; empty: it acts from the start.
  /// Its derivative at the neutral value is that of one finite step (Number::first_step), so its
  /// score is a first impression: it is refitted whatever that says.
  std::vector<double> onsets;
  /// Values of the first number at which searches begin too, because the derivative at the neutral
  /// value does not say what is far from it: a body that sticks does not feel the friction.
  std::vector<double> tries;
  /// Values of the first number, ascending, at which shapes are looked at where the model without
  /// causes is far from the recording (far_starts.hpp); empty: searches begin by derivatives there
  /// too.
  std::vector<double> far_tries;
  /// For people: "{value} of air drag …"; {value} becomes value ± error with unit, or all of them
  /// with their names where there are several; {variant} the shape's description.
  std::string sentence;
  std::vector<std::string> confused_with;  ///< names, of the catalogue, for reports
  /// The catalogue's name of an effect that must be there as well: without it this one is no cause
  /// (no wind without the drag of air). Empty: none.
  std::string beside;
  std::vector<int> captures;    ///< those in which an observation acts; empty: all
  Vec3d pivot = Vec3d::Zero();  ///< observations: a fixed point [m]
  Vec3d axis = Vec3d::UnitZ();  ///< observations: unit
  double prior = 1.0;           ///< how often it is met, relative to others; for probabilities
  /// A law whose form is free: no candidate, but scored and refitted when all is done
  /// (free_law.hpp). One at most.
  bool last = false;
};

/// The solver's own freedom: what a simulation with another grid would have differed in. The
/// implementer maps it to what it has; what it does not have it leaves as it is.
struct Numerics {
  double spacing = 1.0;          ///< factor of the grid's dx, .8 … 1.3 (particles follow)
  double step = 1.0;             ///< factor of dt, <= 1
  Vec3d offset = Vec3d::Zero();  ///< of scene and floor against the grid, in cells, [0, 1)
  double particles = 1.0;        ///< factor of particles per cell
  int transfer = 0;              ///< 0: the scene's own; others as the implementer numbers them
  int seed = 0;                  ///< of particle placement; 0: the scene's own
  /// How another solver, or another skin, has contacts: a factor of their stiffness, and what is
  /// added to their share of critical damping.
  double contact_stiffness = 1.0;
  double contact_damping = 0.0;
  /// Loss factor of the first shear mode of a body that is struck, beside the material's own: what
  /// another discretisation passes on from there to modes that nobody sees.
  double loss = 0.0;
  /// What each part of a body weighs in sums over it, mass and stiffness alike, is multiplied by
  /// 1 + c·x + Σ b_k q_k(x) and then scaled to the same total: x the place over the body's half
  /// sizes, q = (3x²−1)/2, (3y²−1)/2, (3z²−1)/2, xy, yz, zx. Another solver lumps masses and
  /// integrates stresses in its own way: linear elements with n to a side have an inertia that is
  /// 2/n² too large.
  Vec3d lumping_slope = Vec3d::Zero();      ///< c
  std::array<double, 6> lumping_bend = {};  ///< b
  friend bool operator==(const Numerics&, const Numerics&) = default;
};

/// Where to simulate.
struct Point {
  /// A simulated effect at work, not an observation.
  struct Cause {
    int effect = 0;          ///< index into effects()
    int variant = 0;         ///< index into its variants, 0 where it has none
    Eigen::VectorXd values;  ///< physical, one a number
    friend bool operator==(const Cause&, const Cause&) = default;
  };
  Eigen::VectorXd theta;  ///< natural coordinates, one a parameter
  std::vector<Cause> causes;
  Numerics numerics;
  /// Times [s] of the last sample that is looked at, one a capture, before its first sample where
  /// none is; empty: all are. Later samples of the motion may be anything finite, earlier ones are
  /// those of a simulation to the end.
  std::vector<double> until;
  friend bool operator==(const Point&, const Point&) = default;
};

/// What a simulation gives: every coordinate of every sample of every capture, one capture after
/// another, in Capture's order.
struct Motion {
  Eigen::VectorXd positions;   ///< [m]
  Eigen::VectorXd velocities;  ///< [m/s]; empty: the engine differentiates between frames
  double work = 1.0;           ///< that it took, in simulations of the fitted values to the end
};

/// A frame of a capture in which its body touches something. Solvers hold a contact for different
/// times, so that the rigid motion within it may err by as much as this; by how much of it is
/// estimated.
struct ContactFrame {
  int capture = 0;
  Eigen::Index frame = 0;
  double place = 0.0;  ///< standard deviation of each coordinate of the body's place [m]
  double turn = 0.0;   ///< about each axis [rad]
};

/// A recording that could be made: its samples, without measured positions (`positions` empty,
/// every sample kUsed), and how to make it.
struct Experiment {
  std::string name;      ///< "drop from twice the height"
  std::string sentence;  ///< "Drop it from twice the height."
  Capture layout;
};

/// Unit and factor in which sizes of residuals are shown to people.
struct Shown {
  std::string unit = "mm";
  double factor = 1e3;
};

class Model {
 public:
  virtual ~Model() = default;
  /// In what sizes of residuals are shown: millimetres, and another unit where samples are no
  /// places but numbers, each the first coordinate of its sample.
  [[nodiscard]] virtual Shown shown() const { return {}; }
  [[nodiscard]] virtual const std::vector<Capture>& captures() const = 0;
  /// Everything refitted. `start` is the fitted value (for a check before a fit: the start).
  [[nodiscard]] virtual const std::vector<fit::Parameter>& parameters() const = 0;
  /// Other values of all parameters, natural, at which a search may begin where the fitted ones are
  /// far off: a fit through a whole clip of bounces may have ended in a false minimum. Asked for
  /// where there are corrections() alone.
  [[nodiscard]] virtual std::vector<Eigen::VectorXd> other_starts() const { return {}; }
  /// For each parameter the only capture that it acts in, as its own throw, or -1. Where no sample
  /// of that capture is used, such parameters are fitted to its held-out samples before an error is
  /// measured there, with and without a cause alike.
  [[nodiscard]] virtual std::vector<int> own_capture() const {
    return std::vector<int>(parameters().size(), -1);
  }
  /// Parameters that stand for what the solver gets wrong at known times, as an impact's impulse,
  /// ascending, each with a prior around 0: the solver's covariance is of what is left once they
  /// are free.
  [[nodiscard]] virtual std::vector<Eigen::Index> corrections() const { return {}; }
  /// Parameters that stand for errors of the states that simulations take from the recordings
  /// (follows_recordings()), ascending, each with a prior around 0.
  [[nodiscard]] virtual std::vector<Eigen::Index> state_errors() const { return {}; }
  /// Frames of contact, with errors that are independent from frame to frame: what a contact leaves
  /// behind is for corrections().
  [[nodiscard]] virtual std::vector<ContactFrame> contact_frames() const { return {}; }
  /// Whether simulations follow the recordings in places, and so depend on what a camera did:
  /// points then hold observations among their causes, which the engine applies to the motion all
  /// the same.
  [[nodiscard]] virtual bool follows_recordings() const { return false; }
  [[nodiscard]] virtual const std::vector<Effect>& effects() const = 0;
  /// One motion a point, in order; nothing where the simulation could not be completed. Batches
  /// are as large as the engine can make them: run them side by side. Throws Error(kCancelled).
  [[nodiscard]] virtual std::vector<std::optional<Motion>> simulate(
      const std::vector<Point>& points) const = 0;
  /// Whether simulate() looks at Point::numerics. Where it does not, the engine has no covariance
  /// of the solver and never says "numerical": right for exact models only.
  [[nodiscard]] virtual bool has_numerics() const = 0;
  [[nodiscard]] virtual std::vector<Experiment> experiments() const { return {}; }
  /// Motions of the experiment's own samples; parameters that belong to one capture are those of
  /// the first.
  [[nodiscard]] virtual std::vector<std::optional<Motion>> simulate_experiment(
      int /*experiment*/, const std::vector<Point>& points) const {
    return std::vector<std::optional<Motion>>(points.size());
  }
};

/// corrections() and state_errors(), ascending: nuisances of known times.
[[nodiscard]] std::vector<Eigen::Index> nuisances_of_times(const Model& model);

/// Throws Error(kInput), saying which list and entry, where sizes, bounds, steps or samples are not
/// as documented above.
void check(const Model& model);

}  // namespace matterfit::diagnose
