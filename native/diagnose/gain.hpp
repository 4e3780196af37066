// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "diagnose/noise.hpp"
#include "diagnose/spread.hpp"
#include "diagnose/study.hpp"

namespace matterfit::diagnose {

/// How much better a model predicts samples that nothing saw.
struct Gain {
  double before = 0.0;  ///< root mean square distance [m], without the cause
  double after = 0.0;   ///< with it
  double floor = 0.0;   ///< of noise and the solver's spread alone
  double value = 0.0;   ///< (before − after)/(before − floor), within [-1, 1]
  double low = 0.0;     ///< 95 % interval, bootstrap over blocks
  double high = 0.0;
  double last_residual = 0.0;  ///< the first naive baseline: each track keeps its last residual [m]
  double free_field = 0.0;     ///< the second: accelerations that are free in body and axis [m]
  bool measurable = false;     ///< there is an excess before to be explained, and samples to see it
};

struct GainOptions {
  int draws = 1000;
  int time_blocks = 4;  ///< a capture
  std::uint64_t seed = 3;
};

/// Residuals of the held-out rows [m].
struct HeldOut {
  Eigen::VectorXd before;
  Eigen::VectorXd after;
  Eigen::VectorXd last_residual;
  Eigen::VectorXd free_field;
};

/// Root mean square distance [m] of a residual over the rows' samples, and what a noise makes of it
/// together with the solver's spread (Spread::deviations() at these rows).
[[nodiscard]] double root_mean_square(const Rows& rows, const Eigen::VectorXd& residual);
[[nodiscard]] double noise_floor(const Rows& rows, const Noise& noise,
                                 const Eigen::MatrixXd& solver);
/// The same of each row, one standard deviation [m].
[[nodiscard]] Eigen::VectorXd noise_sizes(const Rows& rows, const Noise& noise,
                                          const Eigen::MatrixXd& solver);

/// Blocks are captures × times × body regions (body_regions()): neighbours in them share their
/// errors, so that whole blocks are drawn (Künsch 1989).
[[nodiscard]] Gain gain(const Rows& rows, const std::vector<Capture>& captures,
                        const HeldOut& residuals, double floor, const GainOptions& options);

/// The residual a track ends with stays: at held-out rows of a capture the last used residual of
/// the same track and axis, the mean of all last ones of the axis where the track or the capture
/// was not used.
[[nodiscard]] Eigen::VectorXd keep_last_residual(const Study& study,
                                                 const Eigen::VectorXd& stacked);

/// What a free field of `numbers` accelerations would predict: the best of ½ t² × {1, body
/// coordinates} × axes, one after another, fitted to the used rows together with θ, all linear.
/// `stacked`: residual; `theta`: derivatives, in scales; `precision`: of their priors; `white`:
/// whitens used rows. Held-out residual [m].
[[nodiscard]] Eigen::VectorXd free_field_residual(
    const Study& study, const Eigen::VectorXd& stacked, const Eigen::MatrixXd& theta,
    const Eigen::VectorXd& precision,
    const std::function<Eigen::MatrixXd(const Eigen::MatrixXd&)>& white, int numbers);

/// Capture, time and region of a block.
using BlockKey = std::tuple<int, int, int>;

/// Adds the sums of squares of a whitened residual to those of its blocks: whole captures where
/// there are five or more, else four times and the body's regions of each.
void add_by_block(const Rows& rows, const std::vector<Capture>& captures,
                  const Eigen::VectorXd& white, std::map<BlockKey, double>& sums);

/// Region of each track: octants of the body's rest positions about their medians along axes, as
/// far as the body is wide there and a region keeps four tracks.
[[nodiscard]] std::vector<int> body_regions(const Capture& capture);
/// What people may call each region, by its number: "+x −z" is the part of the body at rest beyond
/// its medians along x and below that along z; "all" where there is only one.
[[nodiscard]] std::vector<std::string> region_names(const Capture& capture);

}  // namespace matterfit::diagnose
