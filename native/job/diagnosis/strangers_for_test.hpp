// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <random>
#include <vector>

#include "base/vec.hpp"
#include "capture/npz.hpp"

/// Recordings that another discretisation made, masses and springs, with an effect hidden in them,
/// as a stranger would send them: tracks of a mesh's vertices with its faces, noise in every frame,
/// points that are lost now and then.
namespace matterfit::job::strangers {

inline constexpr int kAcross = 5;  // masses along an edge
inline constexpr double kEdge = 0.4;
inline constexpr double kFps = 30.0;
inline constexpr int kStrangerFrames = 20;
inline constexpr double kSigma = 4e-4;  // of a coordinate [m]
inline constexpr double kLost = 0.05;

/// What the truth has and the scene does not.
struct Hidden {
  double gravity = 9.81;
  double drag = 0.0;             // of |v| v, a mass [1/m]
  double delay = 0.0;            // of all frames but the first [frames]
  std::size_t swapped_from = 0;  // frame from which two vertices go on as each other; 0: none
  double correlation = 0.0;      // of the noise from frame to frame
  double shared = 0.0;           // share of its variance that all points have alike
  double dashpots = 0.0;         // along springs, of a mass [1/s]
  double stiffer = 1.0;          // factor of the springs in a ball towards +y
  double kick = 0.0;             // that one half of the masses gets after frame 6 [m/s]
  double gust = 0.0;             // acceleration along y from frame 5 to 9 [m/s²]
  double clock = 0.0;            // of the first frame [s]
};

/// How the body is put there.
enum class Put : std::uint8_t {
  kThrown,  // with a spin
  kHeld,    // the face at x = 0 for good, and let go of; springs are those of an isotropic solid
};

/// A cube of masses on a lattice, springs between neighbours along edges and diagonals.
class Springs {
 public:
  explicit Springs(Put put, const Hidden& hidden) : hidden_(hidden) {
    const bool held = put == Put::kHeld;
    for (int i = 0; i < kAcross * kAcross * kAcross; ++i) {
      const std::array<int, 3> place{i % kAcross, i / kAcross % kAcross, i / kAcross / kAcross};
      const Vec3d at(place[0], place[1], place[2]);
      x_.push_back(kEdge / (kAcross - 1) * at + Vec3d(0.0, 0.0, 3.0));
      const Vec3d arm = x_.back() - Vec3d(0.5 * kEdge, 0.5 * kEdge, 3.0 + 0.5 * kEdge);
      v_.push_back(held ? Vec3d(0.0, 0.0, 0.0)
                        : Vec3d(Vec3d(5.0, 2.0, 1.5) + Vec3d(0.6, -1.0, 0.8).cross(arm)));
      // What lies in the surface is shared with nothing.
      double mass = 1.0;
      for (const int p : place) mass *= held && (p == 0 || p == kAcross - 1) ? 0.5 : 1.0;
      mass_.push_back(mass);
      fixed_.push_back(held && place[0] == 0);
    }
    const double spacing = kEdge / (kAcross - 1);
    const double stiffness = held ? 8000.0 : 2000.0;  // of a mass [1/s²]
    for (std::size_t a = 0; a < x_.size(); ++a) {
      for (std::size_t b = a + 1; b < x_.size(); ++b) {
        const double length = (x_[b] - x_[a]).norm();
        if (!(length < (held ? 1.5 : 1.8) * spacing)) continue;
        double share = 1.0;
        for (int axis = 0; axis < 3; ++axis) {
          const bool level = std::abs(x_[a][axis] - x_[b][axis]) < 1e-9;
          const double low = x_[a][axis] - (axis == 2 ? 3.0 : 0.0);
          const bool outside = low < 1e-9 || low > kEdge - 1e-9;
          if (held && level && outside) share *= 0.5;
        }
        const Vec3d middle = 0.5 * (x_[a] + x_[b]) - Vec3d(0.5 * kEdge, 0.5 * kEdge, 3.0);
        const bool inside = (middle - Vec3d(0.0, 0.3 * kEdge, 0.5 * kEdge)).norm() < 0.35 * kEdge;
        springs_.push_back({a, b, length, share * stiffness * (inside ? hidden.stiffer : 1.0),
                            share * hidden.dashpots});
      }
    }
  }

  [[nodiscard]] const Points& positions() const { return x_; }

  void kick() {
    for (std::size_t i = 0; i < x_.size() / 2; ++i) v_[i] += Vec3d(0.0, hidden_.kick, 0.0);
  }

