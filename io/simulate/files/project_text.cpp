#include "io/simulate/files/project_text.h"

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/project/inputs/pose_csv.h"
#include "io/project/inputs/relative_poses_file.h"
#include "io/project/trajectory/trajectories.h"

namespace megablock {

void refuse_edited_project(const std::string& folder, const std::string& text, EditedProject edited) {
  const std::filesystem::path path = std::filesystem::path(folder) / "block.yaml";
  if (edited == EditedProject::kOverwrite || !std::filesystem::exists(path)) return;
  std::ifstream file(path);
  // The same simulation may be written again. Only a text that this program would not write counts as edited.
  if (std::string(std::istreambuf_iterator<char>(file), {}) == text) return;
  throw InputError(
      path.string() +
      ": this project file exists and differs from the new one: it was edited, or belongs to another simulation; "
      "name another folder with -o, or give --overwrite");
}

void write_text(const std::string& path, const std::string& text) {
  std::ofstream stream(path);
  stream << text;
  stream.close();
  if (!stream) throw_file_error(path, "written", errno);
}

void write_pose_files(const Block& block, const std::string& folder) {
  const std::filesystem::path root(folder);
  const auto observed = [](const Frame& frame) { return frame.position_prior || frame.attitude_prior; };
  if (std::ranges::any_of(block.frames, observed)) write_trajectory_csv((root / "trajectory.csv").string(), block);
  if (!block.relative_poses.empty()) write_relative_poses((root / "relative_poses.csv").string(), block);
  const PoseTable starts = pose_table(block, initial_state(block));
  if (!starts.names.empty()) write_pose_csv((root / "poses.csv").string(), starts);
}

}  // namespace megablock
