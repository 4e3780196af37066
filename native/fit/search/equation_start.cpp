// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/equation_start.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "base/error.hpp"
#include "capture/thin.hpp"
#include "fit/data/equation_error.hpp"
#include "fit/data/follow.hpp"
#include "fit/numerics/least_squares.hpp"
#include "fit/numerics/uncertainty.hpp"
#include "mpm/pin_region.hpp"

namespace matterfit::fit {
namespace {

constexpr double kUneven = 0.01;  // of the time between frames
/// Places, about, by which the balance is summed up; fewer where each class of flow is searched
/// with a neural law, a microsecond a place, substep and class.
constexpr double kMostPlaces = 2000;
constexpr double kMostPlacesOfClasses = 500;
constexpr std::size_t kMostFrames = 400;
/// Unknown forces act so far off a collider, in cells: of contact by nodes.
constexpr double kContactCells = 1.5;
/// Standard deviation in the natural coordinate, of angles in degrees, up to which a value is told.
constexpr double kTold = 1.1;
constexpr double kToldAngle = 10.0;
constexpr double kToldCode = 1.0;     // of what is standard normal
constexpr double kDifference = 2e-2;  // of a parameter's scale
constexpr LeastSquaresOptions kWhole{
    .iterations = 15, .step_tolerance = 2e-2, .cost_tolerance = 1e-4, .difference = kDifference};
/// A class is only searched for values that simulations begin at.
constexpr LeastSquaresOptions kOfClass{
    .iterations = 6, .step_tolerance = 0.1, .cost_tolerance = 1e-2, .difference = kDifference};
/// Classes of flow that are simulated, of those that the balance ranks.
constexpr std::size_t kClasses = 3;

void keep_nearer(Clearance& least, double distance, const Vec3d& normal, bool at_rest) {
  if (distance < least.distance) least = {distance, normal, at_rest};
}

Clearance clearance_in(const mpm::Scene& scene, const mpm::Body& body, const Vec3d& rest,
                       const Vec3d& position, double time) {
  Clearance least;
  for (const shape::ColliderPtr& collider : scene.colliders) {
    const shape::SurfacePoint surface = collider->closest(position, time);
    keep_nearer(least, surface.distance, surface.normal, false);
  }
  if (scene.walls) {
    for (int axis = 0; axis < 3; ++axis) {
      keep_nearer(least, position[axis] - scene.walls->low[axis], Vec3d::Unit(axis), false);
      keep_nearer(least, scene.walls->high[axis] - position[axis], -Vec3d::Unit(axis), false);
    }
  }
  for (const mpm::Pin& pin : body.pins) {
    if (time > pin.release + 1e-9) continue;
    const mpm::RegionDistance region = mpm::region_distance(pin, rest);
    const Vec3d away = rest - region.nearest;
    const double length = away.norm();
    keep_nearer(least, region.distance, length > 0.0 ? Vec3d(away / length) : Vec3d::UnitZ(), true);
  }
  return least;
}

/// Keeps the scene.
Balance balance_of(const Capture& capture, const std::shared_ptr<const mpm::Scene>& held,
                   bool may_flow) {
  const mpm::Scene& scene = *held;
  const mpm::Body& body = scene.bodies.front();
  Balance balance;
  double volume = 0.0;
  for (const double part : body.volumes) volume += part;
  balance.places = body.rest;
  balance.volumes = body.volumes;
  const double most = may_flow ? kMostPlacesOfClasses : kMostPlaces;
  const double separation = std::cbrt(volume / most);
  if (double(balance.places.size()) > 1.5 * most) {
    capture::thin(balance.places, balance.volumes, separation);
  }
  balance.tracks = interior_tracks(capture, volume);
  balance.density = body.density;
  for (const double time : balance.tracks.times) {
    balance.gravity.push_back(scene.gravity.at(time));
  }
  balance.flows = may_flow || !body.material.traits().elastic();
  balance.contact_reach = kContactCells * scene.dx;
  balance.clearance = [held](const Vec3d& rest, const Vec3d& position, double time) {
    return clearance_in(*held, held->bodies.front(), rest, position, time);
  };
  return balance;
}

/// The balances of all captures of one body, by the parameters of its material.
class BalanceProblem final : public Problem {
 public:
  BalanceProblem(const Parameters& parameters, std::vector<std::size_t> numbers,
                 std::vector<double> values, Arena& arena, const Interrupter& interrupter)
      : parameters_(parameters),
        numbers_(std::move(numbers)),
        values_(std::move(values)),
        arena_(arena),
        interrupter_(interrupter) {}

