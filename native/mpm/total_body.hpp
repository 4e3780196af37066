// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/LU>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "material/classical/law_constants.hpp"
#include "mpm/kernels.hpp"
#include "mpm/scene.hpp"
#include "mpm/simulation.hpp"
#include "mpm/state_bytes.hpp"
#include "mpm/total_grid.hpp"
#include "mpm/total_skin.hpp"
#include "mpm/total_stencil.hpp"

namespace matterfit::mpm {

class BlockField;
class TotalNodeTerms;
template <class S>
class TotalAdjoint;

/// State of a body between two substeps.
template <class S>
struct TotalState {
  std::vector<double> displacement;  ///< node blocks × [3][64] [m]
  std::vector<double> velocity;      ///< [m/s]
  std::vector<S> plastic;            ///< as TotalView::plastic
  std::vector<S> maxwell;            ///< as TotalView::maxwell
};

/// One substep of a body, as it was taken.
struct TotalSubstep {
  double time = 0.0;  ///< of the state before [s]
  double dt = 0.0;
  double kick = 0.0;
  double smoothing = 0.0;         ///< share of smooth_velocities() after it; 0: none
  Vec3d gravity = Vec3d::Zero();  ///< world axes
  bool held = false;              ///< every node was prescribed: no forces, no history
};

/// A body in the total Lagrangian formulation: the grid belongs to the rest shape, node
/// displacements and velocities (double) are the state, particles are quadrature points:
///   f_I = −Σ V P ∇₀w_I,  v_I += kick (f_I/m_I + g),  u_I += dt v_I,  F_p = I + Σ u_I ⊗ ∇₀w_I.
/// Elastic laws and isochoric plastic flow take the volume term of each cell's mean J̄, variational,
/// so that nearly incompressible solids do not lock. Nothing is transferred back and forth, so the
/// integrator itself damps nothing (leapfrog).
/// Limits: no contact with itself; strains that turn a cell inside out end the run.
/// S is the scalar of the particles' kernels; nodes are always double.
template <class S>
class TotalBody {
 public:
  TotalBody(const Body& body, const Scene& scene, const Kernels<S>& kernels,
            const Interrupter* interrupter = nullptr);
  ~TotalBody();
  TotalBody(const TotalBody&) = delete;
  TotalBody& operator=(const TotalBody&) = delete;

  /// Internal forces at the present displacement, into the blocks' halos.
  void compute_forces(Arena& arena, double dt, bool commit);
  /// Velocities by `kick` [s], displacements by `dt` [s]; gravity in world axes; `time` is that of
  /// the present displacements, in seconds after the scene's first frame.
  void step_nodes(Arena& arena, double kick, double dt, const Vec3d& gravity, double time);
  /// Damps what the grid cannot resolve: velocities move by `share` towards what an APIC transfer
  /// to the particles and back leaves of them. Affine motion is untouched, a smooth wave loses
  /// share · O((k dx)⁴), a node-to-node one most of it. An impact would ring for ever without.
  void smooth_velocities(Arena& arena, double share);
  /// Turns accelerations f/m [m/s²] with lumped masses into nearly those of the mass matrix:
  /// a ← a + M⁻¹ (M − B) a with M the lumped masses and B the consistent matrix, which is the first
  /// term of the series of B⁻¹ (Nairn and Hammerquist, FMPM of order 2, CMAME 2021). Waves then lag
  /// by O((k dx)⁴) in place of (k dx)²/8. Nodes that pins and masses hold neither get nor give.
  void correct_lumping(Arena& arena, std::vector<double>& acceleration);
  /// True while every node is prescribed: forces are not needed.
  [[nodiscard]] bool held(double time) const;
  /// True if a pin lets go in (from, to]: the step that follows starts with a half kick.
  [[nodiscard]] bool releases_between(double from, double to) const;

  /// Largest stable time step [s] of the unforced body at its present shape: 2/ω with ω the highest
  /// frequency, by power iteration on the linearised forces.
  [[nodiscard]] double stable_time_step(Arena& arena, int iterations,
                                        const Interrupter& interrupter);

  /// Where a point of the body lies at rest.
  struct Place {
    Vec3d rest;  ///< body axes [m]
    CellPoint cell;
  };
  [[nodiscard]] Place place(std::uint32_t particle) const;
  /// The point that is `offset` [m, world axes] from a particle at rest.
  [[nodiscard]] Place place(std::uint32_t particle, const Vec3d& offset) const;
  /// The point of its skin that a particle meets a surface with, `direction` the way there at rest
  /// (world axes, unit).
  [[nodiscard]] Place face(std::uint32_t particle, const Vec3d& direction) const {
    return place(particle, grid_.reach(particle, direction).distance * direction);
  }
  /// A point of the body, its nodes looked up once. (Of many in one block: TotalBlock.)
  struct Point : Place {
    FieldStencil field;
  };
  [[nodiscard]] Point point(const Place& place) const { return {place, {grid_, place.cell}}; }
  [[nodiscard]] Point point(std::uint32_t particle) const { return point(place(particle)); }
  [[nodiscard]] Point point(std::uint32_t particle, const Vec3d& offset) const {
    return point(place(particle, offset));
  }
  /// Present position and velocity, world axes.
  struct PointState {
    Vec3d position;
    Vec3d velocity;
  };
  [[nodiscard]] PointState state(const Point& point) const {
    return state(point, field_at(point.field, displacement_.data()),
                 field_at(point.field, velocity_.data()));
  }
  [[nodiscard]] Mat3d deformation_gradient(const Point& point) const {
    return deformation_gradient(field_gradient(point.field, displacement_.data()));
  }
  /// ∇v [1/s], world axes.
  [[nodiscard]] Mat3d velocity_gradient(const Point& point) const {
    const Mat3d rate =
        grid_.axes() * field_gradient(point.field, velocity_.data()) * grid_.axes().transpose();
    return rate * deformation_gradient(point).inverse();
  }
  /// From displacement and velocity there, and from Σ u ⊗ ∇w, all in body axes.
  [[nodiscard]] PointState state(const Place& place, const Vec3d& displacement,
                                 const Vec3d& velocity) const {
    return {grid_.to_world(place.rest + displacement), grid_.axes() * velocity};
  }
  [[nodiscard]] Mat3d deformation_gradient(const Mat3d& gradient) const {
    return grid_.axes() * (Mat3d::Identity() + gradient) * grid_.axes().transpose();
  }

