// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/filming.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <numeric>

#include "fit/model/occlusion.hpp"

namespace matterfit::fit {
namespace {

constexpr double kSeparation = 0.05;

/// A cube of 5³ particles about `centre`.
mpm::Body cube_at(const char* name, const Vec3d& centre) {
  mpm::Body body;
  body.name = name;
  for (int i = 0; i < 125; ++i) {
    const Vec3d cell(i % 5 - 2, (i / 5) % 5 - 2, i / 25 - 2);
    body.rest.emplace_back(centre + kSeparation * cell);
  }
  return body;
}

mpm::Scene scene_of(std::vector<mpm::Body> bodies) {
  mpm::Scene scene;
  scene.fps = 10.0;
  scene.end_frame = 6;
  scene.dx = 2.0 * kSeparation;
  scene.bodies = std::move(bodies);
  return scene;
}

/// Looks along y from (0, −2, 0), z up.
splat::Camera camera() {
  splat::Camera camera;
  camera.width = 80;
  camera.height = 60;
  camera.fx = camera.fy = 120.0;
  camera.cx = 40.0;
  camera.cy = 30.0;
  camera.rotation.row(0) = Vec3d::UnitX();
  camera.rotation.row(1) = -Vec3d::UnitZ();
  camera.rotation.row(2) = Vec3d::UnitY();
  camera.translation = -(camera.rotation * Vec3d(0, -2, 0));
  return camera;
}

/// All particles on their way by x(t) = rest + `path`(t).
template <class Path>
mpm::ObservedFrame frame_of(const mpm::Scene& scene, int k, const Path& path) {
  mpm::ObservedFrame frame;
  frame.frame = k;
  for (const mpm::Body& body : scene.bodies) {
    mpm::ObservedFrame::Body& of = frame.bodies.emplace_back();
    for (const Vec3d& x : body.rest) of.positions.push_back(x + path(k / scene.fps));
    of.deformation_gradients.assign(body.rest.size(), Mat3d::Identity());
  }
  return frame;
}

View view_of(std::optional<std::size_t> body, double time = 0.0) {
  View view;
  view.camera = camera();
  view.body = body;
  view.time = time;
  view.size = 0.4;
  return view;
}

/// What a camera sees of a scene that stands still.
Drawn drawn(const mpm::Scene& scene, std::optional<std::size_t> body,
            const ParticleColours* colours = nullptr) {
  Drawn result;
  Filmer::Given given;
  given.views = {view_of(body)};
  given.colours = colours;
  given.see = [&](std::size_t, const Drawn& image) { result = image; };
  Filmer filmer(scene, given, std::make_shared<Arena>(1), SimdTarget::kAuto);
  filmer.record(frame_of(scene, 0, [](double) { return Vec3d(Vec3d::Zero()); }));
  EXPECT_FALSE(result.mask.empty()) << "a whole frame is drawn at once";
  return result;
}

double area(const std::vector<float>& mask) {
  return std::accumulate(mask.begin(), mask.end(), 0.0);
}

TEST(Filmer, DrawsWhileFramesComeWhatAWholeFilmShows) {
  const mpm::Scene scene = scene_of({cube_at("a", Vec3d(0, 0, 0))});
  const auto path = [](double t) { return Vec3d(0.3 * t, 0.1 * t * t, -0.8 * t * t); };
  const std::vector<double> times{0.42, 0.0, 0.05, 0.2, 0.31, 0.5, 0.455, 0.7};
  std::vector<Drawn> seen(times.size());
  std::vector<std::size_t> order;
  Filmer::Given given;
  for (const double time : times) given.views.push_back(view_of(std::nullopt, time));
  given.see = [&](std::size_t v, const Drawn& image) {
    seen[v] = image;
    order.push_back(v);
  };
  const auto arena = std::make_shared<Arena>(1);
  Filmer filmer(scene, given, arena, SimdTarget::kAuto);
  ParticleFilm whole(scene);
  for (int k = 0; k < 6; ++k) {
    filmer.record(frame_of(scene, k, path));
    whole.record(frame_of(scene, k, path));
  }
  EXPECT_EQ(order, (std::vector<std::size_t>{1, 2, 3, 4})) << "by time";
  filmer.finish();
  EXPECT_EQ(order.size(), 7U) << "that of .7 s lies outside";
  splat::Rasteriser rasteriser(arena);
  for (const std::size_t v : order) {
    const splat::Image& image = rasteriser.render(whole.at(times[v], 0.4, *arena), camera());
    ASSERT_EQ(image.pixels(), seen[v].mask.size());
    for (std::size_t i = 0; i < image.pixels(); ++i) {
      ASSERT_NEAR(image.mask[i], seen[v].mask[i], 1e-5) << times[v];
    }
  }
}

TEST(Filmer, ABodyIsSeenBehindAnother) {
  // The second stands before the first's right half.
  const mpm::Scene scene =
      scene_of({cube_at("a", Vec3d(0, 0, 0)), cube_at("b", Vec3d(0.1, -0.5, 0))});
  const double alone = area(drawn(scene_of({scene.bodies[0]}), 0).mask);
  const double front = area(drawn(scene_of({scene.bodies[1]}), 0).mask);
  const Drawn behind = drawn(scene, 0);
  EXPECT_NEAR(area(drawn(scene, 1).mask), front, 0.01 * front);
  EXPECT_LT(area(behind.mask), 0.5 * alone);
  EXPECT_GT(area(behind.mask), 0.25 * alone);
  EXPECT_NEAR(area(drawn(scene, std::nullopt).mask), area(behind.mask) + front, 0.01 * front);

  ParticleColours colours;
  for (const mpm::Body& body : scene.bodies) {
    auto& of = colours.bodies.emplace_back();
    of.colours.assign(body.rest.size(), Vec3f(0.2F, 0.5F, 0.8F));
    of.known.assign(body.rest.size(), 1.0F);
  }
  const Drawn coloured = drawn(scene, 0, &colours);
  for (std::size_t i = 0; i < behind.mask.size(); ++i) {
    ASSERT_NEAR(coloured.mask[i], behind.mask[i], 1e-5);
    ASSERT_NEAR(coloured.known[i], behind.mask[i], 1e-5);
    ASSERT_NEAR(coloured.colour[2 * behind.mask.size() + i], 0.8F * behind.mask[i], 1e-5);
  }
}

/// In a fourth of its pixels a body is a fourth as large, and not fatter by the rasteriser's blur.
TEST(Filmer, CoarseImagesOfFineParticlesAreDrawnFiner) {
  const mpm::Scene scene = scene_of({cube_at("a", Vec3d(0, 0, 0))});
  const double fine = area(drawn(scene, std::nullopt).mask);
  const auto coarse = [&](int oversample) {
    View view = view_of(std::nullopt);
    view.camera.width = 20;
    view.camera.height = 15;
    for (double* value : {&view.camera.fx, &view.camera.fy, &view.camera.cx, &view.camera.cy}) {
      *value /= 4.0;
    }
    view.oversample = oversample;
    std::vector<float> mask;
    Filmer::Given given;
    given.views = {view};
    given.see = [&](std::size_t, const Drawn& image) { mask = image.mask; };
    Filmer filmer(scene, given, std::make_shared<Arena>(1), SimdTarget::kAuto);
    filmer.record(frame_of(scene, 0, [](double) { return Vec3d(Vec3d::Zero()); }));
    EXPECT_EQ(mask.size(), 300U);
    return 16.0 * area(mask);
  };
  EXPECT_NEAR(coarse(4), fine, 1e-3 * fine);
  EXPECT_GT(coarse(1), 1.15 * fine);
}

/// A wall before the right half of the body; the same wall behind it, or about the camera.
TEST(Filmer, ACollidersShadowIsCutOut) {
  mpm::Scene scene = scene_of({cube_at("a", Vec3d(0, 0, 0))});
  const double whole = area(drawn(scene, std::nullopt).mask);
  const auto with_box = [&](const Vec3d& centre, const Vec3d& half) {
    shape::Pose pose;
    pose.position = centre;
    scene.colliders = {shape::make_box("wall", {}, half, shape::Keyed<shape::Pose>(pose))};
    return drawn(scene, std::nullopt);
  };
  const Drawn half = with_box(Vec3d(1.0, -0.5, 0), Vec3d(1.0, 0.05, 1.0));
  EXPECT_NEAR(area(half.mask), 0.5 * whole, 0.03 * whole);
  for (int y = 0; y < 60; ++y) {
    for (int x = 41; x < 80; ++x) ASSERT_EQ(half.mask[std::size_t(80 * y + x)], 0.0F);
  }
  EXPECT_EQ(area(with_box(Vec3d(1.0, 0.5, 0), Vec3d(1.0, 0.05, 1.0)).mask), whole);
  EXPECT_EQ(area(with_box(Vec3d(0, -2, 0), Vec3d(0.5, 0.5, 0.5)).mask), whole);
  // What the body lies on.
  scene.colliders = {shape::make_plane("floor", {}, Vec3d(0, 0, -0.125), Vec3d::UnitZ())};
  EXPECT_EQ(area(drawn(scene, std::nullopt).mask), whole);
  // A ball that moves out of the way.
  shape::Keyed<shape::Pose> motion;
  motion.times = {0.0, 0.5};
  motion.values.resize(2);
  motion.values[0].position = Vec3d(0, -0.6, 0);
  motion.values[1].position = Vec3d(1.2, -0.6, 0);
  scene.colliders = {shape::make_sphere("ball", {}, 0.1, motion)};
  EXPECT_LT(area(drawn(scene, std::nullopt).mask), 0.75 * whole);
  Arena arena(1);
  const splat::Image image = splat::render(
      [&] {
        ParticleFilm film(scene);
        film.record(frame_of(scene, 0, [](double) { return Vec3d(Vec3d::Zero()); }));
        return film.at(0.0, 0.4, arena);
      }(),
      camera());
  EXPECT_TRUE(visible_share(scene, 0.5, Vec3d::Zero(), camera(), image, arena).empty());
}

/// A body behind another, beside a collider.
mpm::Scene crowded() {
  mpm::Scene scene = scene_of({cube_at("a", Vec3d(0, 0, 0)), cube_at("b", Vec3d(0.1, -0.5, 0))});
  shape::Pose pose;
  pose.position = Vec3d(-0.6, -0.8, 0.0);
  scene.colliders = {
      shape::make_box("wall", {}, Vec3d(0.55, 0.05, 1.0), shape::Keyed<shape::Pose>(pose))};
  return scene;
}

/// The way back from images between frames to the frames, against differences in some direction of
/// all of them: one body, drawn finer, of known colours.
void expect_way_back(const mpm::Scene& scene, std::span<const OwnSplats> own) {
  ParticleColours colours;
  for (const mpm::Body& body : scene.bodies) {
    auto& of = colours.bodies.emplace_back();
    for (std::size_t i = 0; i < body.rest.size(); ++i) {
      const float wave = std::sin(0.7F * float(i));
      of.colours.emplace_back(0.5F + 0.3F * wave, 0.5F - 0.2F * wave, 0.4F);
      of.known.push_back(0.6F + 0.3F * std::cos(0.3F * float(i)));
    }
  }
  std::vector<View> views;
  for (const double time : {0.0, 0.13, 0.25, 0.5}) {
    views.push_back(view_of(0, time));
    views.back().oversample = 2;
  }
  const auto bar_of = [&](std::size_t v) {
    Drawn bar;
    const auto wave = [&](std::size_t count, float phase) {
      std::vector<float> values(count);
      for (std::size_t i = 0; i < count; ++i) {
        values[i] = std::sin(0.05F * float(i % 80) + 0.08F * float(i / 80) + phase + float(v));
      }
      return values;
    };
    bar.mask = wave(4800, 0.0F);
    bar.colour = wave(3 * 4800, 1.0F);
    bar.known = wave(4800, 2.0F);
    return bar;
  };
  // Smooth over the particles, so that no rounding of one counts.
  const auto direction = [](std::size_t b, std::size_t i, int k) {
    const double t = 0.02 * double(i) + double(b) + 0.7 * k;
    return Vec3d(std::sin(t), std::cos(1.3 * t), std::sin(0.7 * t + 1.0));
  };
  // Of a lattice along the view many lie as deep as others: which is in front would change at once.
  const Mat3d turn = (Eigen::AngleAxisd(0.4, Vec3d::UnitX()) *
                      Eigen::AngleAxisd(0.3, Vec3d(0.3, 0.2, 1.0).normalized()))
                         .toRotationMatrix();
  const auto frame = [&](int k, double by) {
    mpm::ObservedFrame one =
        frame_of(scene, k, [](double t) { return Vec3d(0.2 * t, 0.1 * t * t, -0.3 * t * t); });
    for (std::size_t b = 0; b < one.bodies.size(); ++b) {
      for (std::size_t i = 0; i < one.bodies[b].positions.size(); ++i) {
        Vec3d& x = one.bodies[b].positions[i];
        x = turn * x + by * direction(b, i, k);
        for (int c = 0; c < 3; ++c) {
          one.bodies[b].deformation_gradients[i].col(c) += by * direction(b, i, k + 3 * c + 1);
        }
      }
    }
    return one;
  };
  FilmBars bars;
  const auto weighed = [&](double by, bool back) {
    double sum = 0.0;
    Filmer::Given given;
    given.views = views;
    given.colours = &colours;
    given.own = own;
    given.see = [&](std::size_t v, const Drawn& image) {
      const Drawn bar = bar_of(v);
      for (const auto part : {&Drawn::mask, &Drawn::colour, &Drawn::known}) {
        for (std::size_t i = 0; i < (bar.*part).size(); ++i) {
          sum += double((bar.*part)[i]) * double((image.*part)[i]);
        }
      }
    };
    if (back) given.bar = bar_of;
    given.frames = 6;
    Filmer filmer(scene, given, std::make_shared<Arena>(1), SimdTarget::kAuto);
    for (int k = 0; k < 6; ++k) filmer.record(frame(k, by));
    filmer.finish();
    if (back) bars = filmer.bars();
    return sum;
  };
  (void)weighed(0.0, true);
  double exact = 0.0;
  ASSERT_EQ(bars.bodies.size(), 2U);
  for (std::size_t b = 0; b < 2; ++b) {
    for (int k = 0; k < 6; ++k) {
      const Points& places = bars.bodies[b].places[std::size_t(k)];
      const Points& columns = bars.bodies[b].columns[std::size_t(k)];
      for (std::size_t i = 0; i < places.size(); ++i) {
        exact += places[i].dot(direction(b, i, k));
        for (int c = 0; c < 3; ++c) {
          exact += columns[3 * i + std::size_t(c)].dot(direction(b, i, k + 3 * c + 1));
        }
      }
    }
  }
  constexpr double kStep = 1e-3;
  const double difference = (weighed(-2.0 * kStep, false) - 8.0 * weighed(-kStep, false) +
                             8.0 * weighed(kStep, false) - weighed(2.0 * kStep, false)) /
                            (12.0 * kStep);
  EXPECT_GT(std::abs(difference), 1.0);
  // What is cut off at α = 1/255 has an edge that moves; the way back does not know of it.
  EXPECT_NEAR(exact, difference, 0.03 * std::abs(difference));
}

TEST(Filmer, GoesBackFromImagesToFrames) { expect_way_back(crowded(), {}); }

/// Both bodies by splats of their own, of different degrees; the second's are bound by what fits
/// its particles, and in front of the first's.
TEST(Filmer, GoesBackFromImagesOfSplats) {
  mpm::Scene scene = crowded();
  mpm::Body& soft = scene.bodies[1];
  soft.material.law = material::Law::kVonMises;
  const auto painted = [&](std::size_t b, int degree, std::size_t each) {
    capture::Splats splats;
    splats.sh_degree = degree;
    splats.antialiased = true;
    const std::vector<Vec3d>& rest = scene.bodies[b].rest;
    for (std::size_t i = 0; i < rest.size(); i += each) {
      const auto at = float(i);
      splats.means.push_back(rest[i].cast<float>() + Vec3f(0.011F, 0.007F, -0.009F));
      splats.rotations.emplace_back(
          Eigen::AngleAxisf(0.1F * at, Vec3f(1.0F, 2.0F, -1.0F).normalized()));
      splats.scales.emplace_back(0.03F, 0.02F, 0.025F);
      splats.opacities.push_back(0.7F);
      for (std::size_t k = 0; k < 3 * splats.sh_bands(); ++k) {
        splats.sh.push_back(0.15F * std::sin(0.9F * at + float(k)));
      }
    }
    return BodySplats{b, splats};
  };
  Arena arena(1);
  const std::vector<OwnSplats> own =
      carried({painted(0, 3, 2), painted(1, 1, 3), painted(0, 2, 5)}, scene, arena);
  EXPECT_EQ(own[0].splats.binding().gradient(), capture::BindingGradient::kParticle);
  EXPECT_EQ(own[1].splats.binding().gradient(), capture::BindingGradient::kFitted);
  expect_way_back(scene, own);
}

/// Splats that a body carries, turned a quarter about z: red seen from the front at rest, green
/// then.
TEST(Filmer, SplatsOfABodysOwnAreDrawnAndTurnWithIt) {
  const mpm::Scene scene = scene_of({cube_at("a", Vec3d(0, 0, 0))});
  capture::Splats splats;
  splats.sh_degree = 1;
  splats.antialiased = true;
  splats.means = {Vec3f(0, 0, 0)};
  splats.rotations = {Eigen::Quaternionf::Identity()};
  splats.scales = {Vec3f(0.05F, 0.05F, 0.05F)};
  splats.opacities = {0.9F};
  // The direction from the camera is y there: red falls along y; green along x, so it is grey.
  splats.sh.assign(12, 0.0F);
  splats.sh[3] = 0.8F;      // −C₁ y of red
  splats.sh[9 + 1] = 0.8F;  // −C₁ x of green
  Arena arena(1);
  const std::vector<OwnSplats> own = carried({{0, splats}}, scene, arena);
  EXPECT_TRUE(drawn_by_splats(own, 1, std::nullopt));
  EXPECT_FALSE(drawn_by_splats(own, 2, std::nullopt));
  EXPECT_TRUE(ParticleFilm(scene, own).options().antialiased);
  EXPECT_FALSE(ParticleFilm(scene).options().antialiased);
  const ParticleColours colours{{{}}};
  const auto seen = [&](double angle) -> Vec3d {
    const Mat3d turn = Eigen::AngleAxisd(angle, Vec3d::UnitZ()).toRotationMatrix();
    mpm::ObservedFrame frame;
    mpm::ObservedFrame::Body& of = frame.bodies.emplace_back();
    for (const Vec3d& x : scene.bodies[0].rest) of.positions.push_back(turn * x);
    of.deformation_gradients.assign(of.positions.size(), turn);
    Drawn result;
    Filmer::Given given;
    given.views = {view_of(std::nullopt)};
    given.colours = &colours;
    given.own = own;
    given.see = [&](std::size_t, const Drawn& image) { result = image; };
    Filmer filmer(scene, given, std::make_shared<Arena>(1), SimdTarget::kAuto);
    filmer.record(frame);
    const std::size_t middle = 30 * 80 + 40;
    EXPECT_NEAR(result.known[middle], result.mask[middle], 1e-6);
    return Vec3d(result.colour[middle], result.colour[4800 + middle],
                 result.colour[9600 + middle]) /
           double(result.mask[middle]);
  };
  const double c1 = 0.4886025119029199;
  const Vec3d front = seen(0.0);
  EXPECT_NEAR(front.x(), 0.5 - 0.8 * c1, 5e-3);
  EXPECT_NEAR(front.y(), 0.5, 5e-3);
  // What looked along y before now looks along −x; what looked along x now along y.
  const Vec3d turned = seen(0.5 * std::numbers::pi);
  EXPECT_NEAR(turned.x(), 0.5, 5e-3);
  EXPECT_NEAR(turned.y(), 0.5 - 0.8 * c1, 5e-3);
}

}  // namespace
}  // namespace matterfit::fit
