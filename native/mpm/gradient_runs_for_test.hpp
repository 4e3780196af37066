// SPDX-License-Identifier: GPL-3.0-or-later
// Runs whose gradients are checked: a bar with everything that has one, as numbers to be moved.
#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "mpm/gradient.hpp"
#include "mpm/initial_velocity.hpp"

namespace matterfit::mpm {

struct GradientCase {
  enum class Hold { kNone, kPlane, kPatch, kAll };

  Formulation formulation = Formulation::kTotal;
  material::Material material;
  double density = 900.0;
  Vec3d offset = Vec3d::Zero();
  Vec3d turn = Vec3d::Zero();  ///< of each body about its centre
  Vec3d velocity = Vec3d(0.8, 0.3, -1.5);
  Vec3d spin = Vec3d(2.0, -3.0, 4.0);
  double stir = 1.0;  ///< of the particles' own velocities
  Vec3d gravity = Vec3d(1.0, -2.0, -9.0);
  bool ground = false;
  double mu = 0.3;
  double stiffness = 5e6;
  double contact_damping = 0.1;
  Vec3d translation = Vec3d::Zero();
  Vec3d rotation = Vec3d::Zero();
  Hold hold = Hold::kNone;
  double release = std::numeric_limits<double>::infinity();
  bool masses = false;
  bool observes_f = false;
  bool neighbour = false;  ///< a body of water beside it, updated or renewed as it is
  shape::ContactMethod method = shape::ContactMethod::kParticle;
  int length = 6;  ///< particles
  int frames = 6;
  int substeps = 0;  ///< of each frame; 0: the solver chooses
  double fps = 100.0;

  static constexpr double kH = 0.025;

  GradientCase() {
    material.law = material::Law::kNeoHookean;
    material.youngs_modulus = 2e5;
    material.poisson_ratio = 0.35;
  }

  /// The bar, 4 × 4 × length particles, on a lattice that is turned against the world unless it
  /// falls to the ground.
  [[nodiscard]] Scene scene() const {
    Scene scene;
    scene.fps = fps;
    scene.first_frame = 3;
    scene.end_frame = 3 + frames;
    scene.dx = 2.0 * kH;
    if (substeps > 0) scene.substeps.assign(static_cast<std::size_t>(frames), substeps);
    scene.gravity = shape::Keyed<Vec3d>(gravity);
    Body body;
    body.name = "bar";
    body.density = density;
    body.formulation = formulation;
    body.material = material;
    body.lattice.regular = true;
    body.lattice.spacing = kH;
    if (!ground) {
      body.lattice.axes = Quatd(Eigen::AngleAxisd(0.4, Vec3d(1, 2, -1).normalized()));
    }
    body.lattice.origin = offset + Vec3d(0.0, 0.0, ground ? 0.9 * kH : 0.2);
    body.velocity = velocity;
    body.spin = spin;
    const Mat3d axes = body.lattice.axes.toRotationMatrix();
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j)
        for (int k = 0; k < length; ++k) {
          const Vec3d x = kH * Vec3d(i + 0.5, j + 0.5, k + 0.5);
          const auto p = static_cast<double>(body.rest.size());
          body.rest.push_back(axes * x + body.lattice.origin);
          body.volumes.push_back(kH * kH * kH);
          body.particle_velocities.push_back(
              stir * (Vec3d(std::sin(p), std::cos(1.7 * p), std::sin(2.0 + 0.6 * p)) +
                      8.0 * Vec3d(x.z() - 0.05, 0.5 * x.x(), -x.y())));
        }
    const Vec3d corner = body.lattice.origin;
    Pin pin;
    pin.release = release;
    pin.pivot = corner;
    if (hold == Hold::kPlane) {
      pin.region = Pin::Region::kPlane;
      pin.point = corner;
      pin.normal = axes.col(2);
    } else if (hold == Hold::kPatch) {
      pin.region = Pin::Region::kSphere;
      pin.point = corner + axes * Vec3d(0.05, 0.05, 0.0);
      pin.radius = 0.045;
      pin.motion.times = {0.0, 0.03};
      pin.motion.values = {
          shape::Pose{}, shape::Pose{Vec3d(0.002, 0.001, -0.003),
                                     Quatd(Eigen::AngleAxisd(0.05, Vec3d(1, 0, 1).normalized()))}};
    }
    if (hold != Hold::kNone) body.pins.push_back(pin);
    if (masses) {
      body.masses.push_back({corner + axes * Vec3d(0.07, 0.04, 0.11), 0.1, 0.0});
      body.masses.push_back({corner + axes * Vec3d(0.02, 0.05, 0.09), 0.05, 0.025});
    }
    scene.bodies.push_back(std::move(body));
    if (neighbour) scene.bodies.push_back(water_beside(scene.bodies[0]));
    for (Body& placed : scene.bodies) turn_body(placed, turn);
    if (ground) {
      shape::Contact contact;
      contact.mu = mu;
      contact.stiffness = stiffness;
      contact.damping = contact_damping;
      contact.method = method;
      const double angle = rotation.norm();
      const Quatd turn =
          angle > 0.0 ? Quatd(Eigen::AngleAxisd(angle, rotation / angle)) : Quatd::Identity();
      scene.colliders.push_back(shape::make_plane("ground", contact,
                                                  turn * Vec3d(0, 0, 0.02) + translation,
                                                  turn * Vec3d(0.1, 0.05, 1.0).normalized()));
    }
    return scene;
  }

