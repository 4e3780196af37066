// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "job/documents/document.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {

/// Where a frame of thrown splats lies in the output folder: `splat/NAME_0012.ply`.
[[nodiscard]] std::string splat_path(const SplatOutput& splats, int frame);

/// The caches of a job's `output`: written frame by frame from states, so a state on disk bakes to
/// the same bytes as one in memory.
class BakeOutputs {
 public:
  static constexpr std::size_t kAllFrames = std::numeric_limits<std::size_t>::max();

  /// Reads the render meshes and splats and binds them. Throws Error(kInput) with the JSON path.
  BakeOutputs(const Job& job, const mpm::Scene& scene, Arena& arena,
              const Interrupter& interrupter);
  ~BakeOutputs();
  BakeOutputs(const BakeOutputs&) = delete;
  BakeOutputs& operator=(const BakeOutputs&) = delete;

  /// Paths, relative to the folder, of the files of one frame.
  [[nodiscard]] std::vector<std::string> frame_files(int frame) const;
  /// Paths of the files that hold all frames (PC2).
  [[nodiscard]] std::vector<std::string> sequence_files() const;
  /// Names of the grids in the volume files.
  [[nodiscard]] std::vector<std::string> grids() const;

  /// Opens the sequences: their first `frames` frames are taken from what an unfinished bake left,
  /// as far as it is there; with kAllFrames they are complete.
  void start(std::size_t frames);
  /// True if some sequence lacks frame `index` (0: the scene's first).
  [[nodiscard]] bool needs(std::size_t index) const;
  /// Adds frame `index` to the sequences that lack it, and writes the frame's own files.
  void bake(const mpm::FrameState& state, std::size_t index, bool frame_files);
  /// What the sequences have so far survives a crash.
  void flush();
  /// Ends the sequences: they get their final names.
  void finish();
  /// Things the artist should know ("12 vertices lie far off the body").
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }

 private:
  struct Sequence;
  struct BoundMesh;
  struct BoundSplats;

  void bake_volume(const mpm::FrameState& state);
  void bake_attributes(const mpm::FrameState& state);
  void add_mesh(std::size_t index);
  void add_splats(std::size_t index);
  void note_distance(const std::string& path, const std::string& body, double distance,
                     std::size_t count);

  const Job& job_;
  const mpm::Scene& scene_;
  Arena& arena_;
  const Interrupter& interrupter_;
  double separation_;
  std::vector<std::unique_ptr<Sequence>> sequences_;
  std::vector<std::unique_ptr<BoundMesh>> meshes_;
  std::vector<std::unique_ptr<BoundSplats>> splats_;
  std::vector<std::string> notes_;
  bool complete_ = false;
};

}  // namespace matterfit::job
