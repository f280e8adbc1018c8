// Writes the project files of a simulated block without images.
#include "io/simulate/files/write.h"

#include <filesystem>

#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/project/inputs/pose_csv.h"
#include "io/simulate/blocks/simulate.h"
#include "io/simulate/files/project_text.h"
#include "io/store/hdf5/hdf5_tables.h"
#include "io/store/units/block_file.h"
#include "io/store/units/state_file.h"
#include "io/store/units/track_writer.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

constexpr const char* kProject =
    "# A simulated block: cameras, frames and priors in given.h5, tie points in tie_points.h5.\n"
    "# The truth is in truth.csv (poses), truth.h5 (poses and cameras) and truth_tracks.h5 (points, wrong "
    "observations).\n"
    "block: given.h5\n"
    "tie_points: tie_points.h5\n";
constexpr const char *kTruth = "simulated_tracks", *kPosition = "points/position", *kOutlier = "observations/outlier";

std::vector<double> positions(const std::vector<Eigen::Vector3d>& points) {
  return vectors3(points, [](const Eigen::Vector3d& point) { return point; });
}

}  // namespace

void write_simulated_block(const SimulationOptions& options, const std::string& folder, EditedProject edited,
                           std::int64_t batch_observations) {
  options.check();
  refuse_edited_project(folder, kProject, edited);
  make_folder(folder);
  const fs::path root(folder);

  TrackWriter tie_points((root / "tie_points.h5").string());
  Hdf5Writer truth_tracks((root / "truth_tracks.h5").string(), kTruth, Hdf5Storage::kDisk);
  truth_tracks.group("points", "one row per track of tie_points.h5");
  truth_tracks.growing<double>(kPosition, {3}, {"m", "true position in the ground frame"});
  truth_tracks.group("observations", "one row per observation of tie_points.h5");
  truth_tracks.growing<std::uint8_t>(
      kOutlier, {},
      {"",
       "0: the point with the stated noise, 1: anywhere in the image, 2: another place of a repeated facade, "
       "3: on a moving vehicle"});
  const SimulatedBlock simulated = simulate_block(
      options,
      [&](const SimulatedTracks& batch) {
        tie_points.append(batch.tracks);
        truth_tracks.append(kPosition, positions(batch.points));
        truth_tracks.append(kOutlier, batch.outlier);
      },
      batch_observations);
  tie_points.close();
  truth_tracks.close();

  // The ground frame and the priors exist only after the tracks. block.yaml is the last file, so that an interrupted
  // first run leaves no project that can be started.
  write_block((root / "given.h5").string(), simulated.block);
  write_state((root / "truth.h5").string(), simulated.truth);
  write_pose_csv((root / "truth.csv").string(), pose_table(simulated.block, simulated.truth));
  write_pose_files(simulated.block, folder);
  write_text((root / "block.yaml").string(), kProject);
}

SimulatedTracks read_truth_tracks(const std::string& path) {
  const Hdf5Reader file(path, kTruth);
  SimulatedTracks truth;
  const std::vector<double> rows = file.matrix<double>(kPosition, 3);
  for (std::size_t p = 0; 3 * p < rows.size(); ++p) truth.points.push_back(vector3(rows, p));
  truth.outlier = file.vector<std::uint8_t>(kOutlier);
  return truth;
}

}  // namespace megablock