  /// `may_flow`: whatever the scene's own material does.
  void add(std::size_t run, const mpm::Scene& scene, const Capture& capture, bool may_flow) {
    // Density, gravity, heights of colliders and what else is fitted as the fit begins.
    const auto start = std::make_shared<mpm::Scene>(scene);
    parameters_.apply(values_, run, *start);
    errors_.emplace_back(balance_of(capture, start, may_flow), arena_);
    Part part{run, *start};
    // Only what parameters are set in: no particles.
    part.scene.bodies.front().rest.clear();
    part.scene.bodies.front().volumes.clear();
    parts_.push_back(std::move(part));
  }
  [[nodiscard]] bool empty() const { return errors_.empty(); }

  [[nodiscard]] std::vector<double> physical(const Eigen::VectorXd& point) const {
    std::vector<double> values = values_;
    for (std::size_t k = 0; k < numbers_.size(); ++k) {
      const Parameter& parameter = parameters_.parameters()[numbers_[k]];
      values[numbers_[k]] = value_within_bounds(parameter, point[Eigen::Index(k)]);
    }
    return values;
  }

  /// EquationError::deviance(), the mean over the captures; infinite where it is not finite.
  [[nodiscard]] double deviance(const Eigen::VectorXd& point) {
    const std::vector<double> values = physical(point);
    double sum = 0.0;
    for (std::size_t k = 0; k < errors_.size(); ++k) {
      parameters_.apply(values, parts_[k].run, parts_[k].scene);
      sum += errors_[k].deviance(parts_[k].scene.bodies.front().material, arena_);
    }
    return std::isfinite(sum) ? sum / double(errors_.size())
                              : std::numeric_limits<double>::infinity();
  }

  std::vector<std::optional<Eigen::VectorXd>> evaluate(
      const std::vector<Eigen::VectorXd>& points) override {
    std::vector<std::optional<Eigen::VectorXd>> results;
    for (const Eigen::VectorXd& point : points) {
      interrupter_.check();
      const std::vector<double> values = physical(point);
      Eigen::VectorXd all;
      for (std::size_t k = 0; k < errors_.size(); ++k) {
        parameters_.apply(values, parts_[k].run, parts_[k].scene);
        const Eigen::VectorXd one =
            errors_[k].evaluate(parts_[k].scene.bodies.front().material, arena_);
        const Eigen::Index before = all.size();
        all.conservativeResize(before + one.size());
        all.tail(one.size()) = one;
      }
      if (all.allFinite()) {
        results.emplace_back(std::move(all));
      } else {
        results.emplace_back();
      }
    }
    return results;
  }

 private:
  struct Part {
    std::size_t run;
    mpm::Scene scene;
  };
  const Parameters& parameters_;
  std::vector<std::size_t> numbers_;
  std::vector<double> values_;
  Arena& arena_;
  const Interrupter& interrupter_;
  std::vector<EquationError> errors_;
  std::vector<Part> parts_;
};

/// A value that was found, with its error in the natural coordinate.
struct Found {
  double value = 0.0;
  double error = std::numeric_limits<double>::infinity();
  bool told = false;
};

struct Search {
  std::vector<Found> found;
  Eigen::VectorXd point;  ///< where it ended
};

/// What a value's error is to be below, in the natural coordinate.
double most_error(const Parameter& parameter, const Quantity& row) {
  if (parameter.coordinate != Coordinate::kLinear) return kTold;
  return row.always_prior ? kToldCode : kToldAngle;
}

/// Whether a number is one of a code, which means something as a whole.
bool of_code(const Address& path) { return path.quantity->path == "material.latent[#]"; }

Search search(BalanceProblem& problem, const Parameters& parameters,
              const std::vector<std::size_t>& numbers, std::span<const double> values,
              const LeastSquaresOptions& options) {
  std::vector<Parameter> sought;
  for (const std::size_t number : numbers) {
    sought.push_back(parameters.parameters()[number]);
    sought.back().start = values[number];
    // A code without it leaves the space of materials.
    if (!parameters.path(number).quantity->always_prior) sought.back().prior.reset();
  }
  const LeastSquares least_squares(sought, options);
  LeastSquaresState state = least_squares.start();
  while (!state.finished) least_squares.iterate(problem, state);
  least_squares.linearise(problem, state);
  // Test functions overlap: about one residual of three counts.
  const Uncertainty known = uncertainty(sought, state, double(state.residual.size()) / 3.0);
  Search result;
  result.point = state.point;
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    const Coordinate coordinate = sought[k].coordinate;
    Found one;
    one.value = known.estimates[k].value;
    one.error =
        known.estimates[k].standard_error / derivative(coordinate, state.point[Eigen::Index(k)]);
    one.told = !known.estimates[k].at_bound &&
               one.error < most_error(sought[k], *parameters.path(numbers[k]).quantity);
    result.found.push_back(one);
  }
  // A code is one place: where some of it is known, the rest is what goes with that.
  bool some = false;
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    some = some || (of_code(parameters.path(numbers[k])) && result.found[k].told);
  }
  for (std::size_t k = 0; some && k < numbers.size(); ++k) {
    if (of_code(parameters.path(numbers[k]))) result.found[k].told = true;
  }
  return result;
}

