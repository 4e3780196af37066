// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/spread.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include "diagnose/members.hpp"

namespace matterfit::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Standard deviations of Numerics::lumping_slope and lumping_bend: those of five to seven linear
/// elements across a body, whose pattern is nearly, but not quite, symmetric.
constexpr double kLumpingSlope = 0.02;
constexpr double kLumpingBend = 0.08;

/// Members' contacts: to what power of e their stiffness is another one, and what their damping has
/// more of at most, as a share of critical.
constexpr double kContactStiffness = 1.0;
constexpr double kContactDamping = 0.3;
/// Numerics::loss at most: what finite elements lose at a corner beside particles is 1 to 2 %.
constexpr double kLoss = 0.02;

/// Runs that lump masses by one standard deviation otherwise, one for each way.
std::vector<Numerics> ways_to_lump() {
  std::vector<Numerics> result;
  for (Index a = 0; a < 3; ++a) result.emplace_back().lumping_slope[a] = kLumpingSlope;
  for (std::size_t b = 0; b < Numerics{}.lumping_bend.size(); ++b) {
    result.emplace_back().lumping_bend[b] = kLumpingBend;
  }
  return result;
}

/// Deviations of the runs from..to that ended, rows × runs.
MatrixXd deviations(const std::vector<std::optional<VectorXd>>& runs, std::size_t from,
                    std::size_t to) {
  std::vector<std::size_t> done;
  for (std::size_t i = from; i < to; ++i) {
    if (runs[i]) done.push_back(i);
  }
  MatrixXd result(runs[0]->size(), Index(done.size()));
  for (std::size_t k = 0; k < done.size(); ++k) result.col(Index(k)) = *runs[done[k]] - *runs[0];
  return result;
}

constexpr Index kRigid = 6;
/// The rigid motion in each frame of contact, off by one standard deviation along and about each
/// axis; stacked rows × 6 a frame.
MatrixXd rigid_errors_in_contact(const Study& study) {
  const Model& model = study.model();
  const std::vector<ContactFrame> contacts = model.contact_frames();
  MatrixXd result = MatrixXd::Zero(study.size(), kRigid * Index(contacts.size()));
  std::map<std::pair<int, Index>, std::pair<Index, Vec3d>> columns;  // and the tracks' centre
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const Capture& capture = model.captures()[std::size_t(contacts[k].capture)];
    Vec3d sum = Vec3d::Zero();
    double seen = 0.0;
    for (Index i = 0; i < capture.tracks(); ++i) {
      const Index sample = contacts[k].frame * capture.tracks() + i;
      if (capture.use[std::size_t(sample)] == Use::kIgnored) continue;
      sum += capture.positions.segment<3>(3 * sample);
      seen += 1.0;
    }
    columns[{contacts[k].capture, contacts[k].frame}] = {kRigid * Index(k),
                                                         sum / std::max(seen, 1.0)};
  }
  const auto fill = [&](const Rows& rows, Index first) {
    for (const Series& series : rows.series()) {
      const Capture& capture = model.captures()[std::size_t(series.capture)];
      for (Index i = series.begin; i < series.end; ++i) {
        const auto found = columns.find({series.capture, rows.frame(i)});
        if (found == columns.end()) continue;
        const auto& [column, center] = found->second;
        const ContactFrame& contact = contacts[std::size_t(column / kRigid)];
        const Index sample = rows.frame(i) * capture.tracks() + series.track;
        const Vec3d arm = capture.positions.segment<3>(3 * sample) - center;
        result(first + i, column + series.axis) = contact.place;
        for (int axis = 0; axis < 3; ++axis) {
          result(first + i, column + 3 + axis) =
              contact.turn * Vec3d::Unit(axis).cross(arm)[series.axis];
        }
      }
    }
  };
  fill(study.used(), 0);
  fill(study.held(), study.used().size());
  return result;
}

