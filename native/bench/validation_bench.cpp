// SPDX-License-Identifier: GPL-3.0-or-later
// The solver against known answers (docs/validation.md), one JSON object a line on standard output.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>
#include <vector>

#include "bench/bench_main.hpp"
#include "mpm/contact_law.hpp"
#include "mpm/validation_flows_for_test.hpp"
#include "mpm/validation_solids_for_test.hpp"

namespace matterfit::bench {
namespace {

using mpm::Formulation;
using shape::ContactKind;
using shape::ContactMethod;
namespace validation = mpm::validation;

const char* name(Formulation formulation) {
  return formulation == Formulation::kTotal ? "total" : "updated";
}

constexpr Formulation kBoth[] = {Formulation::kTotal, Formulation::kUpdated};

void drops(int offsets, int threads) {
  const auto one = [&](Formulation formulation, ContactMethod method, int cells, double damping) {
    std::vector<double> rebound;
    std::vector<double> deepest;
    for (int i = 0; i < offsets; ++i) {
      validation::DropSetting setting{formulation, method, cells, i / static_cast<double>(offsets)};
      setting.damping = damping;
      setting.threads = threads;
      const validation::Drop drop = validation::drop_ball(setting);
      rebound.push_back(drop.rebound);
      deepest.push_back(drop.deepest);
    }
    std::printf(
        "{\"case\": \"drop\", \"formulation\": \"%s\", \"contact\": \"%s\", \"cells\": %d, "
        "\"damping\": %g, \"offsets\": %d, \"rebound\": %.4f, \"rebound_spread_percent\": %.2f, "
        "\"deepest_mm\": %.3f, \"deepest_spread_mm\": %.4f}\n",
        name(formulation), method == ContactMethod::kNode ? "node" : "particle", cells,
        damping < 0 ? mpm::kContactDamping : damping, offsets, validation::average(rebound),
        100 * validation::spread(rebound) / validation::average(rebound),
        1e3 * validation::average(deepest), 1e3 * validation::spread(deepest));
    std::fflush(stdout);
  };
  for (const Formulation formulation : kBoth) {
    for (const int cells : {8, 12, 16}) one(formulation, ContactMethod::kParticle, cells, -1);
    for (const double damping : {0.0, 0.1, 0.2, 0.4}) {
      one(formulation, ContactMethod::kParticle, 8, damping);
    }
  }
  for (const int cells : {8, 12, 16}) one(Formulation::kUpdated, ContactMethod::kNode, cells, -1);
}

void slides(int threads) {
  for (const Formulation formulation : kBoth) {
    for (const double offset : {0.0, 0.3, 0.7}) {
      const auto stick = validation::slide_block(formulation, 0.95, offset, 4, threads);
      const auto slip = validation::slide_block(formulation, 1.05, offset, 4, threads);
      std::printf(
          "{\"case\": \"incline\", \"formulation\": \"%s\", \"offset\": %g, \"creep_early_mm\": "
          "%.5f, \"creep_late_mm\": %.5f, \"acceleration\": %.5f, \"coulomb\": %.5f}\n",
          name(formulation), offset, 1e3 * stick.creep_early, 1e3 * stick.creep_late,
          slip.acceleration, slip.expected);
      std::fflush(stdout);
    }
  }
}

void beams(int offsets, int threads) {
  for (const Formulation formulation : kBoth) {
    for (const int cells : {2, 4, 6}) {
      const auto bar = validation::bar_frequency({formulation, false, cells, 0.0, threads});
      std::printf(
          "{\"case\": \"bar\", \"formulation\": \"%s\", \"ends\": \"free\", \"cells\": %d, \"hz\": "
          "%.4f, \"theory\": %.4f, \"zeta\": %.5f}\n",
          name(formulation), cells, bar.measured, bar.expected, bar.damping);
      std::fflush(stdout);
    }
  }
  for (const int cells : {2, 4, 6}) {
    std::vector<double> bars;
    std::vector<double> sags;
    std::vector<double> frequencies;
    for (int i = 0; i < offsets; ++i) {
      const double offset = i / static_cast<double>(offsets);
      const auto bar =
          validation::bar_frequency({Formulation::kTotal, true, cells, offset, threads});
      const auto beam = validation::cantilever({Formulation::kTotal, true, cells, offset, threads});
      std::printf(
          "{\"case\": \"clamp\", \"cells\": %d, \"offset\": %.2f, \"bar_hz\": %.4f, "
          "\"bar_theory\": "
          "%.4f, \"sag_mm\": %.4f, \"sag_theory\": %.4f, \"beam_hz\": %.4f, \"beam_theory\": %.4f, "
          "\"zeta\": %.5f}\n",
          cells, offset, bar.measured, bar.expected, 1e3 * beam.sag, 1e3 * validation::kBeam.sag(),
          beam.frequency, validation::kBeam.frequency(), beam.damping);
      std::fflush(stdout);
      bars.push_back(bar.measured);
      sags.push_back(beam.sag);
      frequencies.push_back(beam.frequency);
    }
    const auto percent = [](const std::vector<double>& values) {
      return 100 * validation::spread(values) / validation::average(values);
    };
    std::printf(
        "{\"case\": \"clamp_spread\", \"cells\": %d, \"offsets\": %d, \"bar_percent\": %.3f, "
        "\"sag_percent\": %.3f, \"beam_percent\": %.3f}\n",
        cells, offsets, percent(bars), percent(sags), percent(frequencies));
    std::fflush(stdout);
  }
}

template <class Points>
void dam(const char* column, double a, const Points& measured, ContactKind floor, int cells,
         int threads) {
  std::vector<double> times;
  times.reserve(measured.size());
  for (const auto& point : measured) times.push_back(point.t);
  const std::vector<double> fronts = validation::dam_break(a, times, floor, cells, threads);
  for (std::size_t i = 0; i < fronts.size(); ++i) {
    std::printf(
        "{\"case\": \"dam\", \"column\": \"%s\", \"floor\": \"%s\", \"cells\": %d, \"t\": %.3f, "
        "\"front\": %.3f, \"measured\": %.3f}\n",
        column, floor == ContactKind::kGlue ? "glue" : "separating", cells, times[i], fronts[i],
        measured[i].z);
  }
  std::fflush(stdout);
}

void flows(int threads) {
  for (const int cells : {5, 10, 20}) {
    dam("57.15 mm", 0.05715, validation::kDamLarge, ContactKind::kSeparating, cells, threads);
  }
  dam("57.15 mm", 0.05715, validation::kDamLarge, ContactKind::kGlue, 10, threads);
  dam("28.575 mm", 0.028575, validation::kDamSmall, ContactKind::kSeparating, 10, threads);
  for (const double aspect : {0.9, 3.0}) {
    const auto heap = validation::sand_column(aspect, 6, ContactMethod::kParticle, threads);
    std::printf(
        "{\"case\": \"sand\", \"aspect\": %g, \"cells\": 6, \"runout\": %.3f, \"lube\": %.3f, "
        "\"height\": %.3f}\n",
        aspect, heap.runout, heap.expected, heap.height);
    std::fflush(stdout);
  }
  for (const ContactMethod method : {ContactMethod::kParticle, ContactMethod::kNode}) {
    for (const int cells : {8, 16}) {
      for (const double offset : {0.0, 0.3}) {
        const auto flow = validation::channel_flow(cells, offset, method, threads);
        std::printf(
            "{\"case\": \"channel\", \"walls\": \"%s\", \"cells\": %d, \"offset\": %g, \"speed\": "
            "%.5f, \"theory\": %.5f, \"slip\": %.4f}\n",
            method == ContactMethod::kNode ? "node" : "particle", cells, offset, flow.centre,
            flow.expected, flow.wall_slip);
        std::fflush(stdout);
      }
    }
  }
}

int run(int argc, char** argv) {
  std::vector<std::string> parts{"drop", "incline", "beam", "flow"};
  int offsets = 10;
  int threads = 2;
  CLI::App app("The solver against known answers");
  app.add_option("--parts", parts, "of: drop incline beam flow")->capture_default_str();
  app.add_option("--offsets", offsets, "places within a cell")->capture_default_str();
  app.add_option("--threads", threads)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  for (const std::string& part : parts) {
    if (part == "drop") drops(offsets, threads);
    if (part == "incline") slides(threads);
    if (part == "beam") beams(offsets, threads);
    if (part == "flow") flows(threads);
  }
  return 0;
}

}  // namespace
}  // namespace matterfit::bench

int main(int argc, char** argv) {
  return matterfit::bench::bench_main("validation_bench", matterfit::bench::run, argc, argv);
}