/// Why a run's scene cannot be looked at; empty: it can.
std::string obstacle(const mpm::Scene& scene, const Parameters& parameters, std::size_t run,
                     bool any_class) {
  if (scene.bodies.size() != 1) {
    return "there are other bodies, whose contact forces are not known.";
  }
  if (!any_class && scene.bodies.front().material.traits().pressure_dependent) {
    return "the pressure that sand's friction depends on cannot be identified from noisy tracks.";
  }
  if (!scene.bodies.front().masses.empty()) return "masses are attached to the body.";
  if (parameters.places(run, scene.bodies.front().name)) return "the body's place is fitted too.";
  return {};
}

constexpr const char* kTitle = "Starting guess estimated from the recording";

std::vector<std::size_t> of_material(const Parameters& parameters) {
  std::vector<std::size_t> numbers;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (parameters.path(i).quantity->is_material()) numbers.push_back(i);
  }
  return numbers;
}

/// Adds what captures can be looked at; where none can, why the last one cannot.
std::string add_captures(const std::vector<Run>& runs, const std::vector<mpm::Scene>& scenes,
                         const Parameters& parameters, bool any_class, BalanceProblem& problem) {
  std::string why = "no capture can be used.";
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const std::string in_the_way = obstacle(scenes[r], parameters, r, any_class);
    for (const Capture& capture : runs[r].captures) {
      if (capture.used_count == 0) continue;
      if (!in_the_way.empty() || capture.input.front) {
        why = in_the_way.empty() ? "a front is no place of the material." : in_the_way;
        continue;
      }
      try {
        problem.add(r, scenes[r], capture, any_class);
      } catch (const Error& error) {
        if (error.kind() != ErrorKind::kInput) throw;
        why = error.what();
      }
    }
  }
  return why;
}

/// What was moved but for one number at a time; those of a code stay together.
std::vector<std::vector<double>> all_but_one(const Parameters& parameters,
                                             const std::vector<std::size_t>& moved,
                                             const std::vector<double>& best,
                                             std::span<const double> values) {
  std::vector<std::vector<double>> candidates;
  std::vector<std::size_t> done;
  for (const std::size_t number : moved) {
    if (std::find(done.begin(), done.end(), number) != done.end()) continue;
    std::vector<double> without = best;
    for (const std::size_t other : moved) {
      const Address& path = parameters.path(other);
      const bool together = of_code(path) && path.quantity == parameters.path(number).quantity &&
                            path.owner == parameters.path(number).owner;
      if (other != number && !together) continue;
      without[other] = values[other];
      done.push_back(other);
    }
    if (done.size() == moved.size() && candidates.empty()) break;  // there is nothing beside it
    candidates.push_back(std::move(without));
  }
  return candidates;
}

}  // namespace

InteriorTracks interior_tracks(const Capture& capture, double volume) {
  const capture::Tracks& all = capture.input.tracks;
  std::vector<std::size_t> points;
  for (std::size_t i = 0; i < all.points; ++i) {
    if (capture.input.held_out_points[i] == 0 && capture.input.rest[i].allFinite()) {
      points.push_back(i);
    }
  }
  InteriorTracks tracks;
  for (const std::size_t i : points) {
    tracks.rest.push_back(capture.input.rest[i]);
    tracks.sigma += capture.sigma[i] / double(points.size());
  }
  tracks.spacing = std::cbrt(volume / std::max(1.0, double(points.size())));
  const Vec3d unseen = Vec3d::Constant(std::numeric_limits<double>::quiet_NaN());
  for (std::size_t t = 0; t < all.frames() && tracks.times.size() < kMostFrames; ++t) {
    if (all.times[t] < capture.begin - 1e-9) continue;
    if (all.times[t] > capture.end + 1e-9 || capture.input.held_out_frames[t] != 0) break;
    const std::size_t known = tracks.times.size();
    if (known > 1) {
      const double step = tracks.times[1] - tracks.times[0];
      if (std::abs(all.times[t] - tracks.times.back() - step) > kUneven * step) break;
    }
    tracks.times.push_back(all.times[t]);
    for (const std::size_t i : points) {
      tracks.positions.push_back(all.is_visible(t, i) ? all.position(t, i) : unseen);
    }
  }
  return tracks;
}

