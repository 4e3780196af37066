// SPDX-License-Identifier: GPL-3.0-or-later
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "base/file.hpp"
#include "capi/inspect_run.hpp"
#include "capi/job_thread.hpp"
#include "capi/terminal.hpp"
#include "capi/wedge_run.hpp"
#include "job/curves.hpp"
#include "job/diagnosis/diagnose_tests.hpp"
#include "job/diagnosis/page.hpp"
#include "job/diagnosis/run_diagnose.hpp"
#include "job/documents/document.hpp"
#include "job/documents/farm_files.hpp"
#include "job/documents/inputs.hpp"
#include "job/documents/json_reader.hpp"
#include "job/documents/tests_document.hpp"
#include "job/documents/wedge.hpp"
#include "job/fit_like.hpp"
#include "job/new_job.hpp"
#include "job/pretrain_files.hpp"
#include "job/run/estimate.hpp"
#include "job/run/validate.hpp"
#include "job/run_job.hpp"

namespace {

using matterfit::Error;
using matterfit::ErrorKind;
namespace job = matterfit::job;
namespace capi = matterfit::capi;

std::atomic<int> caught_signal{0};

extern "C" void on_signal(int number) {
  // The second one of a kind ends the process the usual way.
  caught_signal.store(number, std::memory_order_relaxed);
  std::signal(number, SIG_DFL);
}

struct Arguments {
  job::NewJobOptions fresh;
  job::PretrainOptions pretrain;
  matterfit::material::Excitation over;
  job::CurveOptions curves;
  bool alone = false;
  std::string picture;
  std::string law = "fixed_corotated";
  std::string up;
  std::string job;
  std::string folder;
  std::vector<std::string> set;
  int threads = 0;
  std::string target = "auto";
  std::string report;
  std::string task;  // of a wedge
  std::string write;
  int at_once = 1;
  bool json = false;
  bool restart = false;
  bool quiet = false;
};

/// Checked before CLI11 converts the text, which says no more than that it could not.
CLI::Validator whole_number(int low, int high) {
  return CLI::Validator(
      [low, high](const std::string& text) -> std::string {
        int value = 0;
        const auto end = text.data() + text.size();
        const auto [stop, fault] = std::from_chars(text.data(), end, value);
        if (fault == std::errc{} && stop == end && value >= low && value <= high) return {};
        const std::string most =
            high == std::numeric_limits<int>::max() ? " or more" : " to " + std::to_string(high);
        return "'" + text + "' is not a whole number, " + std::to_string(low) + most;
      },
      "");
}

constexpr const char* kJobs = "job document (docs/formats.md)";
constexpr const char* kJobsOrTests =
    "job document with recordings, or tests of a testing machine (docs/formats.md)";

/// `documents`: what the verb takes.
void add_common(CLI::App& app, Arguments& arguments, const char* documents = kJobs) {
  app.add_option("JOB", arguments.job, documents)->required();
  app.add_option("--set", arguments.set,
                 "PATH=VALUE: change the document, as in scene.gravity=[0,0,-3.7]; may be repeated")
      ->expected(1)
      ->take_all()
      ->allow_extra_args(false);
  app.add_option("--threads", arguments.threads, "threads; 0: as many as the machine has")
      ->check(whole_number(0, std::numeric_limits<int>::max()));
  app.add_option("--target", arguments.target, "instruction set: auto, sse4, avx2, avx512");
  app.add_option("--report", arguments.report, "write the result to this file too")
      ->check([](const std::string& file) -> std::string {
        const bool page = std::filesystem::path(file).extension() == ".html";
        return page ? "it is the JSON file; a page is written beside it as .html" : "";
      });
  app.add_flag("--json", arguments.json, "print the result as JSON on standard output");
  app.add_flag("--restart", arguments.restart,
               "begin afresh, removing the results that the output folder's manifest lists");
  app.add_flag("--quiet", arguments.quiet, "no progress on standard error");
}

int fail(const Arguments& arguments, ErrorKind kind, const std::string& message) {
  const int status = matterfit::exit_status(kind);
  std::fprintf(stderr, "matterfit: %s\n", message.c_str());
  if (arguments.json) {
    const job::Json json = {{"status", "error"}, {"error", message}, {"exit_status", status}};
    std::printf("%s\n", json.dump(2, ' ', false, job::Json::error_handler_t::replace).c_str());
  }
  return status;
}

job::Job read(const Arguments& arguments, const std::string& verb) {
  job::ReadOptions options;
  options.overrides = arguments.set;
  if (verb != "estimate" && verb != "validate") options.task = job::task_from_name(verb);
  return job::read_job_file(arguments.job, options);
}

job::RunOptions run_options(const Arguments& arguments) {
  job::RunOptions options;
  options.threads = arguments.threads;
  options.target = job::target_from_name(arguments.target);
  options.restart = arguments.restart ? job::Restart::kAlways : job::Restart::kNever;
  return options;
}

/// Shows the progress until the work has ended; a signal cancels it.
void watch(const Arguments& arguments, capi::JobThread& thread) {
  capi::ProgressLine progress(!arguments.quiet);
  while (!thread.wait(0.1)) {
    if (caught_signal.load(std::memory_order_relaxed) != 0) thread.cancel();
    progress.show(thread.progress(), thread.seconds_left());
  }
  progress.finish();
}

/// Shows a thread's work and what came of it; gives the exit status.
int finish(const Arguments& arguments, capi::JobThread& thread) {
  watch(arguments, thread);
  const capi::Outcome& outcome = thread.outcome();
  if (!outcome.error.empty()) std::fprintf(stderr, "matterfit: %s\n", outcome.error.c_str());
  const job::Json result = job::Json::parse(outcome.result, nullptr, false);
  std::filesystem::path file = arguments.report;
  if (!file.empty()) matterfit::write_file(file, outcome.result + "\n");
  if (!file.empty() && result.is_object() && result.value("schema", "") == job::kReportSchema) {
    matterfit::write_file(file.replace_extension(".html"), job::report_page(result));
  }
  if (arguments.json) {
    std::printf("%s\n", outcome.result.c_str());
  } else if (outcome.exit_status == 0 || result.contains("fit")) {
    std::fputs(capi::summary(result).c_str(), stdout);
  }
  return outcome.exit_status;
}

int run(const Arguments& arguments, const std::string& verb) {
  capi::JobThread thread(read(arguments, verb), run_options(arguments));
  return finish(arguments, thread);
}

/// Diagnoses what a testing machine measured.
int diagnose_tests(const Arguments& arguments) {
  if (!arguments.set.empty()) matterfit::throw_input("--set changes jobs; these are tests.");
  capi::JobThread thread([&](matterfit::Interrupter& interrupter) {
    const job::Json report = job::diagnose_tests(arguments.job, arguments.threads, interrupter);
    return capi::Outcome{0, report.dump(2, ' ', false, job::Json::error_handler_t::replace), {}};
  });
  return finish(arguments, thread);
}

CLI::App* add_wedge(CLI::App& app, Arguments& arguments) {
  CLI::App* verb = app.add_subcommand(
      "wedge", "run a document once for each combination of the values given with --set");
  add_common(*verb, arguments);
  verb->get_option("--set")->description(
      "PATH=VALUE,VALUE,…: one member for each value, and for each combination where --set is "
      "repeated");
  verb->add_option("--output", arguments.folder,
                   "folder of the members, one each; JOB_wedge beside JOB where not given");
  verb->add_option("--task", arguments.task, "what each member does; without it the document's");
  verb->add_option("--jobs", arguments.at_once, "members that run side by side")
      ->check(whole_number(1, 1024));
  verb->add_option("--write", arguments.write,
                   "run nothing, write the file of a farm beside the members: slurm, flamenco");
  return verb;
}

int wedge(const Arguments& arguments) {
  const job::RunOptions options = run_options(arguments);
  job::ReadOptions reading;
  reading.base_folder = std::filesystem::absolute(arguments.job).parent_path();
  reading.name = std::filesystem::path(arguments.job).filename().string();
  if (!arguments.task.empty()) reading.task = job::task_from_name(arguments.task);
  const auto bytes = matterfit::read_file(arguments.job, std::uint64_t{64} << 20U);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const job::Farm farm =
      arguments.write.empty() ? job::Farm::kSlurm : job::farm_from_name(arguments.write);
  std::string folder = arguments.folder;
  if (folder.empty()) {
    const std::string name = std::filesystem::path(arguments.job).stem().string() + "_wedge";
    folder = (reading.base_folder / name).string();
  }
  const job::WedgeFolder made = job::write_wedge(text, reading, arguments.set, folder);
  if (!arguments.write.empty()) {
    const std::string tool = std::filesystem::read_symlink("/proc/self/exe").string();
    for (const auto& path : job::write_farm_files(made, farm, tool)) {
      std::printf("%s\n", path.c_str());
    }
    return 0;
  }
  capi::JobThread thread([&](matterfit::Interrupter& interrupter) {
    return capi::run_wedge(made, options, arguments.at_once, interrupter);
  });
  watch(arguments, thread);
  const capi::Outcome& outcome = thread.outcome();
  if (!outcome.error.empty()) std::fprintf(stderr, "matterfit: %s\n", outcome.error.c_str());
  if (!arguments.report.empty()) matterfit::write_file(arguments.report, outcome.result + "\n");
  const job::Json result = job::Json::parse(outcome.result, nullptr, false);
  if (arguments.json) {
    std::printf("%s\n", outcome.result.c_str());
  } else if (result.is_object() && result.contains("members")) {
    std::fputs(capi::wedge_table(result).c_str(), stdout);
  }
  return outcome.exit_status;
}

CLI::App* add_new_job(CLI::App& app, Arguments& arguments) {
  CLI::App* verb = app.add_subcommand(
      "new-job", "write a document for a recording: its body, what is to be fitted, a hold-out");
  job::NewJobOptions& fresh = arguments.fresh;
  verb->add_option("CAPTURE", fresh.capture, "tracks: .npz (with `faces` of its mesh), .c3d, …")
      ->required();
  verb->add_option("--output", fresh.output, "the document that is written")->required();
  verb->add_option("--ground", fresh.ground, "height of a floor [m]; without it there is none");
  verb->add_option("--friction", fresh.friction, "Coulomb coefficient of the floor");
  verb->add_option("--density", fresh.density, "of the body at rest [kg/m³]");
  verb->add_option("--noise", fresh.noise, "standard deviation of a coordinate [m]");
  verb->add_option("--gravity", fresh.gravity, "downward [m/s²]");
  verb->add_option("--law", arguments.law, "constitutive law that is fitted first");
  verb->add_option("--unit", fresh.unit, "metres per unit of the file");
  verb->add_option("--up", arguments.up, "axis that points up: x, y or z");
  verb->add_option("--particles", fresh.particles, "about as many fill the body");
  return verb;
}

CLI::App* add_pretrain(CLI::App& app, Arguments& arguments) {
  CLI::App* verb = app.add_subcommand(
      "pretrain", "make the neural law's start weights from a seed: LAW.safetensors each");
  job::PretrainOptions& pretrain = arguments.pretrain;
  verb->add_option("--output", pretrain.folder, "the folder they are written into")->required();
  verb->add_option("--law", pretrain.laws, "jelly, plasticine, sand, water; without it all");
  verb->add_option("--material", pretrain.materials,
                   "job documents or material files of classical laws, which it is made like");
  verb->add_option("--tests", pretrain.tests,
                   "tests of a testing machine, of a rubber (docs/formats.md)");
  verb->add_flag("--published", pretrain.published,
                 "the published law's two nets in place of the isotropic law's weights: "
                 "published_LAW.safetensors each");
  verb->add_flag("--latent", pretrain.latent,
                 "the latent law's decoder, latent.safetensors (about a minute)");
  verb->add_flag("--all", pretrain.all, "all that the library carries, side by side");
  verb->add_option("--threads", pretrain.threads, "how many; 0: all");
  verb->add_option("--seed", pretrain.seed, "of the samples");
  return verb;
}

CLI::App* add_like(CLI::App& app, Arguments& arguments) {
  CLI::App* verb = app.add_subcommand(
      "like", "say which classical law a neural one is nearest to, with its numbers");
  verb->add_option("FILE", arguments.job, "scene.json or material.json of a fit, or a job")
      ->required();
  verb->add_option("--strain", arguments.over.strain, "largest change of shape");
  verb->add_option("--compression", arguments.over.compression, "largest loss of volume, ln J");
  verb->add_option("--expansion", arguments.over.expansion, "largest gain of volume, ln J");
  verb->add_option("--slowest", arguments.over.slowest, "rate of shape [1/s]");
  verb->add_option("--fastest", arguments.over.fastest, "rate of shape [1/s]");
  verb->add_flag("--json", arguments.json, "print the result as JSON");
  return verb;
}

int like(const Arguments& arguments) {
  const job::Json likes = job::likes_of_file(arguments.job, arguments.over);
  if (arguments.json) {
    std::printf("%s\n", likes.dump(2, ' ', false, job::Json::error_handler_t::replace).c_str());
    return 0;
  }
  for (const auto& [name, one] : likes.items()) {
    std::printf("%s: %s\n", name.c_str(), one.at("sentence").get<std::string>().c_str());
  }
  return 0;
}

CLI::App* add_curves(CLI::App& app, Arguments& arguments) {
  CLI::App* verb = app.add_subcommand(
      "curves", "stress against stretch of a law: pulled along one axis, along two, sheared");
  verb->add_option("FILE", arguments.job,
                   "a job, scene.json or material.json of a fit, or weights (.safetensors, .pt)")
      ->required();
  verb->add_option("--strain", arguments.curves.strain, "largest change of shape");
  verb->add_option("--rate", arguments.curves.rate, "rate of shape [1/s]");
  verb->add_flag("--alone", arguments.alone, "without the nearest known law beside a neural one");
  verb->add_option("--picture", arguments.picture,
                   "SVG that is written; of several bodies FILE_BODY.svg each");
  verb->add_option("--report", arguments.report, "write the curves to this file too");
  verb->add_flag("--json", arguments.json, "print the curves as JSON");
  return verb;
}

int curves(Arguments& arguments) {
  arguments.curves.beside = !arguments.alone;
  const job::Json found = job::curves_of_file(arguments.job, arguments.curves);
  const std::string text = found.dump(2, ' ', false, job::Json::error_handler_t::replace) + "\n";
  if (!arguments.report.empty()) matterfit::write_file(arguments.report, text);
  if (arguments.json) std::fputs(text.c_str(), stdout);
  for (const auto& [name, one] : found.items()) {
    std::filesystem::path path = arguments.picture;
    if (!path.empty() && found.size() > 1) {
      path.replace_filename(path.stem().string() + "_" + name + path.extension().string());
    }
    if (!path.empty()) matterfit::write_file(path, job::curves_picture(name, one));
    if (!arguments.json) std::fputs(capi::curves_table(name, one).c_str(), stdout);
    for (const auto& fault : one.at("faults")) {
      std::fprintf(stderr, "matterfit: %s: %s\n", name.c_str(), fault.get<std::string>().c_str());
    }
  }
  return 0;
}

int new_job(Arguments& arguments) {
  arguments.fresh.law = matterfit::material::law_from_name(arguments.law);
  if (!arguments.up.empty()) {
    if (arguments.up.size() != 1 || arguments.up.find_first_of("xyz") == std::string::npos) {
      matterfit::throw_input("--up is '" + arguments.up + "', expected x, y or z.");
    }
    arguments.fresh.up = arguments.up.front();
  }
  for (const std::string& statement : job::write_new_job(arguments.fresh)) {
    std::fprintf(stderr, "%s\n", statement.c_str());
  }
  std::printf("%s\n", arguments.fresh.output.c_str());
  return 0;
}

/// CLI11 says no more of an unknown verb than that one is missing.
void check_verb(const CLI::App& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') return;
  std::vector<std::string> names;
  std::string list;
  for (const CLI::App* verb : app.get_subcommands(nullptr)) {
    names.push_back(verb->get_name());
    list += " " + names.back();
  }
  if (std::find(names.begin(), names.end(), argv[1]) != names.end()) return;
  const auto near = job::nearest(argv[1], names);
  matterfit::throw_input("there is no command '" + std::string(argv[1]) + "'." +
                         (near ? " Did you mean '" + *near + "'?" : " There are:" + list + "."));
}

std::string said_of(const CLI::ParseError& error) {
  const std::string text = error.what();
  if (error.get_name() == "ConversionError") {
    const std::size_t colon = text.find(": ");
    if (colon != std::string::npos) return text.substr(colon + 2) + " is not a number.";
  }
  if (text == "A subcommand is required") return "what is to be done is missing.";
  return text + ".";
}

int command(int argc, char** argv, Arguments& arguments) {
  CLI::App app(
      "Matterfit: simulates, fits materials to captures, compares, and bakes what Blender plays.",
      "matterfit");
  app.set_version_flag("--version", std::string(MATTERFIT_VERSION));
  app.require_subcommand(1);
  app.footer("Exit status: 0 done, 2 the input is wrong, 3 could not be completed, 130 cancelled.");
  std::vector<CLI::App*> verbs;
  const auto add = [&](const char* name, const char* what, const char* documents = kJobs) {
    verbs.push_back(app.add_subcommand(name, what));
    add_common(*verbs.back(), arguments, documents);
  };
  add("simulate", "write the states of every frame, and simulated.npz at the captures' points");
  add("fit",
      "identify materials from captures: fitted values with errors, material.json, scene.json");
  add("check",
      "before a fit: which values it will identify and how well, what is tied, what to record "
      "instead");
  add("diagnose",
      "fit to recordings, or to tests of a testing machine, then find what the simulation gets "
      "wrong, name the cause, measure the gain",
      kJobsOrTests);
  add("compare", "simulate if need be, and measure the error against the captures");
  add("bake", "simulate and write every cache under `output`");
  add("render", "draw the scene, or a file of splats, through the cameras of `render` into PNG");
  add("estimate", "memory and time that a job needs");
  add("validate", "check a document and print it as it was understood");
  CLI::App* fresh = add_new_job(app, arguments);
  CLI::App* many = add_wedge(app, arguments);
  CLI::App* train = add_pretrain(app, arguments);
  CLI::App* alike = add_like(app, arguments);
  CLI::App* drawn = add_curves(app, arguments);
  CLI::App* look = app.add_subcommand(
      "inspect", "what a folder of results holds, its files checked; what a recording is like");
  look->add_option("FOLDER", arguments.folder,
                   "a job's output folder, or a file: tracks, splats, or the cameras of images")
      ->required();
  look->add_option("--report", arguments.report, "write the result to this file too");
  look->add_flag("--json", arguments.json, "print the result as JSON");
  check_verb(app, argc, argv);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // help, version
    std::string verb = "matterfit";
    for (const CLI::App* given : app.get_subcommands()) verb += " " + given->get_name();
    matterfit::throw_input(said_of(error) + "\n" + verb + " --help lists what there is.");
  }
  if (look->parsed()) {
    return capi::inspect(arguments.folder, arguments.report, arguments.json);
  }
  if (fresh->parsed()) return new_job(arguments);
  if (many->parsed()) return wedge(arguments);
  if (alike->parsed()) return like(arguments);
  if (drawn->parsed()) return curves(arguments);
  if (train->parsed()) {
    std::printf("%s\n", job::write_start_laws(arguments.pretrain).dump(2).c_str());
    return 0;
  }
  for (const CLI::App* verb : verbs) {
    if (!verb->parsed()) continue;
    if (verb->get_name() == "validate") {
      const job::RunOptions options = run_options(arguments);
      const job::Job job = read(arguments, "validate");
      for (const std::string& said : job::validate_job(job, options, matterfit::Interrupter{})) {
        std::fprintf(stderr, "matterfit: %s\n", said.c_str());
      }
      std::fputs(job::write_job(job, job.base_folder).c_str(), stdout);
      return 0;
    }
    if (verb->get_name() == "estimate") {
      const job::Json json =
          job::estimate_job(read(arguments, "estimate"), run_options(arguments), true);
      std::fputs((json.dump(2) + "\n").c_str(), stdout);
      return 0;
    }
    if (verb->get_name() == "diagnose" && job::is_tests_file(arguments.job)) {
      return diagnose_tests(arguments);
    }
    return run(arguments, verb->get_name());
  }
  return matterfit::exit_status(ErrorKind::kInput);
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  // A file size limit or a closed pipe is an error to be named, not the end of the process.
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
  int status = 3;
  try {
    Arguments arguments;
    try {
      status = command(argc, argv, arguments);
    } catch (const Error& error) {
      status = fail(arguments, error.kind(), error.what());
    } catch (const std::exception& error) {
      status = fail(arguments, ErrorKind::kCompute, error.what());
    }
  } catch (...) {
    std::fputs("matterfit: out of memory.\n", stderr);  // while the error was being told
  }
  if (std::fflush(stdout) != 0 && status == 0) status = 3;
  return status;
}
