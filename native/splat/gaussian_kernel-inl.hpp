// SPDX-License-Identifier: GPL-3.0-or-later
// Gaussians into footprints, and the tiles' sums back into gradients, a register of doubles at a
// time. Included once per SIMD target.
#if defined(MATTERFIT_SPLAT_GAUSSIAN_KERNEL_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_SPLAT_GAUSSIAN_KERNEL_INL_HPP
#undef MATTERFIT_SPLAT_GAUSSIAN_KERNEL_INL_HPP
#else
#define MATTERFIT_SPLAT_GAUSSIAN_KERNEL_INL_HPP
#endif

#include <algorithm>
#include <bit>
#include <cmath>

#include "splat/frame.hpp"
#include "splat/projection-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

using DoubleTag = hn::ScalableTag<double>;
using DoubleLanes = Lanes<DoubleTag>;
inline constexpr std::size_t kDoubles = hn::MaxLanes(DoubleTag());

/// The numbers that `number(lane)` gives, in a register.
template <class Number>
HWY_INLINE DoubleLanes collect(const Number& number) {
  alignas(64) double values[kDoubles];
  for (std::size_t lane = 0; lane < kDoubles; ++lane) {
    values[lane] = static_cast<double>(number(lane));
  }
  return DoubleLanes::load(values);
}

/// A register's numbers, one by one: each(lane, number).
template <class Each>
HWY_INLINE void spread(DoubleLanes value, std::size_t count, const Each& each) {
  alignas(64) double values[kDoubles];
  value.store(values);
  for (std::size_t lane = 0; lane < count; ++lane) each(lane, values[lane]);
}

HWY_INLINE bool load_shape(const splat::Gaussians& g, const std::size_t (&index)[kDoubles],
                           GaussianShape<DoubleLanes>& shape) {
  for (int k = 0; k < 3; ++k) {
    shape.mean[k] = collect([&](std::size_t n) { return g.means[index[n]][k]; });
    shape.log_scale[k] = collect([&](std::size_t n) { return g.log_scales[index[n]][k]; });
  }
  for (int k = 0; k < 4; ++k) {
    shape.rotation[k] = collect([&](std::size_t n) { return g.rotations[index[n]][k]; });
  }
  const bool deformed = !g.deformation_gradients.empty();
  if (deformed) {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        shape.f[i][j] =
            collect([&](std::size_t n) { return g.deformation_gradients[index[n]](i, j); });
      }
  }
  return deformed;
}

/// ½ + Σ sh Y, before it is cut off at 0.
HWY_INLINE void colour_of(const splat::Gaussians& g, const std::size_t (&index)[kDoubles],
                          const DoubleLanes (&y)[16], DoubleLanes (&colour)[3]) {
  const std::size_t bands = splat::sh_bands(g.sh_degree);
  for (std::size_t c = 0; c < 3; ++c) {
    colour[c] = DoubleLanes(0.5);
    for (std::size_t band = 0; band < bands; ++band) {
      const DoubleLanes coefficient =
          collect([&](std::size_t n) { return g.sh[(index[n] * bands + band) * 3 + c]; });
      colour[c] = fma(coefficient, y[band], colour[c]);
    }
  }
}

/// Σ₂⁻¹ log₂(e)/2 = L Lᵀ with the zero above: w of dy alone, from the Schur complement 1/yy.
struct InverseFactor {
  DoubleLanes l11, l21, l22;
};

HWY_INLINE InverseFactor inverse_factor(const Projection<DoubleLanes>& at) {
  const DoubleLanes half(splat::kHalfLog2E);
  const DoubleLanes yy = at.covariance[2];
  const DoubleLanes l11 = sqrt(half * yy / at.determinant);
  return {l11, -(l11 * at.covariance[1] / yy), sqrt(half / yy)};
}