/// The factor on those errors with which what a simulation misses in the used frames of
/// contact is usual: how otherwise another solver holds a body is seen there at once.
double size_of_contacts(const Study& study, const MatrixXd& errors, const VectorXd& prediction) {
  constexpr double kLeast = 0.15;
  constexpr double kMost = 3.0;
  const Index used = study.used().size();
  const VectorXd noise = stated_noise(study.model(), study.used());
  const VectorXd missed =
      noise.cwiseInverse().asDiagonal() * (study.measured() - prediction).head(used);
  double sum = 0.0;
  double count = 0.0;
  for (Index k = 0; k + kRigid <= errors.cols(); k += kRigid) {
    const MatrixXd columns =
        noise.cwiseInverse().asDiagonal() * errors.middleCols(k, kRigid).topRows(used);
    const MatrixXd information = columns.transpose() * columns;
    const Eigen::LDLT<MatrixXd> factors(information);
    if (factors.vectorD().minCoeff() <= 1e-9 * factors.vectorD().maxCoeff()) continue;
    const VectorXd found = factors.solve(columns.transpose() * missed);
    sum += found.squaredNorm() - factors.solve(MatrixXd::Identity(kRigid, kRigid)).trace();
    count += double(kRigid);
  }
  return count > 0.0 ? std::clamp(std::sqrt(std::max(0.0, sum / count)), kLeast, kMost) : 1.0;
}

}  // namespace

Spread Spread::none(Index rows) { return {MatrixXd(rows, 0), MatrixXd(rows, 0), {}}; }

Spread Spread::at(const std::vector<Index>& places) const {
  Spread result{members(places, Eigen::all), directions(places, Eigen::all), {}};
  if (bias.size() > 0) result.bias = bias(places);
  return result;
}

Spread Spread::top(Index rows) const {
  Spread result{members.topRows(rows), directions.topRows(rows), {}};
  if (bias.size() > 0) result.bias = bias.head(rows);
  return result;
}

Spread Spread::bottom(Index rows) const {
  Spread result{members.bottomRows(rows), directions.bottomRows(rows), {}};
  if (bias.size() > 0) result.bias = bias.tail(rows);
  return result;
}

MatrixXd Spread::deviations() const {
  MatrixXd result(members.rows(), members.cols() + directions.cols());
  result << members / std::sqrt(std::max(1.0, double(members.cols()))), directions;
  return result;
}

Spread numerical_spread(const Study& study, const State& state, const MatrixXd& theta,
                        const SpreadRuns& which) {
  Spread spread = Spread::none(study.size());
  if (!study.model().has_numerics() || which.members <= 0) return spread;
  constexpr double kRatio = 1.26;  // 2^(1/3): twice the cells
  std::vector<Numerics> variants(3);
  variants[1].spacing = 1.0 / kRatio;
  variants[2].spacing = kRatio;
  for (int m = 1; m <= which.members; ++m) {
    // The additive recurrence of the plastic number and its powers: evenly spread in four
    // dimensions for any count (Roberts 2018; root of x⁵ = x + 1).
    constexpr double kRoot = 1.1673039782614187;
    const auto fraction = [](double x) { return x - std::floor(x); };
    const auto part = [&](int power) { return fraction(0.5 + m / std::pow(kRoot, power)); };
    Numerics numerics;
    numerics.spacing = 0.85 * std::pow(kRatio / 0.85, part(1));
    numerics.offset = Vec3d(part(2), part(3), part(4));
    numerics.step = m % 4 == 0 ? 0.5 : 1.0;  // half of dt costs twice the time
    numerics.seed = m;
    // Further dimensions by other irrational numbers (Weyl).
    const auto along = [&](double root) { return fraction(0.5 + m * root); };
    numerics.contact_stiffness =
        std::exp(kContactStiffness * (2.0 * along(std::numbers::sqrt2) - 1.0));
    numerics.contact_damping = kContactDamping * along(std::numbers::sqrt3);
    numerics.loss = kLoss * along(std::sqrt(5.0));
    variants.push_back(numerics);
  }
  const std::size_t sampled = variants.size();
  if (which.directions) std::ranges::copy(ways_to_lump(), std::back_inserter(variants));
  auto runs = study.predict_variants(std::vector<State>(variants.size(), state), variants);
  if (!runs[0]) return spread;
  bring_near(study, state, theta, variants, which.adapted, runs);
  if (runs[1] && runs[2]) spread.bias = (*runs[2] - *runs[1]) / (kRatio - 1.0 / kRatio);
  spread.members = deviations(runs, 3, sampled);
  const MatrixXd lumping = deviations(runs, sampled, runs.size());
  MatrixXd contact = which.directions ? rigid_errors_in_contact(study) : MatrixXd(study.size(), 0);
  contact *= size_of_contacts(study, contact, *runs[0]);
  spread.directions.resize(study.size(), lumping.cols() + contact.cols());
  spread.directions << lumping, contact;
  return spread;
}

