// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/bake_outputs.hpp"

#include <algorithm>
#include <cstdio>

#include "bake/attributes.hpp"
#include "bake/pc2.hpp"
#include "bake/splat.hpp"
#include "bake/subdivision.hpp"
#include "bake/volume.hpp"
#include "base/error.hpp"
#include "capture/binding.hpp"
#include "capture/carried_splats.hpp"
#include "capture/mesh.hpp"
#include "job/run/own_splats.hpp"
#include "job/run/state_file.hpp"

namespace matterfit::job {
namespace {

std::size_t index_of(const mpm::Scene& scene, const std::string& name) {
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    if (scene.bodies[b].name == name) return b;
  }
  throw_input("there is no body '" + name + "' in the scene.");
}

capture::BindingOptions binding_options(const mpm::Body& body, const Interrupter& interrupter) {
  capture::BindingOptions options;
  options.interrupter = &interrupter;
  options.gradient = capture::binding_gradient(body);
  return options;
}

std::string attribute_path(const mpm::Body& body, const std::string& attribute, int frame) {
  return "attributes/" + body.name + "_" + attribute + "_" + frame_digits(frame) + ".exr";
}

Eigen::Affine3d object_to_world(const Placement& placement) {
  Eigen::Affine3d transform = Eigen::Affine3d::Identity();
  transform.linear() = placement.scale * placement.rotation.toRotationMatrix();
  transform.translation() = placement.position;
  return transform;
}

}  // namespace

std::string splat_path(const SplatOutput& splats, int frame) {
  return "splat/" + splats.name + "_" + frame_digits(frame) +
         (splats.dot_splat ? ".splat" : ".ply");
}

/// A PC2 under way.
struct BakeOutputs::Sequence {
  std::string path;  ///< relative to the folder
  std::size_t points = 0;
  std::optional<bake::Pc2Writer> writer;
};

struct BakeOutputs::BoundMesh {
  std::size_t body = 0;
  Eigen::Affine3d to_world;
  std::optional<capture::MeshBinding> mesh;
  std::optional<bake::CageBinding> cage;  ///< one of the two

  [[nodiscard]] std::vector<Vec3d> positions(const capture::ParticleView& state,
                                             Arena& arena) const {
    return mesh ? mesh->positions(state, arena) : cage->cage_positions(state, arena);
  }
};

struct BakeOutputs::BoundSplats {
  std::size_t body = 0;
  const SplatOutput& doc;  ///< of the job, borrowed
  capture::CarriedSplats splats;
};

BakeOutputs::~BakeOutputs() = default;

BakeOutputs::BakeOutputs(const Job& job, const mpm::Scene& scene, Arena& arena,
                         const Interrupter& interrupter)
    : job_(job),
      scene_(scene),
      arena_(arena),
      interrupter_(interrupter),
      separation_(0.5 * scene.dx) {
  // Point clouds first, then meshes: bake() gives them in this order.
  if (job.output.points) {
    for (const mpm::Body& body : scene.bodies) {
      sequences_.push_back(std::make_unique<Sequence>());
      sequences_.back()->path = "points/" + body.name + ".pc2";
      sequences_.back()->points = body.rest.size();
    }
  }
  for (std::size_t i = 0; i < job.output.mesh.size(); ++i) add_mesh(i);
  for (std::size_t i = 0; i < job.output.splats.size(); ++i) add_splats(i);
}

void BakeOutputs::note_distance(const std::string& path, const std::string& body, double distance,
                                std::size_t count) {
  char text[120];
  std::snprintf(
      text, sizeof text,
      "%zu or more points lie farther than two particle separations (up to %.3g m) from '", count,
      distance);
  notes_.push_back(path + ": " + text + body + "'; do they belong together?");
}

void BakeOutputs::add_mesh(std::size_t index) {
  const MeshOutput& doc = job_.output.mesh[index];
  const std::string path = "output.mesh[" + std::to_string(index) + "]";
  try {
    capture::Mesh mesh = capture::read_mesh(doc.file);
    auto bound = std::make_unique<BoundMesh>();
    bound->to_world = object_to_world(doc.transform);
    Points points;
    points.reserve(mesh.vertices.size());
    for (Vec3f& x : mesh.vertices) {
      points.emplace_back(bound->to_world * x.cast<double>());
      x = points.back().cast<float>();
    }
    bound->body = index_of(scene_, doc.body);
    const mpm::Body& body = scene_.bodies[bound->body];
    if (doc.cage) {
      bake::CageOptions options;
      options.binding = binding_options(body, interrupter_);
      bound->cage.emplace(mesh, body.rest, separation_, options, arena_);
      const auto farthest = bound->cage->farthest();
      if (farthest.distance > 2.0 * separation_) {
        note_distance(path, doc.body, farthest.distance, 1);
      }
    } else {
      bound->mesh.emplace(points, body.rest, separation_, binding_options(body, interrupter_),
                          arena_);
      const std::size_t far = bound->mesh->count_beyond(2.0 * separation_);
      if (far > 0) note_distance(path, doc.body, bound->mesh->farthest().distance, far);
    }
    meshes_.push_back(std::move(bound));
    sequences_.push_back(std::make_unique<Sequence>());
    sequences_.back()->path = "mesh/" + doc.name + ".pc2";
    sequences_.back()->points = points.size();
  } catch (const Error& error) {
    throw Error(error.kind(), path + ": " + error.what());
  }
}

