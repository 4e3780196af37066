// SPDX-License-Identifier: GPL-3.0-or-later
// The published law on a panel of points: F = F_trial + α R X_plastic, τ = R X_elastic Fᵀ, each net
// fed with the thirteen invariants of the deformation before it (NCLaw, «invariant full»). τ is not
// symmetrised, as published: it can create angular momentum. Included once per SIMD target.
#if defined(MATTERFIT_MATERIAL_NEURAL_PUBLISHED_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATERIAL_NEURAL_PUBLISHED_INL_HPP
#undef MATTERFIT_MATERIAL_NEURAL_PUBLISHED_INL_HPP
#else
#define MATTERFIT_MATERIAL_NEURAL_PUBLISHED_INL_HPP
#endif

#include "material/neural/published_net-inl.hpp"
#include "material/neural/signed_svd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class S>
struct PublishedView {
  NetView<S> elastic;
  NetView<S> plastic;
  S flow;  ///< α of the substep (published_flow())
};

/// A deformation as a net sees it.
template <class T>
struct NetPoint {
  SignedSvd<T> svd;
  Mat3<T> h;  ///< F − I, clamped
  Mat3<T> r;  ///< U Vᵀ
};

/// Writes the invariants of F = I + `h` to register `g` of the panel's x: σ − 1 descending,
/// FᵀF − I by rows, det F − 1.
template <class T>
HWY_INLINE NetPoint<T> enter_net(const Mat3<T>& h, NetPanel<T>& panel, int g) {
  NetPoint<T> point;
  point.svd = signed_svd(h);
  T features[kNetFeatures];
  point.h = clamp_stretches(h, point.svd, features);
  point.r = multiply_transpose(point.svd.u, point.svd.v);
  const Mat3<T> c = to_matrix(right_cauchy_green_minus_identity(point.h));
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) features[3 + 3 * i + j] = c[i][j];
  features[12] = determinant_minus_one(point.h);
  for (std::size_t i = 0; i < kNetFeatures; ++i) {
    LaneTraits<T>::store(features[i], panel.x + i * kPanel<T> + g * LaneTraits<T>::kCount);
  }
  return point;
}

/// X, the symmetric part of a net's output.
template <class T>
HWY_INLINE Sym3<T> leave_net(const NetPanel<T>& panel, int g) {
  Mat3<T> y;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      y[i][j] = LaneTraits<T>::load(panel.y + (3 * i + j) * kPanel<T> + g * LaneTraits<T>::kCount);
    }
  return symmetric_part(y);
}

/// Puts the cotangent of X in place of the net's output.
template <class T>
HWY_INLINE void return_to_net(const Sym3<T>& x_bar, NetPanel<T>& panel, int g) {
  const Mat3<T> y_bar = to_matrix(x_bar);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      LaneTraits<T>::store(y_bar[i][j],
                           panel.y + (3 * i + j) * kPanel<T> + g * LaneTraits<T>::kCount);
    }
}

/// The cotangent of the unclamped F from those of the features, of R and of the clamped F.
template <class T, class S = typename LaneTraits<T>::Scalar>
HWY_INLINE Mat3<T> leave_net_backwards(const NetPoint<T>& point, const S* x_bar, int g,
                                       const Mat3<T>& r_bar, Mat3<T> f_bar) {
  T features_bar[kNetFeatures];
  for (std::size_t i = 0; i < kNetFeatures; ++i) {
    features_bar[i] = LaneTraits<T>::load(x_bar + i * kPanel<T> + g * LaneTraits<T>::kCount);
  }
  const Mat3<T> f = plus_identity(point.h);
  Mat3<T> c_bar;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      c_bar[i][j] = features_bar[3 + 3 * i + j] + features_bar[3 + 3 * j + i];
    }
  add(multiply(f, c_bar), f_bar);
  add_scaled(cofactor(f), features_bar[12], f_bar);
  Mat3<T> out{};
  add_signed_svd_adjoint(point.svd, features_bar, r_bar, f_bar, out);
  return out;
}