SolverColumns solver_columns(const Rows& rows, const std::vector<Capture>& captures,
                             const Spread& spread) {
  constexpr double kOwnPattern = 0.5;
  // Weights of 1, cos πu, … with u the time in the clip; the mean square of a cosine is a half.
  constexpr std::array<double, 4> kTimes = {0.4, 0.6, 0.4, 0.2};
  // Weights of 1 and of each coordinate over the body's size, whose mean square is about a fifth.
  constexpr std::array<double, 4> kPlaces = {0.5, 0.8, 0.8, 0.8};
  SolverColumns result;
  const MatrixXd& members = spread.members;
  const Index count = members.cols();
  const Index modes = Index(kTimes.size() * kPlaces.size());
  MatrixXd patterns(rows.size(), modes);
  for (const Series& series : rows.series()) {
    const Capture& capture = captures[std::size_t(series.capture)];
    Vec3d centre = Vec3d::Zero();
    for (const Vec3d& x : capture.rest) centre += x / double(capture.tracks());
    double size = 1e-12;
    for (const Vec3d& x : capture.rest) size = std::max(size, (x - centre).norm());
    const Vec3d x = (capture.rest[std::size_t(series.track)] - centre) / size;
    const double span = std::max(capture.times.back() - capture.times.front(), 1e-12);
    for (Index i = series.begin; i < series.end; ++i) {
      const double u = (rows.time(i) - capture.times.front()) / span;
      for (std::size_t t = 0; t < kTimes.size(); ++t) {
        const double time = std::sqrt(kTimes[t]) * std::cos(std::numbers::pi * double(t) * u);
        for (std::size_t p = 0; p < kPlaces.size(); ++p) {
          const double place = std::sqrt(kPlaces[p]) * (p == 0 ? 1.0 : x[Index(p) - 1]);
          patterns(i, Index(t * kPlaces.size() + p)) = time * place;
        }
      }
    }
  }
  const double share = 1.0 / std::sqrt(std::max(1.0, double(count)));
  const double first = std::sqrt(1.0 - kOwnPattern + kOwnPattern * kTimes[0] * kPlaces[0]);
  result.values.resize(rows.size(), count * modes + spread.directions.cols());
  result.values.rightCols(spread.directions.cols()) = spread.directions;
  result.member.reserve(std::size_t(result.values.cols()));
  for (Index m = 0; m < count; ++m) {
    for (Index k = 0; k < modes; ++k) {
      auto column = result.values.col(m * modes + k);
      if (k == 0) {
        column = share * first * members.col(m);
      } else {
        column = share * std::sqrt(kOwnPattern) * members.col(m).cwiseProduct(patterns.col(k));
      }
      result.member.push_back(int(m));
    }
  }
  result.member.resize(std::size_t(result.values.cols()), -1);
  return result;
}

}  // namespace matterfit::diagnose
