// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/quantity.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

#include "base/error.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/pretrain_latent.hpp"
#include "mpm/scene_check.hpp"

namespace matterfit::fit {
namespace {

using material::LawTraits;
using mpm::Formulation;

constexpr double kSceneH = 0.025;  // particle separation [m]
const Origins kOrigins{{"cube", Vec3d(0.05, 0.02, 0.0)}};

/// Weights of the neural law whose units all speak.
std::shared_ptr<const material::IsotropicStart> loud_start() {
  material::IsotropicWeights w = material::plain_isotropic(7e4, 2e5);
  for (std::size_t k = 0; k < material::kShapeUnits; ++k) w[2 + k] = -1.0;
  for (std::size_t k = 0; k < material::kVolumeUnits; ++k) w[18 + k] = -1.5;
  return material::with_directions("loud", w, 1);
}

/// A decoder of the latent law, hardly trained.
std::shared_ptr<const material::LatentDecoder> rough_decoder() {
  material::LatentPretraining options;
  options.materials = 70;
  options.steps = 200;
  Arena arena(1);
  return pretrain_latent(options, arena);
}

/// A cube just above a level ground, thrown at it, of a material with a value for every quantity.
mpm::Scene scene_of(material::Law law, Formulation formulation) {
  mpm::Scene scene;
  scene.fps = 100.0;
  scene.end_frame = 4;
  scene.dx = 2.0 * kSceneH;
  scene.gravity = shape::Keyed<Vec3d>(Vec3d(1.0, -2.0, -9.0));
  mpm::Body body;
  body.name = "cube";
  body.density = 900.0;
  body.formulation = formulation;
  body.velocity = Vec3d(0.8, 0.3, -1.5);
  body.spin = Vec3d(2.0, -3.0, 4.0);
  body.material.law = law;
  body.material.youngs_modulus = 2e5;
  body.material.poisson_ratio = 0.35;
  body.material.yield_stress = 800.0;
  body.material.hardening = 1e4;
  body.material.viscosity = 30.0;
  body.material.exponent = 0.8;
  body.material.cohesion = 2e3;
  body.material.bulk_modulus = 2e5;
  if (law == material::Law::kNeuralIsotropic) {
    static const auto kStart = loud_start();
    body.material.start = kStart;
    body.material.yield_strain = 2e-3;
    body.material.internal_friction = 0.1;
    body.material.strain_hardening = 0.05;
    body.material.tear_strain = 2e-3;
    body.material.flow_rate = 500.0;
    body.material.flow_thinning = 2e3;
    body.material.weight_moves.assign(material::kIsotropicElastic, 0.02);
  }
  if (law == material::Law::kLatent) {
    static const auto kDecoder = rough_decoder();
    const Eigen::VectorXd paste = kDecoder->classes.row(2);
    set_latent(body.material, kDecoder, std::span<const double>(paste.data(), 8));
  }
  body.material.damping_shear = 5.0;
  body.material.damping_bulk = 2.0;
  body.material.maxwell = {{2e4, 5e-3}};
  body.material.correction = {0.4, -0.1, 0.3, 0.2, 0.5};
  body.lattice.spacing = kSceneH;
  body.lattice.regular = true;
  body.lattice.origin = Vec3d(0.0, 0.0, 0.9 * kSceneH);
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      for (int k = 0; k < 4; ++k) {
        body.rest.push_back(body.lattice.origin + kSceneH * Vec3d(i + 0.5, j + 0.5, k + 0.5));
        body.volumes.push_back(kSceneH * kSceneH * kSceneH);
      }
    }
  }
  scene.bodies.push_back(std::move(body));
  shape::Contact contact;
  contact.mu = 0.3;
  contact.stiffness = 5e6;
  scene.colliders.push_back(
      shape::make_plane("ground", contact, Vec3d(0, 0, 0.02), Vec3d::UnitZ()));
  return scene;
}

