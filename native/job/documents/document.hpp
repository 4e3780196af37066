// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/vec.hpp"
#include "effects/effect_type.hpp"
#include "job/documents/json_reader.hpp"
#include "material/excitation.hpp"
#include "material/material.hpp"
#include "mpm/scene.hpp"
#include "shape/collider.hpp"
#include "shape/keyed.hpp"

/// The job document: one JSON text that describes a task completely (docs/formats.md). Frames are
/// scene frames, ranges half-open; paths are absolute after reading. Nothing below this room knows
/// it.
namespace matterfit::job {

inline constexpr std::string_view kSchema = "matterfit.job/1";

enum class Task { kSimulate, kFit, kDiagnose, kCompare, kBake, kRender, kCheck };
[[nodiscard]] std::string_view task_name(Task task);
/// Throws Error(kInput) that lists the names.
[[nodiscard]] Task task_from_name(std::string_view name);

/// A quantity keyed by scene frames (which may be fractional), ascending; one key: constant.
template <class Value>
struct ByFrame {
  std::vector<double> frames;
  std::vector<Value> values;
  bool step = false;

  ByFrame() = default;
  explicit ByFrame(Value value) : frames{0.0}, values{std::move(value)} {}
  /// The same in seconds after `first_frame`.
  [[nodiscard]] shape::Keyed<Value> in_seconds(int first_frame, double fps) const {
    shape::Keyed<Value> keyed;
    keyed.values = values;
    keyed.step = step;
    for (const double frame : frames) {
      keyed.times.push_back(frames.size() == 1 ? 0.0 : (frame - first_frame) / fps);
    }
    return keyed;
  }
};

struct Placement {
  Vec3d position = Vec3d::Zero();
  Quatd rotation = Quatd::Identity();
  double scale = 1.0;
  [[nodiscard]] Vec3d apply(const Vec3d& x) const { return rotation * (scale * x) + position; }
};

struct Source {
  enum class Kind { kPoints, kMesh, kCage, kGaussians, kBox, kSphere, kCylinder };
  enum class Sampling { kAuto, kLattice, kJitter };
  Kind kind = Kind::kBox;
  std::filesystem::path file;      ///< points, mesh, cage, gaussians
  int level = 3;                   ///< cage: subdivision level of the limit surface
  bool fill_inside = true;         ///< gaussians
  double opacity_threshold = 0.1;  ///< gaussians: fainter ones are left out
  /// gaussians: those whose centres lie outside are left out, in the file's own frame
  std::optional<Eigen::AlignedBox3d> crop;
  Vec3d low = Vec3d::Zero();     ///< box
  Vec3d high = Vec3d::Zero();    ///< box
  Vec3d center = Vec3d::Zero();  ///< sphere, cylinder
  double radius = 0.0;           ///< sphere, cylinder
  double height = 0.0;           ///< cylinder
  Vec3d axis = Vec3d::UnitZ();   ///< cylinder
  Sampling sampling = Sampling::kAuto;
  std::optional<Vec3d> anchor;         ///< a point that lattice cell faces go through, source frame
  Quatd rotation = Quatd::Identity();  ///< of the lattice's axes, source frame
};

/// A region of the body where it starts (world space).
struct Region {
  enum class Shape { kAll, kPlane, kBox, kSphere, kPoints };
  Shape shape = Shape::kAll;
  Vec3d point = Vec3d::Zero();    ///< plane; centre of a sphere
  Vec3d normal = Vec3d::UnitZ();  ///< plane: what lies on it or behind it
  Vec3d low = Vec3d::Zero();
  Vec3d high = Vec3d::Zero();
  double radius = 0.0;
  std::filesystem::path file;  ///< points
};

struct PinDoc {
  Region region;
  ByFrame<shape::Pose> motion = ByFrame<shape::Pose>(shape::Pose{});
  Vec3d pivot = Vec3d::Zero();
  std::optional<double> release;  ///< scene frame
};

struct MassDoc {
  Vec3d position = Vec3d::Zero();
  double mass = 0.0;             ///< [kg]
  std::optional<double> attach;  ///< scene frame
};

struct BodyDoc {
  std::string name;
  Source source;
  double density = 1000.0;
  material::Material material;
  mpm::Formulation formulation = mpm::Formulation::kAuto;
  Vec3d velocity = Vec3d::Zero();
  Vec3d spin = Vec3d::Zero();
  Placement placement;
  std::vector<PinDoc> pins;
  std::vector<MassDoc> masses;
  std::uint64_t seed = 0;
  /// What the recordings showed that its material was fitted to; none: it was not, or is not known.
  std::optional<material::Excitation> excited;
};

struct ColliderDoc {
  enum class Shape { kGround, kPlane, kSphere, kBox, kCapsule, kMesh, kMeshes };
  std::string name;
  Shape shape = Shape::kGround;
  double height = 0.0;                       ///< ground
  Vec3d point = Vec3d::Zero();               ///< plane
  Vec3d normal = Vec3d::UnitZ();             ///< plane
  double radius = 0.0;                       ///< sphere, capsule
  double half_length = 0.0;                  ///< capsule
  Vec3d half_extents = Vec3d::Zero();        ///< box
  std::vector<std::filesystem::path> files;  ///< mesh (one), meshes (one a frame)
  double first_frame = 0.0;                  ///< meshes
  double voxel_size = 0.0;                   ///< mesh; 0: chosen from dx
  ByFrame<shape::Pose> transform = ByFrame<shape::Pose>(shape::Pose{});
  shape::Contact contact;
};

struct SolverDoc {
  double cfl = 0.4;
  double dt = 0.0;
  double dt_safety = 0.8;
  double memory_limit_gb = 8.0;
  Vec3d grid_shift = Vec3d::Zero();
};

/// An effect of the catalogue (effects/catalogue.hpp).
struct EffectDoc {
  const effects::EffectType* type = nullptr;
  std::string name;
  std::string body;                                  ///< empty: all
  std::vector<ByFrame<std::vector<double>>> values;  ///< one a parameter, of its size
};

struct SceneDoc {
  double fps = 24.0;
  std::array<int, 2> fps_ratio{24, 1};  ///< {0, 0} where fps was given as a number with a fraction
  int first_frame = 0;
  int end_frame = 1;
  ByFrame<Vec3d> gravity = ByFrame<Vec3d>(Vec3d(0, 0, -9.81));
  double particle_separation = 0.01;
  std::string quality;
  std::vector<BodyDoc> bodies;
  std::vector<ColliderDoc> colliders;
  std::vector<mpm::BodyContact> contacts;
  std::optional<mpm::Walls> walls;
  std::vector<EffectDoc> effects;
  SolverDoc solver;