  /// Turns where it is, and what holds it; not how it is thrown.
  static void turn_body(Body& body, const Vec3d& turn) {
    if (turn.isZero(0.0)) return;
    const Quatd by(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
    const Vec3d center = center_of_volume(body);
    const auto turned = [&](Vec3d& x) { x = center + by * (x - center); };
    for (Vec3d& x : body.rest) turned(x);
    turned(body.lattice.origin);
    body.lattice.axes = by * body.lattice.axes;
    for (Pin& pin : body.pins) {
      turned(pin.point);
      turned(pin.pivot);
      pin.normal = by * pin.normal;
      for (shape::Pose& pose : pin.motion.values) {
        pose = {by * pose.position, by * pose.rotation * by.conjugate()};
      }
    }
    for (AttachedMass& mass : body.masses) turned(mass.position);
  }

  /// As much water, touching its side.
  [[nodiscard]] static Body water_beside(const Body& bar) {
    Body body = bar;
    body.name = "water";
    body.density = 1000.0;
    if (bar.formulation != Formulation::kRenewed) body.formulation = Formulation::kUpdated;
    body.material = material::Material{};
    body.material.law = material::Law::kNewtonian;
    body.material.bulk_modulus = 2e5;
    body.material.viscosity = 3.0;
    body.pins.clear();
    const Vec3d aside = bar.lattice.axes * Vec3d(4.0 * kH, 0.0, 0.0);
    for (Vec3d& x : body.rest) x += aside;
    body.lattice.origin += aside;
    return body;
  }

  /// Depends on every particle's position, velocity and, if seen, F in every frame, and not
  /// linearly.
  static void observe(const ObservedFrame& frame, FrameLoss& loss) {
    const ObservedFrame::Body& body = frame.bodies[0];
    for (std::size_t p = 0; p < body.positions.size(); ++p) {
      const double a = static_cast<double>(p) + 0.3 * frame.frame;
      const Vec3d aim(std::sin(a), std::cos(2.0 * a), std::sin(1.0 + 0.7 * a));
      const Vec3d away = body.positions[p] - 0.2 * aim;
      const Vec3d speed = body.velocities[p] - aim;
      loss.loss += 10.0 * away.squaredNorm() + 0.01 * speed.squaredNorm();
      loss.bodies[0].positions.emplace_back(20.0 * away);
      loss.bodies[0].velocities.emplace_back(0.02 * speed);
      if (body.deformation_gradients.empty()) continue;
      const Mat3d bent = body.deformation_gradients[p] - aim * aim.transpose();
      loss.loss += 0.5 * bent.squaredNorm();
      loss.bodies[0].deformation_gradients.emplace_back(bent);
    }
  }

  template <class S>
  [[nodiscard]] Gradient gradient(GradientOptions options = {}, int threads = 1) const {
    options.deformation_gradients = observes_f;
    return mpm::gradient<S>(scene(), std::make_shared<Arena>(threads), observe, options,
                            Interrupter());
  }
  [[nodiscard]] double loss(const Schedule& schedule) const {
    GradientOptions options;
    options.schedule = schedule;
    options.deformation_gradients = observes_f;
    return roll_out<double>(scene(), std::make_shared<Arena>(1), observe, options, Interrupter())
        .loss;
  }
};

}  // namespace matterfit::mpm