void BakeOutputs::add_splats(std::size_t index) {
  const SplatOutput& doc = job_.output.splats[index];
  const std::string path = "output.splats[" + std::to_string(index) + "]";
  try {
    const std::size_t body = index_of(scene_, doc.body);
    capture::CarriedSplats splats(placed_splats(doc, body_named(job_.scene, doc.body).placement),
                                  scene_.bodies[body], separation_, arena_, &interrupter_);
    const std::size_t far = splats.binding().count_beyond(2.0 * separation_);
    if (far > 0) note_distance(path, doc.body, splats.binding().farthest().distance, far);
    splats_.push_back(std::make_unique<BoundSplats>(BoundSplats{body, doc, std::move(splats)}));
  } catch (const Error& error) {
    throw Error(error.kind(), path + ": " + error.what());
  }
}

std::vector<std::string> BakeOutputs::sequence_files() const {
  std::vector<std::string> paths;
  for (const auto& sequence : sequences_) paths.push_back(sequence->path);
  return paths;
}

std::vector<std::string> BakeOutputs::grids() const {
  std::vector<std::string> names;
  if (job_.output.density) names.emplace_back("density");
  if (job_.output.velocity) names.emplace_back("velocity");
  if (job_.output.surface) names.emplace_back("surface");
  return names;
}

std::vector<std::string> BakeOutputs::frame_files(int frame) const {
  const std::string digits = frame_digits(frame);
  std::vector<std::string> paths;
  if (!grids().empty()) {
    for (const mpm::Body& body : scene_.bodies) {
      paths.push_back("volume/" + body.name + "_" + digits + ".vdb");
    }
  }
  for (const mpm::Body& body : scene_.bodies) {
    for (const std::string& name : job_.output.attributes) {
      paths.push_back(attribute_path(body, name, frame));
    }
  }
  for (const auto& splats : splats_) paths.push_back(splat_path(splats->doc, frame));
  return paths;
}

void BakeOutputs::start(std::size_t frames) {
  complete_ = frames == kAllFrames;
  if (complete_) return;
  for (const auto& sequence : sequences_) {
    bake::Pc2Writer::Options options;
    options.points = sequence->points;
    options.start_frame = static_cast<float>(scene_.first_frame);
    const std::filesystem::path path = job_.output.folder / sequence->path;
    if (frames > 0) {
      try {
        sequence->writer.emplace(bake::Pc2Writer::resume(path, options, frames));
        continue;
      } catch (const Error&) {
        // Nothing usable was left: the frames are read again from the states.
        sequence->writer.reset();
      }
    }
    sequence->writer.emplace(path, options);
  }
}

bool BakeOutputs::needs(std::size_t index) const {
  return !complete_ && std::any_of(sequences_.begin(), sequences_.end(), [&](const auto& sequence) {
    return sequence->writer->frames() <= index;
  });
}

void BakeOutputs::bake(const mpm::FrameState& state, std::size_t index, bool frame_files) {
  const auto view = [&](std::size_t body) {
    return capture::particle_view(scene_.bodies[body], state.bodies[body], separation_);
  };
  if (!complete_) {
    std::size_t s = 0;
    if (job_.output.points) {
      for (std::size_t b = 0; b < scene_.bodies.size(); ++b, ++s) {
        if (sequences_[s]->writer->frames() == index) {
          sequences_[s]->writer->append(state.bodies[b].positions);
        }
      }
    }
    for (const auto& mesh : meshes_) {
      bake::Pc2Writer& writer = *sequences_[s++]->writer;
      if (writer.frames() != index) continue;
      const std::vector<Vec3d> world = mesh->positions(view(mesh->body), arena_);
      writer.append(capture::to_local(world, mesh->to_world));
    }
  }
  if (!frame_files) return;
  bake_volume(state);
  bake_attributes(state);
  for (const auto& splats : splats_) {
    const std::string path = splat_path(splats->doc, state.frame);
    bake::write_splat_frame(job_.output.folder / path, splats->splats.rest(),
                            splats->splats.binding(), view(splats->body), {}, arena_);
  }
}

void BakeOutputs::bake_volume(const mpm::FrameState& state) {
  if (grids().empty()) return;
  bake::VolumeOptions options;
  options.density = job_.output.density;
  options.velocity = job_.output.velocity;
  options.surface = job_.output.surface;
  options.voxel_size = job_.output.voxel_size;
  const std::string digits = frame_digits(state.frame);
  for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
    const capture::ParticleView view =
        capture::particle_view(scene_.bodies[b], state.bodies[b], separation_);
    options.flows = scene_.bodies[b].material.traits().wets;
    bake::write_volume(
        job_.output.folder / ("volume/" + scene_.bodies[b].name + "_" + digits + ".vdb"),
        std::span(&view, 1), options, arena_, interrupter_);
  }
}

void BakeOutputs::bake_attributes(const mpm::FrameState& state) {
  for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
    const mpm::Body& body = scene_.bodies[b];
    const capture::ParticleView view = capture::particle_view(body, state.bodies[b], separation_);
    const bake::TextureLayout layout = bake::texture_layout(view.size());
    for (const std::string& name : job_.output.attributes) {
      interrupter_.check();
      const auto values = bake::attribute_values(view, state.bodies[b].plastic_strain,
                                                 bake::attribute_from_name(name), arena_);
      bake::write_attribute_texture(job_.output.folder / attribute_path(body, name, state.frame),
                                    layout, values);
    }
  }
}

void BakeOutputs::flush() {
  for (const auto& sequence : sequences_) {
    if (sequence->writer) sequence->writer->flush();
  }
}

void BakeOutputs::finish() {
  if (complete_) return;
  for (const auto& sequence : sequences_) sequence->writer->finish();
}

}  // namespace matterfit::job
