// Simulated blocks with known truth: one options-driven generator behind all pipeline tests and `megablock simulate`.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "io/simulate/scene/simulated_block.h"
#include "io/simulate/scene/simulation_options.h"

namespace megablock {

SimulatedBlock simulate_block(const SimulationOptions& options);

// The same block, its tracks handed over in batches in the order of their indices. The memory is that of one batch and
// of the frames and images.
inline constexpr std::int64_t kTrackBatch = 1 << 20;  // observations
SimulatedBlock simulate_block(const SimulationOptions& options, const TrackSink& sink,
                              std::int64_t batch_observations = kTrackBatch);

// What becomes of a block.yaml that is in the folder and differs from what would be written.
enum class EditedProject { kRefuse, kOverwrite };

// Renders the images of a small block (textured terrain and boxes, ray cast, Brown distortion) as JPEG with EXIF GPS
// into folder/images, and writes the project files around them:
//   folder/block.yaml, folder/truth.csv and truth.h5 (poses of the frames), folder/control.csv (control and check
//   points, with roles and sigmas), folder/gcp_list.txt (the control points for other programs), folder/poses.csv (the
//   given poses; block.yaml does not use them), folder/rig_cameras.json and rig_assignments.json (street: the rig,
//   held), folder/truth_masks/<camera>.png (vehicle: where it is in the pictures; block.yaml does not use them)
// Attitude priors and relative poses have no place in these files and are not written.
void write_rendered_block(const SimulationOptions& options, const std::string& folder,
                          EditedProject edited = EditedProject::kRefuse);
// The tie-point level, streamed to the files: folder/block.yaml (with `tie_points: tie_points.h5`, `block: given.h5`),
// truth.csv, truth.h5 (poses, cameras), truth_tracks.h5 (points, wrong observations).
void write_simulated_block(const SimulationOptions& options, const std::string& folder,
                           EditedProject edited = EditedProject::kRefuse,
                           std::int64_t batch_observations = kTrackBatch);
// Of truth_tracks.h5: positions of the points and verdicts on the observations, no tracks.
SimulatedTracks read_truth_tracks(const std::string& path);

}  // namespace megablock
