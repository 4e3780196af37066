// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/noise.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "diagnose/autoregression.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Huber's limit in robust standard deviations: 1 of 16 000 normal values lies beyond.
constexpr double kOutlier = 4.0;
/// Samples of a capture, in all its series, from which slow noise can be told from a motion that is
/// wrong; with fewer the stated noise is taken, white, where there is one.
constexpr std::size_t kSamplesForNoise = 30;
/// Between these correlations of a track's noise it hides the errors of places more and more, which
/// stay with a track as well.
constexpr double kPassing = 0.3;
constexpr double kLasting = 0.7;
/// A shared part is looked for from so many tracks on: with fewer the mean is mostly the own parts.
constexpr Index kTracksForCommon = 4;

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double frame_interval(const Capture& capture) {
  std::vector<double> steps;
  steps.reserve(capture.times.size());
  for (std::size_t f = 1; f < capture.times.size(); ++f) {
    steps.push_back(capture.times[f] - capture.times[f - 1]);
  }
  return steps.empty() ? 1.0 : median(std::move(steps));
}

double robust_deviation(const VectorXd& values) {
  std::vector<double> sizes(std::size_t(values.size()));
  for (Index i = 0; i < values.size(); ++i) sizes[std::size_t(i)] = std::abs(values[i]);
  return median(std::move(sizes)) / 0.6745;
}

/// A tracker's own errors last; those that seem to alternate are a fit that took their slow part.
constexpr double kLowestOwn = 0.0;
/// The lowest correlation of the shared part, which is seen in few values: their scatter reaches
/// below 0.
constexpr double kLowestShared = -0.4;

/// Rows of one capture, as chains without gaps.
std::vector<std::vector<Index>> chains_of(const Rows& rows, int capture, double interval) {
  std::vector<std::vector<Index>> chains;
  for (const Series& series : rows.series()) {
    if (series.capture != capture) continue;
    for (Index i = series.begin; i < series.end; ++i) {
      const double step = i > series.begin ? rows.time(i) - rows.time(i - 1) : 0.0;
      if (step < 0.5 * interval || step > 1.5 * interval) chains.emplace_back();
      chains.back().push_back(i);
    }
  }
  return chains;
}

/// Rows of one capture by axis and frame.
std::map<std::pair<int, Index>, std::vector<Index>> frames_of(const Rows& rows, int capture) {
  std::map<std::pair<int, Index>, std::vector<Index>> frames;
  for (const Series& series : rows.series()) {
    if (series.capture != capture) continue;
    for (Index i = series.begin; i < series.end; ++i) {
      frames[{series.axis, rows.frame(i)}].push_back(i);
    }
  }
  return frames;
}

/// Captures of which no row is used have the mean noise of the others, and at least what is stated.
void lend_noise(const std::vector<Capture>& captures, const std::vector<std::size_t>& unseen,
                Noise& noise) {
  const double seen = double(captures.size() - unseen.size());
  if (unseen.empty() || !(seen > 0.0)) return;
  TrackNoise mean;
  for (std::size_t c = 0; c < captures.size(); ++c) {
    if (std::ranges::count(unseen, c) > 0) continue;
    const TrackNoise& track = noise.captures[c];
    mean.sigma += track.sigma * track.sigma / seen;
    mean.correlation += track.correlation / seen;
    mean.common_sigma += track.common_sigma * track.common_sigma / seen;
    mean.common_correlation += track.common_correlation / seen;
    mean.place_sigma += track.place_sigma * track.place_sigma / seen;
    mean.freedom = std::max(mean.freedom, track.freedom);
    mean.plausible = track.plausible;
  }
  mean.sigma = std::sqrt(mean.sigma);
  mean.common_sigma = std::sqrt(mean.common_sigma);
  mean.place_sigma = std::sqrt(mean.place_sigma);
  for (const std::size_t c : unseen) {
    const double interval = noise.captures[c].interval;
    noise.captures[c] = mean;
    noise.captures[c].interval = interval;
    noise.captures[c].sigma = std::max(mean.sigma, captures[c].noise);
  }
}

/// The residual with outliers pulled in, and with what the columns explain taken out.
struct Cleaned {
  VectorXd value;
  MatrixXd basis;  ///< orthonormal, spans the columns
};

