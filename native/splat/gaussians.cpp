// SPDX-License-Identifier: GPL-3.0-or-later
#include "splat/gaussians.hpp"

#include <algorithm>

namespace matterfit::splat {
namespace {

template <class T>
void extend(std::vector<T>& into, const std::vector<T>& more) {
  into.insert(into.end(), more.begin(), more.end());
}

void give_gradients(Gaussians& gaussians) {
  if (gaussians.deformation_gradients.empty()) {
    gaussians.deformation_gradients.assign(gaussians.size(), Mat3f::Identity());
  }
}

}  // namespace

void raise_degree(Gaussians& gaussians, int degree) {
  if (degree <= gaussians.sh_degree) return;
  const std::size_t before = 3 * sh_bands(gaussians.sh_degree);
  const std::size_t after = 3 * sh_bands(degree);
  std::vector<float> sh(after * gaussians.size(), 0.0F);
  for (std::size_t i = 0; i < gaussians.size(); ++i) {
    std::copy_n(gaussians.sh.data() + before * i, before, sh.data() + after * i);
  }
  gaussians.sh = std::move(sh);
  gaussians.sh_degree = degree;
}

void append(Gaussians& into, const Gaussians& more) {
  if (into.size() == 0) {
    into = more;
    return;
  }
  if (more.size() == 0) return;
  Gaussians other = more;
  const int degree = std::max(into.sh_degree, other.sh_degree);
  raise_degree(into, degree);
  raise_degree(other, degree);
  if (!into.deformation_gradients.empty() || !other.deformation_gradients.empty()) {
    give_gradients(into);
    give_gradients(other);
  }
  extend(into.means, other.means);
  extend(into.log_scales, other.log_scales);
  extend(into.rotations, other.rotations);
  extend(into.opacities, other.opacities);
  extend(into.sh, other.sh);
  extend(into.deformation_gradients, other.deformation_gradients);
}

}  // namespace matterfit::splat
