// SPDX-License-Identifier: GPL-3.0-or-later
// The published law's network on panels of points (dense-inl.hpp). Activations are recomputed on
// the way back, never kept from the forward pass of a substep. Included once per SIMD target.
#if defined(MATTERFIT_MATERIAL_NEURAL_PUBLISHED_NET_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATERIAL_NEURAL_PUBLISHED_NET_INL_HPP
#undef MATTERFIT_MATERIAL_NEURAL_PUBLISHED_NET_INL_HPP
#else
#define MATTERFIT_MATERIAL_NEURAL_PUBLISHED_NET_INL_HPP
#endif

#include "material/neural/dense-inl.hpp"
#include "material/neural/gelu-inl.hpp"
#include "material/neural/published_weights.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

using material::kNetFeatures;
using material::kNetHidden;
using material::kNetOutputs;
using material::kNetWeights;

/// The matrices of one net in its weights.
template <class S>
struct NetView {
  const S* weights;
  [[nodiscard]] const S* first() const { return weights; }
  [[nodiscard]] const S* second() const { return weights + kNetHidden * kNetFeatures; }
  [[nodiscard]] const S* third() const { return second() + kNetHidden * kNetHidden; }
};

/// What one panel of points needs on its way through a net, features in rows.
template <class T>
struct NetPanel {
  using S = typename LaneTraits<T>::Scalar;
  alignas(64) S x[kNetFeatures * kPanel<T>];
  alignas(64) S h1[kNetHidden * kPanel<T>];
  alignas(64) S h2[kNetHidden * kPanel<T>];
  /// Slopes of the activations; on the way back the cotangents of what enters them.
  alignas(64) S z1[kNetHidden * kPanel<T>];
  alignas(64) S z2[kNetHidden * kPanel<T>];
  /// Output; on the way back its cotangent.
  alignas(64) S y[kNetOutputs * kPanel<T>];
};

template <bool kExact, bool kSlopes, class T, class S = typename LaneTraits<T>::Scalar>
HWY_INLINE void activate(S* HWY_RESTRICT h, S* HWY_RESTRICT slope) {
  constexpr std::size_t kCount = LaneTraits<T>::kCount;
  for (std::size_t i = 0; i < kNetHidden * kPanel<T>; i += kCount) {
    const Gelu<T> g = gelu<kExact>(LaneTraits<T>::load(h + i));
    LaneTraits<T>::store(g.value, h + i);
    if constexpr (kSlopes) LaneTraits<T>::store(g.slope, slope + i);
  }
}

/// y from x.
template <bool kExact, bool kSlopes, class T, class S = typename LaneTraits<T>::Scalar>
void net_forward(const NetView<S>& net, NetPanel<T>& p) {
  dense<T>({net.first(), kNetFeatures, 1}, kNetHidden, kNetFeatures, p.x, p.h1);
  activate<kExact, kSlopes, T>(p.h1, p.z1);
  dense<T>({net.second(), kNetHidden, 1}, kNetHidden, kNetHidden, p.h1, p.h2);
  activate<kExact, kSlopes, T>(p.h2, p.z2);
  dense<T>({net.third(), kNetHidden, 1}, kNetOutputs, kNetHidden, p.h2, p.y);
}

/// After net_forward with slopes and y replaced by its cotangent: x_bar from it, and z1, z2 become
/// cotangents, which add_weight_cotangents takes.
template <class T, class S = typename LaneTraits<T>::Scalar>
void net_backward(const NetView<S>& net, NetPanel<T>& p, S* x_bar) {
  constexpr std::size_t kCount = LaneTraits<T>::kCount;
  alignas(64) S h_bar[kNetHidden * kPanel<T>];
  const auto through = [&](S* z) {
    for (std::size_t i = 0; i < kNetHidden * kPanel<T>; i += kCount) {
      LaneTraits<T>::store(LaneTraits<T>::load(z + i) * LaneTraits<T>::load(h_bar + i), z + i);
    }
  };
  dense<T>({net.third(), 1, kNetHidden}, kNetHidden, kNetOutputs, p.y, h_bar);
  through(p.z2);
  dense<T>({net.second(), 1, kNetHidden}, kNetHidden, kNetHidden, p.z2, h_bar);
  through(p.z1);
  dense<T>({net.first(), 1, kNetFeatures}, kNetFeatures, kNetHidden, p.z1, x_bar);
}

/// Adds to `sum` (kNetWeights) the cotangents of the weights by `count` panels after net_backward.
template <class T, class S = typename LaneTraits<T>::Scalar>
void add_weight_cotangents(const NetPanel<T>* panels, std::size_t count, S* sum) {
  constexpr std::size_t kStride = sizeof(NetPanel<T>) / sizeof(S);
  outer<T>(panels->z1, kNetHidden, panels->x, kNetFeatures, count, kStride, sum);
  sum += kNetHidden * kNetFeatures;
  outer<T>(panels->z2, kNetHidden, panels->h1, kNetHidden, count, kStride, sum);
  sum += kNetHidden * kNetHidden;
  outer<T>(panels->y, kNetOutputs, panels->h2, kNetHidden, count, kStride, sum);
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