  /// Forces [N, world axes] at points of particles, set before compute_forces. Those of a block's
  /// particles are added by one thread only.
  void clear_loads();
  void add_load(std::uint32_t particle, const Place& place, const Vec3d& force);
  /// Forces [N, body axes] at the nodes of each block, borrowed, which compute_forces() adds where
  /// it commits, until clear_loads().
  void set_node_forces(const BlockField* per_block) { node_forces_ = per_block; }

  /// Adds a rigid motion about the centre of mass to the velocities (world axes).
  void nudge(const Vec3d& velocity, const Vec3d& spin);
  /// Between two frames. Maxwell branches keep their axes: for turns of hundredths of a radian.
  void change(const RigidChange& change);

  void sample(Arena& arena, BodyState& out) const;
  [[nodiscard]] BlockExtremes<S> extremes() const;
  /// The largest speed [m/s] of the nodes that carry a tenth of a full one's mass at least.
  [[nodiscard]] double max_speed() const;
  [[nodiscard]] double kinetic_energy() const;
  /// The elastic energy [J] of the shape half a substep before the displacements', where the
  /// velocities are: of the law and the skin's ties; branches left out.
  [[nodiscard]] double elastic_energy(Arena& arena, double dt) const;
  /// m x of the same time, world axes [kg m].
  [[nodiscard]] Vec3d mass_moment(double dt) const;

  void save(ByteWriter& out) const;
  void load(ByteReader& in);
  /// What save() keeps, for a record that is gone through backwards (total_adjoint.hpp).
  [[nodiscard]] TotalState<S> record() const;
  void restore(const TotalState<S>& state);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::size_t particles() const { return grid_.particles(); }
  [[nodiscard]] std::size_t blocks() const { return grid_.blocks(); }
  [[nodiscard]] const TotalGrid& grid() const { return grid_; }
  [[nodiscard]] const std::vector<double>& displacement() const { return displacement_; }
  [[nodiscard]] const std::vector<double>& velocity() const { return velocity_; }
  [[nodiscard]] double density() const { return density_; }
  /// Particles of block b, in storage order.
  [[nodiscard]] const std::vector<std::uint32_t>& block_particles(std::size_t b) const {
    return grid_.block_particles(b);
  }
  [[nodiscard]] bool is_surface(std::uint32_t particle) const { return grid_.is_surface(particle); }
  [[nodiscard]] double volume(std::uint32_t particle) const { return grid_.volume(particle); }

 private:
  friend class TotalAdjoint<S>;
  struct Load {
    CellPoint point;
    Vec3d force;  ///< body axes [N]
  };
  /// The consistent mass matrix times a field of free nodes, into force_.
  void multiply_by_mass(Arena& arena, const std::vector<double>& field);
  /// mass_share_: what a uniform acceleration gets from the points that correct_lumping() takes.
  void share_masses();
  void sort_loads();
  void apply_loads(std::size_t block);
  [[nodiscard]] TotalView<S> view(double dt, bool commit) const;
  void sum_forces(std::size_t node_block, double* out) const;
  /// The same with the pull of the skin's ties: the forces on a block's nodes.
  void sum_internal_forces(std::size_t node_block, double* out) const;

  std::string name_;
  double density_;
  material::LawConstants<S> law_;
  material::LawConstants<double> energy_law_;
  const Kernels<S>* kernels_;
  TotalGrid grid_;
  std::vector<double> displacement_;  ///< node blocks × [3][64]
  std::vector<double> velocity_;
  std::vector<S> geometry_;                     ///< chunks × [4][16]
  std::vector<S> full_volume_;                  ///< slabs × [16], TotalView::full_volume
  std::vector<S> piece_volume_;                 ///< chunks × [16]
  std::vector<std::uint8_t> has_pieces_;        ///< chunks
  std::vector<S> plastic_;                      ///< chunks × [10][16], or empty
  std::vector<S> maxwell_;                      ///< chunks × branches × [12][16], or empty
  std::vector<std::vector<Load>> loads_;        ///< by the block of the particle
  std::vector<std::vector<Load>> block_loads_;  ///< by the block of the load's cell
  const BlockField* node_forces_ = nullptr;     ///< per block, or null
  mutable std::vector<S> force_;                ///< blocks × [3][216]
  std::vector<double> acceleration_;            ///< as displacement_ [m/s²], without gravity
  std::vector<double> free_;                    ///< a field with zeros where nodes are not free
  std::vector<double> mass_share_;              ///< a node: Σ B of its row over free nodes, over m
  mutable std::vector<BlockExtremes<S>> extremes_;
  std::vector<double> mode_;                    ///< last vector of the power iteration
  std::unique_ptr<TotalNodeTerms> node_terms_;  ///< pins and attached masses
  std::unique_ptr<SkinTies> ties_;              ///< null: what flows for good must not spring back
};

extern template class TotalBody<float>;
extern template class TotalBody<double>;

}  // namespace matterfit::mpm
