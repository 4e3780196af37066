// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mpm/body_terms.hpp"
#include "mpm/total_block_field.hpp"
#include "mpm/total_load.hpp"

namespace matterfit::mpm {

/// The terms on a total Lagrangian body: their forces at its quadrature points, on the nodes by the
/// weights that the masses have too, so that a force per mass accelerates every node alike.
template <class S>
class TotalTerms final : public TotalLoad<S> {
 public:
  TotalTerms(const Scene& scene, const Body& body, const TotalBody<S>& total);

  [[nodiscard]] const BodyTerms& terms() const { return terms_; }
  /// Sets the body's node forces to those of the terms, if any acts and nothing holds all of it.
  void apply(Arena& arena, TotalBody<S>& body, const TotalSubstep& substep) override;

  /// A quadrature point of one of the body's blocks.
  struct Point {
    typename TotalBody<S>::Place place;
    std::uint32_t particle;
    double volume;  ///< at rest [m³]
  };
  [[nodiscard]] const std::vector<Point>& points(std::size_t block) const { return points_[block]; }
  /// What the terms see of it in a block whose fields are `displacement` and `velocity`.
  [[nodiscard]] effects::MaterialPoint seen(const TotalBody<S>& body, const Point& point,
                                            const BlockField::Stencil& stencil,
                                            const BlockField& displacement,
                                            const BlockField& velocity) const;

 private:
  BodyTerms terms_;
  std::vector<std::vector<Point>> points_;  ///< by block; empty without terms
  std::vector<BlockField> forces_;          ///< body axes [N]
};

extern template class TotalTerms<float>;
extern template class TotalTerms<double>;

}  // namespace matterfit::mpm
