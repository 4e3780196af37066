// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/state_file.hpp"

#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "base/error.hpp"
#include "base/file.hpp"
#include "job/documents/safetensors.hpp"

namespace matterfit::job {
namespace {

static_assert(sizeof(Vec3f) == 12 && sizeof(Mat3f) == 36);

Tensor vectors(const std::vector<Vec3f>& values) {
  Tensor tensor{{values.size(), 3}, std::vector<float>(3 * values.size())};
  if (!values.empty()) std::memcpy(tensor.values.data(), values.data(), 12 * values.size());
  return tensor;
}

std::vector<Vec3f> vectors(const Tensor& tensor) {
  std::vector<Vec3f> values(tensor.values.size() / 3);
  if (!values.empty()) {
    std::memcpy(static_cast<void*>(values.data()), tensor.values.data(), 12 * values.size());
  }
  return values;
}

/// Column-major in memory, row by row in the file (NumPy's order), and back.
std::vector<float> transposed(const float* matrices, std::size_t count) {
  std::vector<float> out(9 * count);
  for (std::size_t p = 0; p < count; ++p) {
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) out[9 * p + 3 * i + j] = matrices[9 * p + 3 * j + i];
    }
  }
  return out;
}

}  // namespace

std::string frame_digits(int frame) {
  char text[16];
  std::snprintf(text, sizeof text, "%04d", frame);
  return text;
}

std::string state_path(int frame) { return "state/state_" + frame_digits(frame) + ".safetensors"; }

std::string format_state(const mpm::Scene& scene, const mpm::FrameState& state) {
  Tensors out;
  char time[40];
  std::snprintf(time, sizeof time, "%.17g", state.time);
  out.metadata = {{"format", "matterfit.state/1"},
                  {"frame", std::to_string(state.frame)},
                  {"time_s", time},
                  {"units", "m, s"}};
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const mpm::BodyState& body = state.bodies[b];
    const std::string name = scene.bodies[b].name + ".";
    out.tensors[name + "positions"] = vectors(body.positions);
    out.tensors[name + "velocities"] = vectors(body.velocities);
    const std::size_t count = body.deformation_gradients.size();
    const auto* matrices = reinterpret_cast<const float*>(body.deformation_gradients.data());
    out.tensors[name + "deformation_gradients"] = {{count, 3, 3}, transposed(matrices, count)};
    if (!body.plastic_strain.empty()) {
      out.tensors[name + "plastic_strain"] = {{body.plastic_strain.size()}, body.plastic_strain};
    }
  }
  return format_safetensors(out);
}

mpm::FrameState read_state(const std::filesystem::path& path, const mpm::Scene& scene) {
  const std::string name = path.string();
  const Tensors tensors = parse_safetensors(read_file(path), name);
  const auto metadata = [&](const char* key) {
    const auto found = tensors.metadata.find(key);
    if (found == tensors.metadata.end()) {
      throw_input(name + ": no '" + key + "' in its metadata; it is no state of ours.");
    }
    return found->second;
  };
  if (metadata("format") != "matterfit.state/1") {
    throw_input(name + ": format '" + metadata("format") + "' is not matterfit.state/1.");
  }
  mpm::FrameState state;
  state.frame = std::atoi(metadata("frame").c_str());
  state.time = std::atof(metadata("time_s").c_str());
  for (const mpm::Body& body : scene.bodies) {
    const std::size_t count = body.rest.size();
    const auto tensor = [&](const char* what,
                            const std::vector<std::size_t>& shape) -> const Tensor& {
      const auto found = tensors.tensors.find(body.name + "." + what);
      if (found == tensors.tensors.end() || found->second.shape != shape) {
        throw_input(name + ": '" + body.name + "." + what +
                    "' is missing or has another shape than " + std::to_string(count) +
                    " particles need. It belongs to another scene; run with "
                    "--restart.");
      }
      return found->second;
    };
    mpm::BodyState read;
    read.positions = vectors(tensor("positions", {count, 3}));
    read.velocities = vectors(tensor("velocities", {count, 3}));
    const Tensor& matrices = tensor("deformation_gradients", {count, 3, 3});
    read.deformation_gradients.resize(count);
    const auto values = transposed(matrices.values.data(), count);
    std::memcpy(static_cast<void*>(read.deformation_gradients.data()), values.data(), 36 * count);
    if (tensors.tensors.count(body.name + ".plastic_strain") > 0) {
      read.plastic_strain = tensor("plastic_strain", {count}).values;
    }
    state.bodies.push_back(std::move(read));
  }
  return state;
}

}  // namespace matterfit::job
