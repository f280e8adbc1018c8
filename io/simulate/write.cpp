// The project files of a simulated block at the level of tie points.
#include <filesystem>
#include <fstream>

#include "io/error.h"
#include "io/pose_csv.h"
#include "io/simulate/simulate.h"
#include "io/unit_files.h"

namespace megablock {

namespace fs = std::filesystem;

void write_simulated_block(const SimulatedBlock& simulated, const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw InputError(folder + ": cannot be created: " + error.message());
  const fs::path root(folder);
  write_block((root / "given.h5").string(), simulated.block);
  write_tracks((root / "tie_points.h5").string(), simulated.tracks);
  write_state((root / "truth.h5").string(), simulated.truth);
  write_pose_csv((root / "truth.csv").string(), pose_table(simulated.block, simulated.truth));
  std::ofstream yaml(root / "block.yaml");
  yaml << "# A simulated block: cameras, frames and priors in given.h5, tie points in tie_points.h5.\n"
       << "# The truth is in truth.csv (poses) and truth.h5 (poses and cameras).\n"
       << "block: given.h5\n"
       << "tie_points: tie_points.h5\n";
  yaml.close();
  if (!yaml) throw InputError((root / "block.yaml").string() + ": cannot be written");
}

}  // namespace megablock