  [[nodiscard]] double seconds(double frame) const { return (frame - first_frame) / fps; }
  [[nodiscard]] int frames() const { return end_frame - first_frame; }
};

/// Fits the rigid transform from the capture's frame to the model from quiet frames.
struct AlignDoc {
  std::vector<std::string> markers;
  Points positions;  ///< of those markers on the model [m]
  int begin = 0;     ///< scene frames [begin, end)
  int end = 0;
};

/// What a fit must not see.
struct HoldoutDoc {
  std::optional<std::array<int, 2>> frames;  ///< scene frames [a, b)
  std::vector<std::string> tracks;           ///< names or indices of points
  bool capture = false;                      ///< all of it
};

/// Two tracks that go on as each other from a sample of the recording on.
struct SwapDoc {
  std::size_t sample = 0;  ///< counted from 0
  std::array<std::string, 2> tracks;
};

// NOLINTNEXTLINE(bugprone-exception-escape): of the JSON library's moves it cannot tell
struct CaptureDoc {
  std::string path;            ///< in the document: "captures[2]"
  std::size_t place = 0;       ///< in the document's list, where captures by images stand too
  std::string name;            ///< by default the file's name without its ending
  std::filesystem::path file;  ///< or a pattern of numbered files (capture/tracks.hpp)
  std::string body;
  double unit = 0.0;  ///< metres per unit of the file; 0: what the file says, else metres
  char up = 0;        ///< as capture::TracksOptions has it
  std::array<double, 16> transform{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};  ///< rows
  double fps = 0.0;                       ///< of files without times; 0: the scene's
  std::vector<std::string> markers;       ///< those that are used; empty: all
  std::optional<double> start_frame;      ///< scene frame of the capture's time 0
  Json scene_overrides;                   ///< of this capture's own run; null: none
  std::shared_ptr<const SceneDoc> scene;  ///< the scene with them; null: the document's
  std::optional<double> noise;
  HoldoutDoc holdout;
  Points positions;  ///< rest positions of the points on the body; empty: from the capture
  std::optional<AlignDoc> align;
  std::vector<SwapDoc> swaps;
  std::optional<Vec3d> front;     ///< unit: the one point is how far the body reaches that way
  std::optional<double> release;  ///< scene frame after which the motion starts
};

/// Part of a body whose mean motion is recorded.
struct ProbeDoc {
  std::string name;
  std::string body;
  Region region;
};

struct MeshOutput {
  std::string name;
  std::filesystem::path file;
  bool cage = false;
  int level = 2;
  std::string body;
  Placement transform;  ///< from the mesh's object space, in which PC2 is written, to the world
};

struct SplatOutput {
  std::string name;
  std::filesystem::path file;
  std::string body;
  std::optional<Eigen::AlignedBox3d> crop;  ///< as Source::crop
  double opacity_threshold = 0.0;           ///< what is less opaque is left out; 0: nothing
  bool dot_splat = false;                   ///< frames are .splat files, else .ply
};

struct OutputDoc {
  std::filesystem::path folder;
  bool density = false;
  bool velocity = false;
  bool surface = false;
  double voxel_size = 0.0;  ///< 0: the particle separation
  bool points = false;
  std::vector<MeshOutput> mesh;
  std::vector<SplatOutput> splats;
  std::vector<std::string> attributes;
  bool overlays = false;  ///< of a comparison with images
  bool bake = false;      ///< a comparison bakes too
  std::string report = "report.json";
  int checkpoint_frames = 10;        ///< a checkpoint after this many frames …
  double checkpoint_seconds = 30.0;  ///< … or this many seconds, whichever comes first
};

struct FitDoc;  // job/documents/fit_document.hpp

struct Job {
  Task task = Task::kSimulate;
  SceneDoc scene;
  std::vector<CaptureDoc> captures;
  std::vector<ProbeDoc> probes;
  OutputDoc output;
  std::shared_ptr<const FitDoc> fit;  ///< null: none
  Json diagnose;                      ///< as given; read by the diagnosis
  Json document;  ///< the whole document after migration and overrides, paths as given
  std::filesystem::path base_folder;

