// SPDX-License-Identifier: GPL-3.0-or-later
// Random elastic bodies thrown at random, one JSON object a line on standard output; ends with how
// many ran, and with status 1 if one did not or went where it cannot (bench/random_solids.hpp).
#include <CLI/CLI.hpp>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>

#include "bench/bench_main.hpp"
#include "bench/random_solids.hpp"

namespace matterfit::bench {
namespace {

int run(int argc, char** argv) {
  CLI::App app{"Random elastic bodies thrown at random"};
  std::uint64_t first = 1;
  int count = 200;
  int threads = 1;
  ThrowSetting setting;
  bool updated = false;
  std::string mesh_file;
  app.add_option("--seed", first, "Seed of the first throw");
  app.add_option("--count", count, "Throws");
  app.add_option("--particles", setting.particles, "About so many in a body");
  app.add_option("--seconds", setting.seconds, "Simulated");
  app.add_option("--threads", threads);
  app.add_option("--mesh", mesh_file, "Throw this mesh in place of random ones");
  app.add_flag("--updated", updated, "The updated formulation in place of the default");
  CLI11_PARSE(app, argc, argv);
  if (updated) setting.formulation = mpm::Formulation::kUpdated;
  std::optional<capture::Mesh> mesh;
  if (!mesh_file.empty()) mesh = capture::read_mesh(mesh_file);
  int ran = 0;
  int right = 0;
  for (int i = 0; i < count; ++i) {
    const std::uint64_t seed = first + static_cast<std::uint64_t>(i);
    const RandomThrow thrown = random_throw(seed, setting, mesh ? &*mesh : nullptr);
    const ThrowResult result = run_throw(thrown, threads);
    ran += result.ran ? 1 : 0;
    right += is_right(thrown, result) ? 1 : 0;
    std::printf(
        "{\"seed\": %llu, \"throw\": \"%s\", \"particles\": %zu, \"ran\": %s, \"right\": %s, "
        "\"frames\": %d, \"retried\": %d, \"highest\": %.4f, \"height_of_energy\": %.4f, "
        "\"penetration\": %.4f, "
        "\"least_volume\": %.3f, \"substeps\": %.0f, \"notes\": \"%s\", \"error\": \"%s\"}\n",
        static_cast<unsigned long long>(seed), thrown.words.c_str(),
        thrown.scene.bodies.front().rest.size(), result.ran ? "true" : "false",
        is_right(thrown, result) ? "true" : "false", result.frames, result.retried, result.highest,
        thrown.height, result.penetration / thrown.size, result.least_volume, result.substeps,
        result.notes.c_str(), result.error.c_str());
    std::fflush(stdout);
  }
  std::printf("{\"throws\": %d, \"ran\": %d, \"right\": %d}\n", count, ran, right);
  return right == count ? 0 : 1;
}

}  // namespace
}  // namespace matterfit::bench

int main(int argc, char** argv) {
  return matterfit::bench::bench_main("random_solids_bench", matterfit::bench::run, argc, argv);
}
