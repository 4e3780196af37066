// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/observe.hpp"

#include <algorithm>
#include <cmath>

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// The simulated motion of one capture's tracks.
class Curve {
 public:
  Curve(const Capture& capture, const VectorXd& x, const VectorXd& v, Index first)
      : times_(capture.times), tracks_(capture.tracks()), x_(x), v_(v), first_(first) {}

  [[nodiscard]] Vec3d position(Index frame, Index track) const {
    return x_.segment<3>(row(frame, track));
  }
  [[nodiscard]] Vec3d velocity(Index frame, Index track) const {
    return v_.segment<3>(row(frame, track));
  }
  [[nodiscard]] Vec3d at(double time, Index track) const {
    const Index last = Index(times_.size()) - 1;
    if (last == 0) return position(0, track) + (time - times_[0]) * velocity(0, track);
    const auto above = std::upper_bound(times_.begin(), times_.end(), time);
    const Index i = std::clamp<Index>(Index(above - times_.begin()) - 1, 0, last - 1);
    const double h = times_[std::size_t(i + 1)] - times_[std::size_t(i)];
    const Vec3d v0 = velocity(i, track);
    const Vec3d v1 = velocity(i + 1, track);
    if (time < times_.front() || time > times_.back()) {
      const Index end = time < times_.front() ? 0 : last;
      const double s = time - times_[std::size_t(end)];
      return position(end, track) + s * velocity(end, track) + 0.5 * s * s / h * (v1 - v0);
    }
    const double u = (time - times_[std::size_t(i)]) / h;
    const double w = 1.0 - u;
    return w * w * (1.0 + 2.0 * u) * position(i, track) + u * w * w * h * v0 +
           u * u * (3.0 - 2.0 * u) * position(i + 1, track) - u * u * w * h * v1;
  }

 private:
  [[nodiscard]] Index row(Index frame, Index track) const {
    return first_ + 3 * (frame * tracks_ + track);
  }
  const std::vector<double>& times_;
  Index tracks_;
  const VectorXd& x_;
  const VectorXd& v_;
  Index first_;
};

Vec3d moved(const Observed& o, double since, const Vec3d& x) {
  const Vec3d arm = x - o.effect->pivot;
  switch (o.effect->observation) {
    case Observation::kScale:
      return x + o.values[0] * arm;
    case Observation::kLens: {
      const Vec3d across = arm - o.effect->axis.dot(arm) * o.effect->axis;
      return x + o.values[0] * across.squaredNorm() * across;
    }
    case Observation::kDrift:
      return x + since * o.values.head<3>();
    case Observation::kOffset:
      return x + o.values.head<3>();
    default:
      return x;
  }
}

/// y of τ ẏ = x − y from y = x at the first frame, exact for x linear between frames.
void lag(const Capture& capture, double tau, Eigen::Ref<VectorXd> x) {
  if (!(tau > 0.0)) return;
  const Index width = 3 * capture.tracks();
  VectorXd seen = x.head(width);
  VectorXd before = seen;
  for (std::size_t f = 1; f < capture.times.size(); ++f) {
    auto now = x.segment(Index(f) * width, width);
    const double h = capture.times[f] - capture.times[f - 1];
    const double decay = std::exp(-h / tau);
    const VectorXd rate = (now - before) / h;
    const VectorXd next = now - tau * rate + decay * (seen - before + tau * rate);
    before = now;
    now = next;
    seen = next;
  }
}

}  // namespace

bool acts_in(const Effect& effect, int capture) {
  return effect.captures.empty() || std::ranges::count(effect.captures, capture) > 0;
}

double time_shift(const Observed& o, double time, double first, const Vec3d& x) {
  const double alpha = o.values[0];
  switch (o.effect->observation) {
    case Observation::kTimeOffset:
      return alpha;
    case Observation::kFrameRate:
      return alpha * (time - first);
    case Observation::kRollingShutter:
      return alpha * o.effect->axis.dot(x - o.effect->pivot);
    default:
      return 0.0;
  }
}

Vec3d undone(const Observed& o, double since, const Vec3d& x) {
  const Vec3d& pivot = o.effect->pivot;
  switch (o.effect->observation) {
    case Observation::kScale:
      return pivot + (x - pivot) / (1.0 + o.values[0]);
    case Observation::kDrift:
      return x - since * o.values.head<3>();
    case Observation::kOffset:
      return x - o.values.head<3>();
    default:
      return x;
  }
}

VectorXd velocities(const Motion& motion, const std::vector<Capture>& captures) {
  if (motion.velocities.size() == motion.positions.size()) return motion.velocities;
  VectorXd v = VectorXd::Zero(motion.positions.size());
  Index first = 0;
  for (const Capture& capture : captures) {
    const Index width = 3 * capture.tracks();
    const Index frames = Index(capture.times.size());
    const auto x = [&](Index f) { return motion.positions.segment(first + f * width, width); };
    const auto slope = [&](Index f) -> VectorXd {
      return (x(f + 1) - x(f)) /
             (capture.times[std::size_t(f + 1)] - capture.times[std::size_t(f)]);
    };
    for (Index f = 0; f < frames && frames > 1; ++f) {
      auto out = v.segment(first + f * width, width);
      if (frames == 2) {
        out = slope(0);
        continue;
      }
      const Index m = std::clamp<Index>(f, 1, frames - 2);
      const double a = capture.times[std::size_t(m)] - capture.times[std::size_t(m - 1)];
      const double b = capture.times[std::size_t(m + 1)] - capture.times[std::size_t(m)];
      const VectorXd s0 = slope(m - 1);
      const VectorXd s1 = slope(m);
      // The parabola through three frames, at the left, middle or right one.
      const double at = f < m ? -a : (f > m ? b : 0.0);
      out = (b * s0 + a * s1) / (a + b) + 2.0 * at * (s1 - s0) / (a + b);
    }
    first += frames * width;
  }
  return v;
}

VectorXd observe(const Motion& motion, const std::vector<Capture>& captures,
                 std::span<const Observed> observations) {
  VectorXd result = motion.positions;
  if (observations.empty()) return result;
  const VectorXd v = velocities(motion, captures);
  Index first = 0;
  for (std::size_t c = 0; c < captures.size(); ++c) {
    const Capture& capture = captures[c];
    const Curve curve(capture, motion.positions, v, first);
    const double start = capture.times.front();
    for (std::size_t f = 0; f < capture.times.size(); ++f) {
      const double time = capture.times[f];
      for (Index i = 0; i < capture.tracks(); ++i) {
        const Vec3d x = curve.position(Index(f), i);
        double shift = 0.0;
        for (const Observed& o : observations) {
          if (acts_in(*o.effect, int(c))) shift += time_shift(o, time, start, x);
        }
        Vec3d seen = shift == 0.0 ? x : curve.at(time + shift, i);
        for (const Observed& o : observations) {
          if (acts_in(*o.effect, int(c))) seen = moved(o, time - start, seen);
        }
        result.segment<3>(first + 3 * (Index(f) * capture.tracks() + i)) = seen;
      }
    }
    for (const Observed& o : observations) {
      if (o.effect->observation == Observation::kLag && acts_in(*o.effect, int(c))) {
        lag(capture, o.values[0], result.segment(first, 3 * capture.samples()));
      }
    }
    first += 3 * capture.samples();
  }
  return result;
}

}  // namespace matterfit::diagnose