/// `h_trial` → `h` = F − I after the flow, and τ [Pa]; kPanelRegisters<T> of each.
template <bool kExact, class T, class S = typename LaneTraits<T>::Scalar>
void published_forward_panel(const PublishedView<S>& law, const Mat3<T>* h_trial, Mat3<T>* h,
                             Mat3<T>* tau, NetPanel<T>& panel) {
  constexpr int kRegs = kPanelRegisters<T>;
  NetPoint<T> points[kRegs];
  for (int g = 0; g < kRegs; ++g) points[g] = enter_net(h_trial[g], panel, g);
  net_forward<kExact, false>(law.plastic, panel);
  for (int g = 0; g < kRegs; ++g) {
    h[g] = points[g].h;
    add_scaled(multiply(points[g].r, leave_net(panel, g)), T(law.flow), h[g]);
    points[g] = enter_net(h[g], panel, g);
  }
  net_forward<kExact, false>(law.elastic, panel);
  for (int g = 0; g < kRegs; ++g) {
    tau[g] =
        multiply_transpose(multiply(points[g].r, leave_net(panel, g)), plus_identity(points[g].h));
  }
}

/// The cotangent of `h_trial` from those of what published_forward_panel gives, and τ again if not
/// null; the panels are left for add_weight_cotangents.
template <bool kExact, class T, class S = typename LaneTraits<T>::Scalar>
void published_backward_panel(const PublishedView<S>& law, const Mat3<T>* h_trial,
                              const Mat3<T>* h_bar, const Mat3<T>* tau_bar, Mat3<T>* trial_bar,
                              NetPanel<T>& elastic, NetPanel<T>& plastic, Mat3<T>* tau = nullptr) {
  constexpr int kRegs = kPanelRegisters<T>;
  const T alpha = T(law.flow);
  NetPoint<T> trial[kRegs];
  NetPoint<T> flowed[kRegs];
  Sym3<T> step[kRegs];
  for (int g = 0; g < kRegs; ++g) trial[g] = enter_net(h_trial[g], plastic, g);
  net_forward<kExact, true>(law.plastic, plastic);
  for (int g = 0; g < kRegs; ++g) {
    step[g] = leave_net(plastic, g);
    Mat3<T> h = trial[g].h;
    add_scaled(multiply(trial[g].r, step[g]), alpha, h);
    flowed[g] = enter_net(h, elastic, g);
  }
  net_forward<kExact, true>(law.elastic, elastic);
  Mat3<T> r_bar[kRegs];
  Mat3<T> f_bar[kRegs];
  for (int g = 0; g < kRegs; ++g) {
    // τ = R X Fᵀ
    const Sym3<T> x = leave_net(elastic, g);
    const Mat3<T> f = plus_identity(flowed[g].h);
    const Mat3<T> tf = multiply(tau_bar[g], f);
    const Mat3<T> rx = multiply(flowed[g].r, x);
    r_bar[g] = multiply(tf, x);
    f_bar[g] = transpose_multiply(tau_bar[g], rx);
    if (tau != nullptr) tau[g] = multiply_transpose(rx, f);
    return_to_net(symmetric_part(transpose_multiply(flowed[g].r, tf)), elastic, g);
  }
  alignas(64) S x_bar[kNetFeatures * kPanel<T>];
  net_backward(law.elastic, elastic, x_bar);
  for (int g = 0; g < kRegs; ++g) {
    Mat3<T> after = leave_net_backwards<T>(flowed[g], x_bar, g, r_bar[g], f_bar[g]);
    add(h_bar[g], after);
    // F = F_trial + α R X
    Mat3<T> turned{};
    add_scaled(multiply(after, step[g]), alpha, turned);
    return_to_net(scaled(symmetric_part(transpose_multiply(trial[g].r, after)), alpha), plastic, g);
    r_bar[g] = turned;
    f_bar[g] = after;
  }
  net_backward(law.plastic, plastic, x_bar);
  for (int g = 0; g < kRegs; ++g) {
    trial_bar[g] = leave_net_backwards<T>(trial[g], x_bar, g, r_bar[g], f_bar[g]);
  }
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
