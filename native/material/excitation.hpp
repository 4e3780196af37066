// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace matterfit::material {

/// The strains and rates that a material was seen at, as far as a recording shows them: what laws
/// are compared over, and beyond which a fitted one is extrapolated.
struct Excitation {
  double strain = 0.3;       ///< largest |dev ε|, Hencky
  double compression = 0.1;  ///< largest loss of ln J, without sign
  double expansion = 0.1;    ///< largest gain of ln J
  double slowest = 1.0;      ///< rates |dev D| [1/s]
  double fastest = 30.0;
};

}  // namespace matterfit::material