/// Whether the row is of the neural law alone, the first of whose weights does nothing.
bool is_weight(const Quantity& row) { return row.path == "material.weight_moves[#]"; }

/// Whether the row is of the latent law alone.
bool is_code(const Quantity& row) { return row.path == "material.latent[#]"; }

/// The last component of vectors.
Address address_of(const Quantity& row) {
  Address address;
  if (is_weight(row) || is_code(row)) address.index = 3;
  address.quantity = &row;
  if (row.owner == Owner::kBody) address.owner = "cube";
  if (row.owner == Owner::kCollider) address.owner = "ground";
  if (row.is_vector()) address.component = 2;
  return address;
}

/// The first law that takes it; nothing if none does in that formulation.
std::optional<material::Law> law_with(const Quantity& row, Formulation formulation) {
  for (const LawTraits& law : material::all_laws()) {
    if (law.fluid && formulation == Formulation::kTotal) continue;
    if (is_weight(row) && law.law != material::Law::kNeuralIsotropic) continue;
    if (is_code(row) != (law.law == material::Law::kLatent)) continue;
    if (!row.of_law || law.uses(row.key())) return law.law;
  }
  return std::nullopt;
}

double value_of(const mpm::Scene& scene, const Address& at) {
  return read(scene, at)[static_cast<std::size_t>(at.component.value_or(0))];
}

/// Depends on every particle's position and velocity in every frame, and not linearly.
void observe(const mpm::ObservedFrame& frame, mpm::FrameLoss& loss) {
  const mpm::ObservedFrame::Body& body = frame.bodies[0];
  for (std::size_t p = 0; p < body.positions.size(); ++p) {
    const double a = static_cast<double>(p) + 0.3 * frame.frame;
    const Vec3d aim(std::sin(a), std::cos(2.0 * a), std::sin(1.0 + 0.7 * a));
    const Vec3d away = body.positions[p] - 0.2 * aim;
    const Vec3d speed = body.velocities[p] - aim;
    loss.loss += 10.0 * away.squaredNorm() + 0.01 * speed.squaredNorm();
    loss.bodies[0].positions.emplace_back(20.0 * away);
    loss.bodies[0].velocities.emplace_back(0.02 * speed);
  }
}

/// The derivative by a number against differences of fourth order of whole runs in double, to 1e-6
/// of what a change by a tenth of the number, or by .1, makes.
void expect_slope(const Quantity& row, Formulation formulation) {
  const auto law = law_with(row, formulation);
  if (!law) return;
  const mpm::Scene scene = scene_of(*law, formulation);
  const Address at = address_of(row);
  if (!has_slope(at, scene)) return;
  const mpm::Gradient gradient =
      mpm::gradient<double>(scene, std::make_shared<Arena>(1), observe, {}, Interrupter());
  const double start = value_of(scene, at);
  const double unit = std::max(0.1 * std::abs(start),
                               row.coordinate == Coordinate::kLinear ? 0.1 * row.scale : 0.0);
  const auto loss = [&](double by) {
    mpm::Scene moved = scene;
    write(start + by * unit, at, moved);
    mpm::GradientOptions options;
    options.schedule = gradient.schedule;
    return mpm::roll_out<double>(moved, std::make_shared<Arena>(1), observe, options, Interrupter())
        .loss;
  };
  const double found = unit * slope(gradient, scene, at);
  double error = 1.0;
  double expected = 0.0;
  // A particle that begins to touch or yield between the two sides spoils the difference.
  for (double step = 1e-2; step > 1e-6 && error > 1e-6; step *= 0.1) {
    expected =
        (8.0 * (loss(step) - loss(-step)) - (loss(2.0 * step) - loss(-2.0 * step))) / (12.0 * step);
    error = std::abs(expected - found) / std::max(std::abs(expected), 0.1);
  }
  const std::string name = at.text() + (formulation == Formulation::kTotal     ? ", total"
                                        : formulation == Formulation::kRenewed ? ", renewed"
                                                                               : "");
  EXPECT_LE(error, 1e-6) << name << ": difference " << expected << ", gradient " << found;
  EXPECT_GT(std::abs(expected), 1e-7) << name << " does nothing";
}

