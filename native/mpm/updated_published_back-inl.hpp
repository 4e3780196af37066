// SPDX-License-Identifier: GPL-3.0-or-later
// Registers of a block on their way back that wait until there is a panel of them for the published
// law's nets. Included once per SIMD target.
#if defined(MATTERFIT_MPM_UPDATED_PUBLISHED_BACK_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MPM_UPDATED_PUBLISHED_BACK_INL_HPP
#undef MATTERFIT_MPM_UPDATED_PUBLISHED_BACK_INL_HPP
#else
#define MATTERFIT_MPM_UPDATED_PUBLISHED_BACK_INL_HPP
#endif

#include "material/classical/law_step_adjoint-inl.hpp"
#include "material/neural/published-inl.hpp"
#include "mpm/updated_record.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// In place of PublishedBack in the kernels of the other laws.
struct NotPublished {};

/// A register goes twice through its block's kernel: once to put down what the nets need, once to
/// take up what came of it, in the same order. An aggregate but for its access: begin() sets it.
template <class T, class S>
class PublishedBack {
  static constexpr int kRegs = kPanelRegisters<T>;

 public:
  struct Register {
    std::size_t slab;
    const mpm::KeptChunk<S>* chunk;
    std::size_t lane;
  };

  bool through;  ///< the nets have been gone through

  void begin(const S* weights, S dt) {
    law_ = {{weights}, {weights + kNetWeights}, static_cast<S>(material::published_flow(dt))};
    clear();
  }
  [[nodiscard]] bool full() const { return count_ == kRegs; }
  [[nodiscard]] const Register* begin() const { return registers_; }
  [[nodiscard]] const Register* end() const { return registers_ + count_; }

  /// `after_bar`: cotangent of F after the flow; −`a_bar` times the factor: that of the whole τ.
  HWY_INLINE void put(const Register& place, const Mat3<T>& trial, const Mat3<T>& after_bar,
                      const Mat3<T>& a_bar, T stress_factor) {
    registers_[count_] = place;
    trial_[count_] = trial;
    after_bar_[count_] = after_bar;
    tau_bar_[count_] = {};
    add_scaled(a_bar, -stress_factor, tau_bar_[count_]);
    ++count_;
  }

  /// `weights_bar` is added to, if not null.
  void run(S* weights_bar) {
    through = true;
    next_ = 0;
    if (count_ == 0) return;
    for (int g = count_; g < kRegs; ++g) trial_[g] = after_bar_[g] = tau_bar_[g] = Mat3<T>{};
    published_backward_panel<false>(law_, trial_, after_bar_, tau_bar_, trial_bar_, elastic_,
                                    plastic_, tau_);
    if (weights_bar == nullptr) return;
    add_weight_cotangents<T>(&elastic_, 1, weights_bar);
    add_weight_cotangents<T>(&plastic_, 1, weights_bar + kNetWeights);
  }
  void clear() {
    count_ = 0;
    through = false;
  }

  /// law_step_adjoint() of the next register: `stress` again, and the cotangent of the trial
  /// deformation.
  template <class Point>
  HWY_INLINE void law_adjoint(const Constants<T>& c, Point& point, const LawTrial<T>& trial,
                              Mat3<T>& stress, PointBar<T>& bar, ConstantsBar<T>& c_bar) {
    const int g = next_++;
    const Sym3<T> beside_bar = symmetric_part(tau_bar_[g]);
    point.relax_adjoint(beside_bar, bar);
    if (point.damped()) {
      viscous_stress_adjoint(c, point.velocity_gradient(), trial.whole, beside_bar,
                             point.velocity_gradient_bar(), bar, c_bar);
    }
    bar.h = trial_bar_[g];
    add_scaled(cofactor(plus_identity(trial.h)), bar.jm1, bar.h);
    Sym3<T> beside{};
    add_stress_beside<T>(c, trial, point, beside);
    stress = to_matrix(beside);
    add(tau_[g], stress);
  }

 private:
  PublishedView<S> law_;
  int count_;
  int next_;
  Register registers_[kRegs];
  Mat3<T> trial_[kRegs];
  Mat3<T> after_bar_[kRegs];
  Mat3<T> tau_bar_[kRegs];
  Mat3<T> trial_bar_[kRegs];
  Mat3<T> tau_[kRegs];
  NetPanel<T> elastic_;
  NetPanel<T> plastic_;
};

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
