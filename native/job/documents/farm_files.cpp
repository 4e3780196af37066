// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/farm_files.hpp"

#include "base/error.hpp"
#include "base/file.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

/// A word of a shell script that stands for exactly this text.
std::string quoted(const std::string& text) {
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? "'\\''" : std::string(1, c);
  return word + "'";
}

std::string slurm_script(const WedgeFolder& wedge, const std::string& tool) {
  const std::string name = wedge.folder.filename().string();
  std::string text =
      "#!/bin/bash\n"
      "# Each task of this array computes one member of the wedge. Submit it with: sbatch "
      "slurm.sh\n"
      "# What is finished is skipped, so the whole array may be submitted again.\n"
      "#SBATCH --job-name=" +
      (name.find(' ') == std::string::npos ? name : "matterfit") + "\n" + "#SBATCH --array=0-" +
      std::to_string(wedge.wedge.members.size() - 1) + "\n" +
      "#SBATCH --cpus-per-task=1\n"
      "#SBATCH --output=slurm_%a.log\n"
      "folder=" +
      quoted(wedge.folder.string()) + "\n" + "tool=${MATTERFIT:-" + quoted(tool) + "}\n" +
      "members=(\n";
  for (const WedgeMember& member : wedge.wedge.members) text += "  " + quoted(member.name) + "\n";
  text +=
      ")\n"
      "member=${members[${SLURM_ARRAY_TASK_ID:-${1:?give the number of a member}}]}\n"
      "exec \"$tool\" " +
      std::string(task_name(wedge.task)) +
      " \"$folder/$member/job.json\" --threads \"${SLURM_CPUS_PER_TASK:-0}\"\n";
  return text;
}

constexpr std::string_view kFlamencoJobType =
    R"(// Flamenco 3 job type: one task for each member of a Matterfit wedge.
// Put this file into the folder "scripts" beside the Manager, and start the Manager again.

const JOB_TYPE = {
    label: "Matterfit Wedge",
    settings: [
        { key: "tool", type: "string", required: true,
          description: "The matterfit program on the workers" },
        { key: "task", type: "string", required: true,
          description: "What is done with each document: bake, simulate, compare, fit" },
        { key: "folder", type: "string", required: true,
          description: "The wedge's folder on the workers" },
        { key: "members", type: "string", required: true,
          description: "Names of the members' folders, as a JSON list" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    for (const member of JSON.parse(settings.members)) {
        const task = author.Task(member, "misc");
        task.addCommand(author.Command("exec", {
            exe: settings.tool,
            args: [settings.task, settings.folder + "/" + member + "/job.json"],
        }));
        job.addTask(task);
    }
}
)";

Json flamenco_job(const WedgeFolder& wedge, const std::string& tool) {
  Json members = Json::array();
  for (const WedgeMember& member : wedge.wedge.members) members.push_back(member.name);
  return {{"name", "Matterfit " + wedge.folder.filename().string()},
          {"type", "matterfit-wedge"},
          {"priority", 50},
          {"submitter_platform", "linux"},
          {"settings",
           {{"tool", tool},
            {"task", task_name(wedge.task)},
            {"folder", wedge.folder.string()},
            {"members", members.dump()}}}};
}

}  // namespace

Farm farm_from_name(const std::string& name) {
  if (name == "slurm") return Farm::kSlurm;
  if (name == "flamenco") return Farm::kFlamenco;
  throw_input("--write " + name + ": expected slurm or flamenco.");
}

std::vector<fs::path> write_farm_files(const WedgeFolder& wedge, Farm farm,
                                       const std::string& tool) {
  std::vector<fs::path> paths;
  const auto write = [&](const char* name, std::string_view text) {
    paths.push_back(wedge.folder / name);
    write_file(paths.back(), text);
  };
  if (farm == Farm::kSlurm) {
    write("slurm.sh", slurm_script(wedge, tool));
  } else {
    write("flamenco.json", flamenco_job(wedge, tool).dump(2) + "\n");
    write("matterfit_wedge.js", kFlamencoJobType);
  }
  return paths;
}

}  // namespace matterfit::job