TEST(Quantities, AreWrittenToAScene) {
  for (const Quantity& row : quantities()) {
    const Address at = address_of(row);
    if (row.owner == Owner::kCapture) {
      Viewing viewing;
      row.access.set_view(3.25, at, viewing);
      EXPECT_EQ(row.access.look(viewing, at), 3.25) << row.path;
      Address other = at;
      ++other.index;
      if (row.path.find("[#]") != std::string::npos) {
        EXPECT_EQ(row.access.look(viewing, other), 0.0) << row.path;
      }
      continue;
    }
    mpm::Scene scene = scene_of(is_code(row) ? material::Law::kLatent : material::Law::kVonMises,
                                Formulation::kAuto);
    const Components before = read(scene, at, kOrigins);
    const Vec3d first = scene.bodies[0].rest[0];
    const double value = 1.25 * value_of(scene, at) + 0.125;
    write(value, at, scene, kOrigins);
    if (row.places()) {
      EXPECT_GT((scene.bodies[0].rest[0] - first).norm(), 1e-4) << row.path;
      EXPECT_GT((scene.bodies[0].rest[7] - scene.bodies[0].lattice.origin).norm(), 1e-2);
    } else {
      EXPECT_EQ(value_of(scene, at), value) << row.path;
    }
    if (!row.is_vector() || row.places()) continue;
    EXPECT_EQ(read(scene, at)[0], before[0]) << row.path;
    EXPECT_EQ(read(scene, at)[1], before[1]) << row.path;
  }
}

TEST(Quantities, PlaceABodyWithItsLattice) {
  mpm::Scene scene = scene_of(material::Law::kNeoHookean, Formulation::kAuto);
  const Vec3d particle = scene.bodies[0].rest[11];
  const Vec3d origin = kOrigins.at("cube");
  Address at;
  at.owner = "cube";
  at.quantity = &row_named(Owner::kBody, "placement.rotation");
  write(Components{0.0, 0.0, 0.5}, at, scene, kOrigins);
  at.quantity = &row_named(Owner::kBody, "placement.position");
  write(Components{1.0, 2.0, 3.0}, at, scene, kOrigins);
  const Quatd turn(Eigen::AngleAxisd(0.5, Vec3d::UnitZ()));
  const mpm::Body& body = scene.bodies[0];
  EXPECT_LT((body.rest[11] - (turn * (particle - origin) + Vec3d(1, 2, 3))).norm(), 1e-14);
  const Vec3d lattice(0.0, 0.0, 0.9 * kSceneH);
  EXPECT_LT((body.lattice.origin - (turn * (lattice - origin) + Vec3d(1, 2, 3))).norm(), 1e-14);
  EXPECT_LT(body.lattice.axes.angularDistance(turn), 1e-14);
  at.component = 1;
  EXPECT_EQ(read(scene, at, kOrigins), (Components{0.05, 0.02, 0.0})) << "where it was built";
}

TEST(Quantities, HaveTheirSlopeOrNone) {
  std::set<std::string> without;
  const mpm::Scene total = scene_of(material::Law::kNeoHookean, Formulation::kTotal);
  const mpm::Scene updated = scene_of(material::Law::kNeoHookean, Formulation::kUpdated);
  for (const Quantity& row : quantities()) {
    const Address at = address_of(row);
    if (!has_slope(at, total)) without.insert(row.path);
    if (!has_slope(at, updated)) without.insert("updated: " + row.path);
    expect_slope(row, Formulation::kTotal);
    expect_slope(row, Formulation::kUpdated);
    expect_slope(row, Formulation::kRenewed);
  }
  EXPECT_THAT(without,
              testing::ElementsAre(
                  "placement.position", "placement.rotation", "poses[#].focal", "poses[#].shift",
                  "poses[#].turn", "start_frame", "updated: height", "updated: placement.position",
                  "updated: placement.rotation", "updated: poses[#].focal",
                  "updated: poses[#].shift", "updated: poses[#].turn", "updated: start_frame"));
}