  void step(double dt, bool pushed) {
    std::vector<Vec3d> a(x_.size(), Vec3d(0.0, pushed ? hidden_.gust : 0.0, -hidden_.gravity));
    for (const Spring& s : springs_) {
      const Vec3d d = x_[s.b] - x_[s.a];
      const double length = d.norm();
      const double rate = (v_[s.b] - v_[s.a]).dot(d) / length;
      const Vec3d pull = (s.stiffness * (1.0 - s.length / length) + s.dashpot * rate / length) * d;
      a[s.a] += pull / mass_[s.a];
      a[s.b] -= pull / mass_[s.b];
    }
    for (std::size_t i = 0; i < x_.size(); ++i) {
      if (fixed_[i]) continue;
      a[i] -= hidden_.drag * v_[i].norm() * v_[i];
      v_[i] += dt * a[i];
      x_[i] += dt * v_[i];
    }
  }

 private:
  struct Spring {
    std::size_t a;
    std::size_t b;
    double length;
    double stiffness;
    double dashpot;
  };
  Hidden hidden_;
  Points x_;
  std::vector<Vec3d> v_;
  std::vector<double> mass_;
  std::vector<bool> fixed_;
  std::vector<Spring> springs_;
};

/// Vertices of the surface, by their masses, and its faces over them.
struct Skin {
  std::vector<std::size_t> masses;
  std::vector<std::int32_t> faces;

  Skin() {
    std::vector<std::int32_t> vertex(std::size_t(kAcross) * kAcross * kAcross, -1);
    const auto index = [&](std::array<int, 3> at) {
      const int place = at[0] + kAcross * (at[1] + kAcross * at[2]);
      const auto mass = std::size_t(place);
      if (vertex[mass] < 0) {
        vertex[mass] = std::int32_t(masses.size());
        masses.push_back(mass);
      }
      return vertex[mass];
    };
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const int side : {0, kAcross - 1}) {
        for (int i = 0; i + 1 < kAcross; ++i) {
          for (int j = 0; j + 1 < kAcross; ++j) {
            std::array<std::array<int, 2>, 4> ring{
                {{i, j}, {i + 1, j}, {i + 1, j + 1}, {i, j + 1}}};
            if (side == 0) std::reverse(ring.begin(), ring.end());
            for (const auto& corner : ring) {
              std::array<int, 3> at{};
              at[axis] = side;
              at[(axis + 1) % 3] = corner[0];
              at[(axis + 2) % 3] = corner[1];
              faces.push_back(index(at));
            }
          }
        }
      }
    }
  }
};

/// Writes what is seen of it, as `positions`, `times`, `visible` and `faces`.
inline void record_stranger(const std::filesystem::path& file, const Hidden& hidden, unsigned seed,
                            Put put = Put::kThrown) {
  const Skin skin;
  Springs body(put, hidden);
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal(0.0, kSigma);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  constexpr int kSubsteps = 200;
  const int late = int(std::lround(hidden.delay * kSubsteps));
  const double fresh = std::sqrt(1.0 - hidden.correlation * hidden.correlation);
  const double shared_share = std::sqrt(hidden.shared);
  const double own_share = std::sqrt(1.0 - hidden.shared);
  std::array<double, 3> shaking{};
  std::vector<double> noise(3 * skin.masses.size(), 0.0);
  std::vector<double> positions;
  std::vector<double> times;
  std::vector<std::uint8_t> visible;
  for (int frame = 0; frame < kStrangerFrames; ++frame) {
    const int steps = frame == 0 ? 0 : kSubsteps + (frame == 1 ? late : 0);
    if (frame == 7) body.kick();
    for (int s = 0; s < steps; ++s) body.step(1.0 / kFps / kSubsteps, frame > 5 && frame <= 9);
    times.push_back(hidden.clock + frame / kFps);
    if (hidden.shared > 0.0) {
      for (double& axis : shaking) {
        axis =
            frame == 0 ? normal(generator) : hidden.correlation * axis + fresh * normal(generator);
      }
    }
    for (std::size_t k = 0; k < skin.masses.size(); ++k) {
      const bool seen = frame == 0 || unit(generator) > kLost;
      visible.push_back(seen ? 1 : 0);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        double& own = noise[3 * k + axis];
        own = frame == 0 ? normal(generator) : hidden.correlation * own + fresh * normal(generator);
        const double off = own_share * own + shared_share * shaking[axis];
        positions.push_back(seen ? body.positions()[skin.masses[k]][int(axis)] + off
                                 : std::numeric_limits<double>::quiet_NaN());
      }
    }
  }
  const std::size_t frames = times.size();
  const std::size_t points = skin.masses.size();
  if (hidden.swapped_from > 0) {
    for (std::size_t f = hidden.swapped_from; f < frames; ++f) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        std::swap(positions[3 * (points * f + 7) + axis], positions[3 * (points * f + 30) + axis]);
      }
      std::swap(visible[points * f + 7], visible[points * f + 30]);
    }
  }
  capture::Arrays arrays;
  arrays["positions"] = capture::Array({frames, points, 3}, positions);
  arrays["times"] = capture::Array({frames}, times);
  arrays["visible"] = capture::Array({frames, points}, visible);
  arrays["faces"] = capture::Array({skin.faces.size() / 4, 4}, skin.faces);
  capture::write_npz(file, arrays);
}

}  // namespace matterfit::job::strangers