  /// Whether it writes the caches that `output` names.
  [[nodiscard]] bool bakes() const {
    return task == Task::kBake || (task == Task::kCompare && output.bake);
  }
};

struct ReadOptions {
  std::filesystem::path base_folder;   ///< relative paths start here
  std::string name = "job";            ///< stands before messages about the text itself
  std::vector<std::string> overrides;  ///< "path=value", in order (job/documents/override.hpp)
  std::optional<Task> task;            ///< in place of the document's
};

/// Reads, migrates, overrides and validates. Files are not opened. Throws Error(kInput) with the
/// JSON path of the culprit.
[[nodiscard]] Job read_job(std::string_view text, const ReadOptions& options);
/// The same from a file; its folder becomes the base folder.
[[nodiscard]] Job read_job_file(const std::filesystem::path& path, ReadOptions options = {});

/// The document back as text, its paths rewritten relative to `folder` (absolute where `folder` is
/// empty), so that it can be written there and read again.
[[nodiscard]] std::string write_job(const Job& job, const std::filesystem::path& folder);

/// Brings an older schema to the present one in place; throws Error(kInput) for a schema that is
/// not known, naming the ones that are. Called by read_job before anything else is looked at.
void migrate(Json& document);

[[nodiscard]] const BodyDoc& body_named(const SceneDoc& scene, const std::string& name);

}  // namespace matterfit::job