TEST(Quantities, EachRowIsComplete) {
  std::set<std::string> texts;
  for (const Quantity& row : quantities()) {
    Address at = address_of(row);
    at.owner = "my.body";
    EXPECT_TRUE(texts.insert(at.text()).second) << at.text();
    EXPECT_EQ(&row_named(row.owner, row.path), &row);
    EXPECT_EQ(&quantities()[row.row()], &row);
    for (const std::string_view text : {row.label, row.sentence, row.words, row.record}) {
      EXPECT_FALSE(text.empty()) << row.path;
    }
    EXPECT_TRUE(row.size == 1 || row.size == 3) << row.path;
    EXPECT_GT(row.scale, 0.0) << row.path;
    EXPECT_GT(row.prior_sigma, 0.0) << row.path;
    EXPECT_TRUE((row.low == 0.0 && row.high == 0.0) || row.low < row.high) << row.path;
    const material::Material material;
    if (row.coordinate != Coordinate::kLinear) {
      EXPECT_GT(usual_start(row, material), 0.0) << row.path;
    }
    // A material has the default of what its law does not take.
    EXPECT_EQ(row.member != nullptr, row.is_material() && row.path.find("[#]") == std::string::npos)
        << row.path;
  }
  EXPECT_THROW((void)row_named(Owner::kBody, "material.e"), Error);
  EXPECT_TRUE(texts.count("bodies.\"my.body\".material.maxwell[0].time") > 0);
  EXPECT_TRUE(texts.count("gravity[2]") > 0);
}

TEST(Quantities, AreRefusedWhereTheyDoNothing) {
  mpm::Scene scene = scene_of(material::Law::kNeoHookean, Formulation::kAuto);
  const auto why = [&](Owner owner, const char* path, std::size_t index = 0) {
    Address at;
    at.quantity = &row_named(owner, path);
    at.owner = owner == Owner::kBody ? "cube" : "ground";
    at.index = index;
    return obstacle(at, *bearer(scene, at));
  };
  EXPECT_EQ(why(Owner::kBody, "material.E"), "");
  EXPECT_EQ(why(Owner::kBody, "material.maxwell[#].time"), "");
  EXPECT_EQ(why(Owner::kCollider, "height"), "");
  EXPECT_THAT(why(Owner::kBody, "material.weight_moves[#]"), testing::HasSubstr("no weights"));
  EXPECT_THAT(why(Owner::kBody, "material.yield_stress"), testing::HasSubstr("neo_hookean"));
  EXPECT_THAT(why(Owner::kBody, "material.maxwell[#].time", 1), testing::HasSubstr("has 1 "));
  shape::Contact glue;
  glue.kind = shape::ContactKind::kGlue;
  scene.colliders[0] =
      shape::make_sphere("ground", glue, 0.1, shape::Keyed<shape::Pose>(shape::Pose{}));
  EXPECT_THAT(why(Owner::kCollider, "height"), testing::HasSubstr("'ground'"));
  EXPECT_THAT(why(Owner::kCollider, "contact.mu"), testing::HasSubstr("'friction'"));
  Address gravity;
  gravity.quantity = &row_named(Owner::kScene, "gravity");
  EXPECT_TRUE(bearer(scene, gravity).has_value());
  scene.gravity.times = {0.0, 1.0};
  scene.gravity.values = {Vec3d::Zero(), Vec3d::UnitZ()};
  EXPECT_FALSE(bearer(scene, gravity).has_value());
}

}  // namespace
}  // namespace matterfit::fit