Cleaned clean(const VectorXd& residual, const MatrixXd& explained) {
  Cleaned result;
  Eigen::ColPivHouseholderQR<MatrixXd> qr(explained);
  qr.setThreshold(1e-7);
  // Some rows must be left for the noise: the least important columns go.
  const Index rank = std::min(qr.rank(), residual.size() / 2);
  result.basis = qr.householderQ() * MatrixXd::Identity(residual.size(), rank);
  const auto rest = [&](const VectorXd& r) -> VectorXd {
    return r - result.basis * (result.basis.transpose() * r);
  };
  result.value = rest(residual);
  const double limit = kOutlier * robust_deviation(result.value);
  result.value = rest(result.value.cwiseMin(limit).cwiseMax(-limit));
  return result;
}

/// A displacement of all tracks alike says nothing of the noise where explained columns make more
/// than this share of it.
constexpr double kExplainedShare = 0.5;

/// The noise that all tracks share, as the frames' means show it: columns that it is to be told
/// from, and the data last. `means`: a row a frame and axis, the means of columns that are
/// orthonormal over all rows, and in the last column of the data, from which these columns were
/// taken out; `members`: tracks that are seen in each. Many columns leave no row of the means to
/// itself, yet most of them move tracks against each other. Principal angles between their span and
/// displacements of all tracks alike (Björck and Golub 1973) tell which displacements are theirs:
/// these become the columns, and the data is scaled back in the others by the share that went.
MatrixXd of_all_tracks(const MatrixXd& means, const VectorXd& members) {
  const VectorXd scale = members.cwiseSqrt();
  const Index width = means.cols() - 1;
  const MatrixXd scaled = scale.asDiagonal() * means.leftCols(width);
  // Squared cosines of the angles, smallest first.
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(scaled * scaled.transpose());
  const VectorXd& share = solver.eigenvalues();
  Index free = share.size();
  while (free > 0 && share[free - 1] > kExplainedShare) --free;
  const Index explained = share.size() - free;
  MatrixXd result(means.rows(), explained + 1);
  const VectorXd inverse = scale.cwiseInverse();
  result.leftCols(explained) = inverse.asDiagonal() * solver.eigenvectors().rightCols(explained);
  VectorXd data = scale.asDiagonal() * means.col(width);
  for (Index i = 0; i < free; ++i) {
    const auto direction = solver.eigenvectors().col(i);
    data += direction * (direction.dot(data) * share[i] / (1.0 - share[i]));
  }
  result.col(explained) = inverse.asDiagonal() * data;
  return result;
}

/// How many smooth displacements there are: as many as the tracks can distinguish from their
/// errors.
int smooth_shapes(const Capture& capture) {
  const Index tracks = capture.tracks();
  return tracks >= 30 ? 10 : (tracks >= 8 ? 4 : 1);
}

/// What places' errors make of the tracks of one capture.
struct Places {
  double lost = 0.0;      ///< degrees of freedom that taking them out costs
  double square = 0.0;    ///< mean square of a coordinate of a place, with the noise of its mean
  double of_noise = 0.0;  ///< that, for white noise of deviation 1
  double count = 0.0;     ///< of tracks
};

/// Takes out of every track what a wrong place would make of it: from so many rows on, so that
/// something is left. The last column is the data.
Places take_out_places(const std::vector<TrackRows>& tracks, int capture, MatrixXd& rows) {
  constexpr Index kFewestRows = 18;  // six frames
  Places places;
  for (const TrackRows& track : tracks) {
    if (track.capture != capture || track.shift.rows() < kFewestRows) continue;
    MatrixXd values = track.gather(rows);
    const Eigen::Matrix3d information = track.shift.transpose() * track.shift;
    const Eigen::Matrix3d covariance = information.inverse();
    if (!covariance.allFinite()) continue;
    const MatrixXd shifts = covariance * (track.shift.transpose() * values);
    values -= track.shift * shifts;
    track.scatter(values, rows);
    places.square += shifts.rightCols(1).squaredNorm() / 3.0;
    places.of_noise += covariance.trace() / 3.0;
    places.lost += 3.0;
    places.count += 1.0;
  }
  if (places.count > 0.0) {
    places.square /= places.count;
    places.of_noise /= places.count;
  }
  return places;
}

/// Mean square of a place's coordinate that a track's own noise makes.
double square_of_noise(const Places& places, double sigma, double correlation) {
  const double phi = std::max(correlation, 0.0);
  return places.of_noise * sigma * sigma * std::min(50.0, (1.0 + phi) / (1.0 - phi));
}

