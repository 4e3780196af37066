// SPDX-License-Identifier: GPL-3.0-or-later
// How far motion depends on the substep and on the formulation (docs/validation.md), one JSON
// object a line on standard output.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "bench/bench_main.hpp"
#include "mpm/validation_flows_for_test.hpp"

namespace matterfit::bench {
namespace {

using material::Law;
using material::Material;
using mpm::Formulation;
using shape::Contact;
using shape::ContactKind;
using shape::ContactMethod;
namespace validation = mpm::validation;

constexpr double kSize = 0.24;  ///< of the thrown ball [m]

struct Named {
  const char* name;
  Material material;
};

/// One of each kind, about as those of PAC-NeRF's clips.
std::vector<Named> five_materials() {
  Material elastic;
  elastic.law = Law::kNeoHookean;
  elastic.youngs_modulus = 1e5;
  elastic.poisson_ratio = 0.3;
  Material fluid;
  fluid.law = Law::kNewtonian;
  fluid.viscosity = 10.0;
  fluid.bulk_modulus = 3e5;
  Material cream;
  cream.law = Law::kHerschelBulkley;
  cream.youngs_modulus = 1e5;
  cream.poisson_ratio = 0.3;
  cream.yield_stress = 1000.0;
  cream.viscosity = 10.0;
  Material plasticine;
  plasticine.law = Law::kVonMises;
  plasticine.youngs_modulus = 5e5;
  plasticine.poisson_ratio = 0.3;
  plasticine.yield_stress = 6000.0;
  Material sand;
  sand.law = Law::kDruckerPrager;
  sand.youngs_modulus = 5e5;
  sand.poisson_ratio = 0.2;
  sand.friction_angle = 35.0;
  return {{"elastic", elastic},
          {"newtonian", fluid},
          {"non_newtonian", cream},
          {"plasticine", plasticine},
          {"sand", sand}};
}

mpm::Scene thrown_ball(const Material& material, Formulation formulation, const Contact& contact,
                       int cells) {
  mpm::Scene scene;
  scene.dx = kSize / cells;
  mpm::Body body =
      validation::ball_body("ball", Vec3d(0, 0, 0.7 * kSize), 0.5 * kSize, 0.5 * scene.dx);
  body.material = material;
  body.formulation = formulation;
  body.velocity = Vec3d(0.5, 0.2, -2.0);
  body.spin = Vec3d(1.0, 3.0, 0.5);
  scene.bodies.push_back(std::move(body));
  scene.colliders.push_back(shape::make_plane("floor", contact, Vec3d::Zero(), Vec3d::UnitZ()));
  scene.end_frame = 17;
  return scene;
}

struct Track {
  std::vector<mpm::FrameState> frames;
  std::vector<int> substeps;
  double seconds = 0.0;
};

/// With `factor` times the substeps in `as`, or the solver's own.
Track track(mpm::Scene scene, const std::vector<int>& as, int factor, int threads) {
  Track out;
  for (const int n : as) scene.substeps.push_back(n * factor);
  mpm::Simulation simulation(scene, std::make_shared<Arena>(threads));
  const Interrupter interrupter;
  out.frames.push_back(simulation.state());
  while (simulation.frame() + 1 < scene.end_frame) {
    const mpm::FrameReport report = simulation.advance(interrupter);
    out.substeps.push_back(report.substeps);
    out.seconds += report.seconds;
    out.frames.push_back(simulation.state());
  }
  return out;
}

/// Mean over frames and particles [m].
double distance(const Track& a, const Track& b) {
  double sum = 0.0;
  double count = 0.0;
  for (std::size_t f = 0; f < a.frames.size(); ++f) {
    const auto& x = a.frames[f].bodies[0].positions;
    const auto& y = b.frames[f].bodies[0].positions;
    for (std::size_t p = 0; p < x.size(); ++p) {
      sum += static_cast<double>((x[p] - y[p]).norm());
      count += 1.0;
    }
  }
  return sum / count;
}

void substeps(const std::vector<std::string>& names, Formulation formulation, const char* word,
              const std::string& contact_word, int cells, int threads) {
  Contact contact;
  if (contact_word == "glue_node") {
    contact.kind = ContactKind::kGlue;
    contact.method = ContactMethod::kNode;
  } else if (contact_word == "friction_node") {
    contact.method = ContactMethod::kNode;
  }
  for (const Named& entry : five_materials()) {
    if (std::find(names.begin(), names.end(), entry.name) == names.end()) continue;
    const mpm::Scene scene = thrown_ball(entry.material, formulation, contact, cells);
    const Track own = track(scene, {}, 1, threads);
    const Track quarter = track(scene, own.substeps, 4, threads);
    const double apart = distance(own, quarter);
    int most = 0;
    for (const int n : own.substeps) most = std::max(most, n);
    std::printf(
        "{\"case\": \"substep\", \"formulation\": \"%s\", \"material\": \"%s\", \"contact\": "
        "\"%s\", \"cells\": %d, \"particles\": %zu, \"most_substeps\": %d, \"apart_mm\": %.4f, "
        "\"percent_of_size\": %.4f, \"seconds\": %.2f}\n",
        word, entry.name, contact_word.c_str(), cells, scene.bodies[0].rest.size(), most,
        1e3 * apart, 100.0 * apart / kSize, own.seconds);
    std::fflush(stdout);
  }
}

/// Free vibration of an elastic ball in its quadrupole mode: what its stretch rate keeps.
void vibration(Formulation formulation, const char* word, int cells, int threads) {
  Material jelly;
  jelly.law = Law::kNeoHookean;
  jelly.youngs_modulus = 1e5;
  jelly.poisson_ratio = 0.3;
  mpm::Scene scene;
  scene.dx = kSize / cells;
  scene.gravity = shape::Keyed<Vec3d>(Vec3d::Zero());
  scene.fps = 240;
  scene.end_frame = 121;
  mpm::Body body = validation::ball_body("ball", Vec3d::Zero(), 0.5 * kSize, 0.5 * scene.dx);
  body.material = jelly;
  body.formulation = formulation;
  for (const Vec3d& x : body.rest)
    body.particle_velocities.push_back(Vec3d(6 * x[0], -6 * x[1], 0));
  const Points rest = body.rest;
  scene.bodies.push_back(std::move(body));
  const Track own = track(scene, {}, 1, threads);
  for (const int factor : {1, 2, 4, 8}) {
    const Track run = track(scene, own.substeps, factor, threads);
    double first = 0.0;
    double last = 0.0;
    for (std::size_t f = 0; f < run.frames.size(); ++f) {
      double stretch = 0.0;
      double norm = 0.0;
      for (std::size_t p = 0; p < rest.size(); ++p) {
        const Vec3f& x = run.frames[f].bodies[0].positions[p];
        stretch += static_cast<double>(x[0]) * rest[p][0] - static_cast<double>(x[1]) * rest[p][1];
        norm += rest[p][0] * rest[p][0] + rest[p][1] * rest[p][1];
      }
      const double size = std::abs(stretch / norm);
      if (4 * f < run.frames.size()) first = std::max(first, size);
      if (4 * f > 3 * run.frames.size()) last = std::max(last, size);
    }
    std::printf(
        "{\"case\": \"vibration\", \"formulation\": \"%s\", \"cells\": %d, \"substeps\": %d, "
        "\"first\": %.5f, \"kept\": %.4f}\n",
        word, cells, run.substeps[0], first, last / first);
    std::fflush(stdout);
  }
}

void columns(const std::vector<double>& aspects, Formulation formulation, const char* word,
             shape::ContactMethod method, int cells, int threads) {
  for (const double aspect : aspects) {
    const auto begin = std::chrono::steady_clock::now();
    const auto column = validation::sand_column(aspect, cells, method, threads, formulation);
    std::printf(
        "{\"case\": \"column\", \"formulation\": \"%s\", \"cells\": %d, \"aspect\": %g, "
        "\"runout\": %.4f, \"outer\": %.4f, \"lube\": %.4f, \"height\": %.4f, \"seconds\": %.1f}\n",
        word, cells, aspect, column.runout, column.outer, column.expected, column.height,
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    std::fflush(stdout);
  }
}

int run(int argc, char** argv) {
  std::string what = "substeps";
  std::string word = "renewed";
  std::string contact = "friction_particle";
  std::vector<std::string> names{"elastic", "newtonian", "non_newtonian", "plasticine", "sand"};
  std::vector<double> aspects{0.4, 0.9, 2.0};
  int cells = 12;
  int threads = 1;
  CLI::App app("Does motion depend on the substep?");
  app.add_option("case", what)->check(CLI::IsMember({"substeps", "vibration", "columns"}));
  app.add_option("--formulation", word)->check(CLI::IsMember({"renewed", "updated", "total"}));
  app.add_option("--contact", contact)
      ->check(CLI::IsMember({"friction_particle", "friction_node", "glue_node"}));
  app.add_option("--materials", names);
  app.add_option("--aspects", aspects, "height over radius of columns, which have friction");
  app.add_option("--cells", cells, "across the ball, or the column's radius");
  app.add_option("--threads", threads);
  CLI11_PARSE(app, argc, argv);
  const Formulation formulation = word == "renewed"   ? Formulation::kRenewed
                                  : word == "updated" ? Formulation::kUpdated
                                                      : Formulation::kTotal;
  if (what == "substeps") substeps(names, formulation, word.c_str(), contact, cells, threads);
  if (what == "vibration") vibration(formulation, word.c_str(), cells, threads);
  if (what == "columns") {
    const auto method = contact == "friction_particle" ? shape::ContactMethod::kParticle
                                                       : shape::ContactMethod::kNode;
    columns(aspects, formulation, word.c_str(), method, cells, threads);
  }
  return 0;
}

}  // namespace
}  // namespace matterfit::bench

int main(int argc, char** argv) {
  return matterfit::bench::bench_main("substep_bench", matterfit::bench::run, argc, argv);
}