inline void project_gaussians(splat::Frame& frame, const splat::Gaussians& g, std::size_t begin,
                              std::size_t end) {
  const splat::View& view = frame.view;
  for (std::size_t first = begin; first < end; first += kDoubles) {
    const std::size_t count = std::min(kDoubles, end - first);
    std::size_t index[kDoubles];
    for (std::size_t n = 0; n < kDoubles; ++n) index[n] = first + std::min(n, count - 1);
    GaussianShape<DoubleLanes> shape;
    const bool deformed = load_shape(g, index, shape);
    Projection<DoubleLanes> at;
    project(shape, deformed, view, at);
    DoubleLanes direction[3];
    if (g.sh_degree > 0) direction_of(shape.mean, view, direction);
    DoubleLanes y[16];
    sh_basis(g.sh_degree, direction, y);
    DoubleLanes colour[3];
    colour_of(g, index, y, colour);
    DoubleLanes log2_opacity = log(collect([&](std::size_t n) { return g.opacities[index[n]]; })) *
                               DoubleLanes(2.0 * splat::kHalfLog2E);
    if (view.antialiased) {
      log2_opacity += log(at.sharp / at.determinant) * DoubleLanes(splat::kHalfLog2E);
    }
    const InverseFactor l = inverse_factor(at);
    const DoubleLanes room =
        max(log2_opacity - DoubleLanes(splat::kSmallestLog2), DoubleLanes(0.0)) /
        DoubleLanes(splat::kHalfLog2E);
    const DoubleLanes half_x = sqrt(room * at.covariance[0]);
    const DoubleLanes half_y = sqrt(room * at.covariance[2]);

    alignas(64) double numbers[12][kDoubles];
    const DoubleLanes all[12] = {at.mean[0],
                                 at.mean[1],
                                 half_x,
                                 half_y,
                                 l.l11,
                                 l.l21,
                                 l.l22,
                                 log2_opacity,
                                 at.depth,
                                 max(colour[0], DoubleLanes(0.0)),
                                 max(colour[1], DoubleLanes(0.0)),
                                 max(colour[2], DoubleLanes(0.0))};
    for (std::size_t k = 0; k < 12; ++k) all[k].store(numbers[k]);
    for (std::size_t n = 0; n < count; ++n) {
      splat::Footprint& f = frame.footprints[first + n];
      f = {{numbers[0][n], numbers[1][n]},
           {numbers[2][n], numbers[3][n]},
           numbers[4][n],
           numbers[5][n],
           numbers[6][n],
           static_cast<float>(numbers[7][n]),
           static_cast<float>(numbers[8][n]),
           {static_cast<float>(numbers[9][n]), static_cast<float>(numbers[10][n]),
            static_cast<float>(numbers[11][n])}};
      // Comparisons that a NaN fails; singular or overflown Σ₂ have l11 or l22 of 0, ∞ or NaN.
      const double largest = 1e30;
      const bool seen = numbers[8][n] > view.near_plane && f.log2_opacity > splat::kSmallestLog2 &&
                        f.l11 > 0.0 && f.l11 < largest && f.l22 > 0.0 && f.l22 < largest &&
                        std::abs(f.l21) < largest && f.half[0] < largest && f.half[1] < largest &&
                        f.mean[0] + f.half[0] > 0.0 && f.mean[0] - f.half[0] < view.width &&
                        f.mean[1] + f.half[1] > 0.0 && f.mean[1] - f.half[1] < view.height &&
                        f.depth < static_cast<float>(largest);
      frame.depth_keys[first + n] = seen ? std::bit_cast<std::uint32_t>(f.depth) : splat::kUnseen;
    }
  }
}

