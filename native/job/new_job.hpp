// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "material/law_table.hpp"

namespace matterfit::job {

/// What is known of a recording beside its file.
struct NewJobOptions {
  std::filesystem::path capture;  ///< tracks: .npz, .c3d, .pc2, .ply (capture/tracks.hpp)
  std::filesystem::path output;   ///< the document that is written
  std::optional<double> ground;   ///< height of a floor [m]; none: no floor
  double friction = 0.4;          ///< Coulomb coefficient of the floor
  double density = 1000.0;        ///< of the body at rest [kg/m³]
  std::optional<double> noise;    ///< standard deviation of a coordinate [m]; else the file's
  std::optional<double> gravity;  ///< downward [m/s²]; none: 9.81
  material::Law law = material::Law::kFixedCorotated;
  double unit = 0.0;              ///< metres per unit of the file; 0: what it says
  char up = 0;                    ///< 'x', 'y' or 'z'; 0: what the file says
  std::size_t particles = 4'000;  ///< about as many fill the body: seconds a run, minutes a fit
};

/// Writes a job document (docs/formats.md) of which a fit or a diagnosis can begin with nothing
/// else: the body of the mesh whose vertices the recording follows (`faces` of a .npz, or
/// `face_sizes` and `face_vertices`), else of the closed hull of its first frame; throw, spin and
/// the law's numbers to be fitted, the last quarter of the frames held out. The body's shape lies
/// beside the document as NAME_body.ply or NAME_body.npz. A point that the first frame does not
/// show is put where the first frame that shows it has it, taken back by that frame's rigid motion.
/// The scene's first frame is the recording's first sample, whatever its clock says then
/// (`start_frame` of the capture), since the body is where that sample shows it. Returns sentences
/// for people about what is odd. Throws Error(kInput) naming the file for a recording of fewer than
/// four frames or points.
std::vector<std::string> write_new_job(const NewJobOptions& options);

}  // namespace matterfit::job
