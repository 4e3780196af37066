// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace matterfit::diagnose {

/// Random numbers by counter: number i of stream s of a seed is a function of (seed, s, i) alone,
/// so that results do not depend on the order in which they are asked for. The mixing function is
/// that of SplitMix64 (Steele, Lea and Flood 2014).
class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t stream) : key_(mix(mix(seed) ^ (stream * kOdd))) {}

  /// In (0, 1).
  [[nodiscard]] double uniform() {
    return (double(mix(key_ + kOdd * ++count_) >> 11) + 0.5) * 0x1p-53;
  }
  /// In [0, size).
  [[nodiscard]] std::uint64_t below(std::uint64_t size) {
    return std::uint64_t(uniform() * double(size));
  }
  /// Standard normal (Box and Muller 1958).
  [[nodiscard]] double normal() {
    const double radius = std::sqrt(-2.0 * std::log(uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }

 private:
  static constexpr std::uint64_t kOdd = 0x9e3779b97f4a7c15U;
  static std::uint64_t mix(std::uint64_t x) {
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9U;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebU;
    return x ^ (x >> 31);
  }
  std::uint64_t key_;
  std::uint64_t count_ = 0;
};

}  // namespace matterfit::diagnose