inline void gather_gradients(splat::Frame& frame, std::size_t chunk) {
  const splat::Gaussians& g = *frame.gaussians;
  const splat::View& view = frame.view;
  splat::GaussianGradients& out = *frame.gradients;
  const std::size_t bands = splat::sh_bands(g.sh_degree);
  const std::size_t begin = chunk * splat::kChunk;
  const std::size_t end = std::min(begin + splat::kChunk, g.size());
  double* pose = frame.pose.data() + 6 * chunk;
  std::fill(pose, pose + 6, 0.0);
  std::uint32_t seen[splat::kChunk];
  std::size_t seen_count = 0;
  for (std::size_t i = begin; i < end; ++i) {
    seen[seen_count] = static_cast<std::uint32_t>(i);
    seen_count += frame.depth_keys[i] != splat::kUnseen ? 1 : 0;
  }
  for (std::size_t first = 0; first < seen_count; first += kDoubles) {
    const std::size_t count = std::min(kDoubles, seen_count - first);
    std::size_t index[kDoubles];
    alignas(64) double sums[splat::kSums][kDoubles] = {};
    for (std::size_t n = 0; n < kDoubles; ++n) {
      index[n] = seen[first + std::min(n, count - 1)];
      if (n >= count) continue;  // zeros: adds nothing to the pose
      double total[splat::kSums] = {};
      for (std::uint32_t s = frame.first_slot[index[n]]; s < frame.first_slot[index[n] + 1]; ++s) {
        for (std::size_t k = 0; k < splat::kSums; ++k) {
          total[k] += static_cast<double>(frame.slots[s].sum[k]);
        }
      }
      for (std::size_t k = 0; k < splat::kSums; ++k) sums[k][n] = total[k];
    }
    GaussianShape<DoubleLanes> shape;
    const bool deformed = load_shape(g, index, shape);
    Projection<DoubleLanes> at;
    project(shape, deformed, view, at);

    // With d ln α = −(2 ln 2)(u du + w dw) and Lᵀ d = (u, w): ∂/∂μ₂ = 2 ln 2 L Σv(u, w),
    // ∂/∂Σ₂ = ½ Σ₂⁻¹ Σv d dᵀ Σ₂⁻¹ = 2 ln² 2 L Σv(u, w)(u, w)ᵀ Lᵀ.
    const auto [l11, l21, l22] = inverse_factor(at);
    const DoubleLanes su = DoubleLanes::load(sums[1]);
    const DoubleLanes sw = DoubleLanes::load(sums[2]);
    const DoubleLanes suu = DoubleLanes::load(sums[3]);
    const DoubleLanes suw = DoubleLanes::load(sums[4]);
    const DoubleLanes sww = DoubleLanes::load(sums[5]);
    const DoubleLanes first_order(1.0 / splat::kHalfLog2E);
    const DoubleLanes second_order(0.5 / (splat::kHalfLog2E * splat::kHalfLog2E));
    ProjectionAdjoint<DoubleLanes> bar;
    bar.mean[0] = first_order * l11 * su;
    bar.mean[1] = first_order * (l21 * su + l22 * sw);
    bar.depth = DoubleLanes::load(sums[9]);
    const DoubleLanes across = l21 * suu + l22 * suw;
    bar.covariance[0] = second_order * l11 * l11 * suu;
    bar.covariance[1] = DoubleLanes(2.0) * second_order * l11 * across;
    bar.covariance[2] = second_order * (l21 * across + l22 * (l21 * suw + l22 * sww));
    if (view.antialiased) {
      sharpness_adjoint(view, at, DoubleLanes::load(sums[0]), bar);
    }
    ShapeAdjoint<DoubleLanes> adjoint;
    project_adjoint(shape, deformed, view, at, bar, adjoint);

    DoubleLanes direction[3];
    DoubleLanes distance(1.0);
    if (g.sh_degree > 0) distance = direction_of(shape.mean, view, direction);
    DoubleLanes y[16];
    sh_basis(g.sh_degree, direction, y);
    DoubleLanes colour[3];
    colour_of(g, index, y, colour);
    DoubleLanes y_bar[16];
    for (std::size_t band = 0; band < bands; ++band) y_bar[band] = DoubleLanes(0.0);
    for (std::size_t c = 0; c < 3; ++c) {
      const DoubleLanes colour_bar =
          select(colour[c] < DoubleLanes(0.0), DoubleLanes(0.0), DoubleLanes::load(sums[6 + c]));
      for (std::size_t band = 0; band < bands; ++band) {
        const auto place = [&](std::size_t n) { return (index[n] * bands + band) * 3 + c; };
        spread(colour_bar * y[band], count,
               [&](std::size_t n, double value) { out.sh[place(n)] = static_cast<float>(value); });
        if (band > 0) {
          y_bar[band] =
              fma(collect([&](std::size_t n) { return g.sh[place(n)]; }), colour_bar, y_bar[band]);
        }
      }
    }
    if (g.sh_degree > 0) {
      DoubleLanes d_bar[3];
      sh_basis_adjoint(g.sh_degree, direction, y_bar, d_bar);
      direction_adjoint(direction, distance, d_bar, view, adjoint);
    }

    for (int k = 0; k < 3; ++k) {
      spread(adjoint.mean[k], count, [&](std::size_t n, double value) {
        out.means[index[n]][k] = static_cast<float>(value);
      });
      spread(adjoint.log_scale[k], count, [&](std::size_t n, double value) {
        out.log_scales[index[n]][k] = static_cast<float>(value);
      });
    }
    for (int k = 0; k < 4; ++k) {
      spread(adjoint.rotation[k], count, [&](std::size_t n, double value) {
        out.rotations[index[n]][k] = static_cast<float>(value);
      });
    }
    if (deformed) {
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          spread(adjoint.f[i][j], count, [&](std::size_t n, double value) {
            out.deformation_gradients[index[n]](i, j) = static_cast<float>(value);
          });
        }
    }
    for (std::size_t n = 0; n < count; ++n) {
      out.opacities[index[n]] =
          static_cast<float>(sums[0][n] / static_cast<double>(g.opacities[index[n]]));
    }
    for (int k = 0; k < 6; ++k) {
      spread(adjoint.pose[k], count, [&](std::size_t, double value) { pose[k] += value; });
    }
  }
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