EquationStart equation_start(const std::vector<Run>& runs, const std::vector<mpm::Scene>& scenes,
                             const Parameters& parameters, std::span<const double> values,
                             int threads, const Interrupter& interrupter) {
  EquationStart result;
  const std::vector<std::size_t> numbers = of_material(parameters);
  if (numbers.empty()) return result;
  Arena arena(threads);
  std::vector<double> best(values.begin(), values.end());
  BalanceProblem problem(parameters, numbers, best, arena, interrupter);
  const std::string why = add_captures(runs, scenes, parameters, false, problem);
  const std::string title = kTitle;
  if (problem.empty()) {
    result.statement = title + ": not possible here, " + why;
    return result;
  }
  std::vector<Found> found;
  try {
    found = search(problem, parameters, numbers, best, kWhole).found;
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kCompute) throw;
    result.statement =
        title + ": not possible here, it could not be evaluated (" + error.what() + ")";
    return result;
  }
  std::string values_found;
  std::string rest;
  std::vector<std::size_t> moved;
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    const Parameter& parameter = parameters.parameters()[numbers[k]];
    if (!found[k].told) {
      rest += (rest.empty() ? "" : ", ") + parameter.name;
      continue;
    }
    best[numbers[k]] = found[k].value;
    moved.push_back(numbers[k]);
    values_found += fmt::format("{}{} {:.4g} {}", values_found.empty() ? "" : ", ", parameter.name,
                                found[k].value, parameter.unit);
    while (values_found.back() == ' ') values_found.pop_back();
  }
  result.statement =
      fmt::format("{}: {}", title,
                  moved.empty() ? "the recording identifies none of the values" : values_found);
  if (!rest.empty()) result.statement += "; not known to a factor of three: " + rest;
  if (moved.empty()) {
    result.statement += ".";
    return result;
  }
  result.candidates.push_back(best);
  for (std::vector<double>& without : all_but_one(parameters, moved, best, values)) {
    result.candidates.push_back(std::move(without));
  }
  return result;
}

EquationStart rank_classes(const std::vector<Run>& runs, const std::vector<mpm::Scene>& scenes,
                           const Parameters& parameters, const std::vector<FlowStart>& starts,
                           int threads, const Interrupter& interrupter) {
  EquationStart result;
  const std::vector<std::size_t> numbers = of_material(parameters);
  if (numbers.empty() || starts.empty()) return result;
  Arena arena(threads);
  BalanceProblem problem(parameters, numbers, starts.front().values, arena, interrupter);
  const std::string why = add_captures(runs, scenes, parameters, true, problem);
  if (problem.empty()) {
    result.statement = std::string(kTitle) + ": not possible here, " + why;
    return result;
  }
  struct Ranked {
    std::string_view name;
    std::vector<double> values;
    double deviance;
  };
  std::vector<Ranked> ranked;
  for (const FlowStart& start : starts) {
    Ranked one{start.name, start.values, std::numeric_limits<double>::infinity()};
    try {
      const Search at = search(problem, parameters, numbers, start.values, kOfClass);
      one.deviance = problem.deviance(at.point);
      for (std::size_t k = 0; k < numbers.size(); ++k) {
        if (at.found[k].told) one.values[numbers[k]] = at.found[k].value;
      }
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::kCompute) throw;
    }
    ranked.push_back(std::move(one));
  }
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const Ranked& a, const Ranked& b) { return a.deviance < b.deviance; });
  std::string said;
  for (Ranked& one : ranked) {
    if (!std::isfinite(one.deviance)) continue;
    said += fmt::format("{}{} {:+.2f}", said.empty() ? "" : ", ", one.name,
                        one.deviance - ranked.front().deviance);
    if (result.candidates.size() < kClasses) result.candidates.push_back(std::move(one.values));
  }
  if (result.candidates.empty()) {
    result.statement = std::string(kTitle) + ": not possible here, in no class of flow.";
    return result;
  }
  result.statement = fmt::format(
      "The momentum balance of the recording was looked at from each class of flow, nearest first "
      "(by what minus twice the logarithm of the likelihood grows, a residual): {}; the first {} "
      "were simulated",
      said, result.candidates.size());
  return result;
}

}  // namespace matterfit::fit