/// Whether tracks' places are farther off than noise that is correlated in time would make them.
/// `smooth` combinations of the places were taken out before.
bool places_are_wrong(const Places& places, const Autoregression& fit, double smooth) {
  const double free = 3.0 * (places.count - smooth);
  if (!(free > 3.0)) return false;
  // Three standard deviations of a mean square.
  const double limit = 1.0 + 3.0 * std::sqrt(2.0 / free);
  return places.square * places.count >
         limit * (places.count - smooth) * square_of_noise(places, fit.sigma, fit.correlation);
}

}  // namespace

MatrixXd smooth_basis(const Rows& rows, const std::vector<Capture>& captures, int cosines) {
  std::vector<VectorXd> columns;
  for (std::size_t c = 0; c < captures.size(); ++c) {
    const Capture& capture = captures[c];
    const Index tracks = capture.tracks();
    Vec3d centre = Vec3d::Zero();
    for (const Vec3d& x : capture.rest) centre += x / double(tracks);
    double size = 1e-12;
    for (const Vec3d& x : capture.rest) size = std::max(size, (x - centre).norm());
    const int shapes = smooth_shapes(capture);
    double first = 1e300;
    double last = -1e300;
    for (const Series& series : rows.series()) {
      if (series.capture != int(c)) continue;
      first = std::min(first, rows.time(series.begin));
      last = std::max(last, rows.time(series.end - 1));
    }
    for (int axis = 0; axis < 3; ++axis) {
      if (!capture.axes[std::size_t(axis)] || !(last > first)) continue;
      for (int shape = 0; shape < shapes; ++shape) {
        for (int k = 0; k < cosines; ++k) {
          VectorXd column = VectorXd::Zero(rows.size());
          for (const Series& series : rows.series()) {
            if (series.capture != int(c) || series.axis != axis) continue;
            const Vec3d x = (capture.rest[std::size_t(series.track)] - centre) / size;
            const double values[10] = {1.0,         x[0],        x[1],        x[2],
                                       x[0] * x[0], x[1] * x[1], x[2] * x[2], x[0] * x[1],
                                       x[1] * x[2], x[2] * x[0]};
            for (Index i = series.begin; i < series.end; ++i) {
              const double u = (rows.time(i) - first) / (last - first);
              column[i] = values[shape] * std::cos(std::numbers::pi * k * u);
            }
          }
          const double norm = column.norm();
          if (norm > 1e-9 * std::sqrt(double(rows.size()))) columns.push_back(column / norm);
        }
      }
    }
  }
  MatrixXd result(rows.size(), Index(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) result.col(Index(k)) = columns[k];
  return result;
}

Noise estimate_noise(const Rows& rows, const std::vector<Capture>& captures,
                     const VectorXd& residual, const MatrixXd& explained, double floor,
                     const Turns& turns) {
  const Cleaned cleaned = clean(residual, explained);
  MatrixXd all(rows.size(), cleaned.basis.cols() + 1);
  all << cleaned.basis, cleaned.value;

  Noise noise;
  noise.captures.resize(captures.size());
  noise.weights = VectorXd::Ones(rows.size());
  noise.turns = turns;
  const std::vector<TrackRows> tracks_of =
      turns.empty() ? std::vector<TrackRows>{} : track_rows(rows, turns);
  std::vector<std::size_t> unseen;
  for (std::size_t c = 0; c < captures.size(); ++c) {
    TrackNoise& track = noise.captures[c];
    track.interval = frame_interval(captures[c]);
    track.sigma = std::max(floor, captures[c].noise);
    track.plausible.assign(5, 0.0);
    const auto chains = chains_of(rows, int(c), track.interval);
    if (chains.empty()) {
      unseen.push_back(c);
      continue;
    }
    std::size_t samples = 0;
    for (const auto& chain : chains) samples += chain.size();
    if (samples < kSamplesForNoise && captures[c].noise > 0.0) {
      track.freedom = double(samples);
      continue;
    }
    const auto frames = frames_of(rows, int(c));
    std::size_t widest = 0;
    for (const auto& [key, members] : frames) widest = std::max(widest, members.size());
    const bool shared = Index(widest) >= kTracksForCommon;

    MatrixXd own = all;
    MatrixXd means(Index(frames.size()), all.cols());
    VectorXd members_of(Index(frames.size()));
    std::vector<std::vector<Index>> mean_chains;
    if (shared) {
      Index at = 0;
      std::pair<int, Index> before{-1, 0};
      for (const auto& [key, members] : frames) {
        Eigen::RowVectorXd mean = Eigen::RowVectorXd::Zero(all.cols());
        for (const Index i : members) mean += all.row(i) / double(members.size());
        for (const Index i : members) own.row(i) -= mean;
        means.row(at) = mean;
        members_of[at] = double(members.size());
        if (key.first != before.first || key.second != before.second + 1)
          mean_chains.emplace_back();
        mean_chains.back().push_back(at++);
        before = key;
      }
    }
    Autoregression fit = fit_autoregression(Moments(own, chains), kLowestOwn);
    const double smooth = smooth_shapes(captures[c]);
    const Places places = take_out_places(tracks_of, int(c), own);
    const bool misplaced = places_are_wrong(places, fit, smooth);
    if (misplaced) {
      fit = fit_autoregression(Moments(own, chains, places.lost), kLowestOwn);
      correct_for_constants(1.0 / std::max(places.of_noise, 1e-3), fit);
    }
    const double tracks = double(widest);
    // Differences from the mean of n have (1 − 1/n) of the variance, in as many fewer values.
    const double lost = shared ? std::sqrt(tracks / (tracks - 1.0)) : 1.0;
    track.sigma = std::max({fit.sigma * lost, floor, 0.2 * captures[c].noise});
    track.freedom = std::max(fit.freedom / (lost * lost), 1.0);
    track.correlation = fit.correlation;
    track.plausible = fit.plausible;
    if (misplaced) {
      const double square = places.square * places.count / (places.count - smooth) -
                            square_of_noise(places, fit.sigma, fit.correlation);
      track.place_sigma = lost * std::sqrt(std::max(square, 0.0));
    } else if (places.lost > 0.0) {
      // As the noise of the frame that the places come from.
      const double hidden = (track.correlation - kPassing) / (kLasting - kPassing);
      track.place_sigma = track.sigma * std::clamp(hidden, 0.0, 1.0);
    }
    if (shared) {
      // Means of few frames say little of its memory, and both parts come of one tracker.
      const Autoregression mean = fit_autoregression(
          Moments(of_all_tracks(means, members_of), mean_chains), kLowestShared, track.correlation);
      const double own_part = track.sigma * track.sigma / tracks;
      const double ratio = mean.sigma * mean.sigma / own_part;
      // Two standard deviations of a variance that was seen in so many degrees of freedom.
      if (mean.freedom > 3.0 && ratio > 1.0 + 2.0 * std::sqrt(2.0 / mean.freedom)) {
        track.common_sigma = std::sqrt(mean.sigma * mean.sigma - own_part);
        track.common_correlation = std::clamp(mean.correlation, 0.0, kHighestCorrelation);
      }
    }
    // Outliers among the innovations.
    const double phi = track.correlation;
    const VectorXd raw = residual - cleaned.basis * (cleaned.basis.transpose() * residual);
    double fourth = 0.0;
    double second = 0.0;
    double count = 0.0;
    for (const auto& chain : chains) {
      for (std::size_t j = 1; j < chain.size(); ++j) {
        const double z = (raw[chain[j]] - phi * raw[chain[j - 1]]) / std::sqrt(1.0 - phi * phi);
        second += z * z;
        fourth += z * z * z * z;
        count += 1.0;
        const double total = std::hypot(track.sigma, track.common_sigma, track.place_sigma);
        if (std::abs(z) > kOutlier * total) {
          noise.weights[chain[j]] = kOutlier * total / std::abs(z);
        }
      }
    }
    if (second > 0.0) track.kurtosis = count * fourth / (second * second) - 3.0;
  }
  lend_noise(captures, unseen, noise);
  return noise;
}

Noise for_rows(const Noise& noise, const Rows& rows) {
  return Noise{noise.captures, VectorXd::Ones(rows.size()), noise.turns, noise.corrections};
}

bool differ(const Noise& a, const Noise& b) {
  if (std::abs(std::log(a.corrections / b.corrections)) > 0.1) return true;
  for (std::size_t c = 0; c < a.captures.size(); ++c) {
    const TrackNoise& x = a.captures[c];
    const TrackNoise& y = b.captures[c];
    if (std::abs(std::log(x.sigma / y.sigma)) > 0.1 ||
        std::abs(x.correlation - y.correlation) > 0.1 ||
        std::abs(x.common_sigma - y.common_sigma) > 0.1 * (x.sigma + y.sigma) ||
        std::abs(x.place_sigma - y.place_sigma) > 0.1 * (x.sigma + y.sigma)) {
      return true;
    }
  }
  return false;
}

}  // namespace matterfit::diagnose
