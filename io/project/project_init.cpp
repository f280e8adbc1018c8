// Writes the project file of `megablock init`. The images are scanned once, and comments of the file tell what was
// found.
#include "io/project/project_init.h"

#include <fmt/core.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/project/input_search.h"
#include "io/project/project.h"
#include "io/text/counted.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

// The path relative to the folder of the project file if it lies below this folder, otherwise the absolute path.
std::string path_for(const std::string& path, const fs::path& project_folder) {
  const fs::path absolute = fs::absolute(path).lexically_normal();
  const fs::path relative = absolute.lexically_relative(project_folder);
  const bool below = !relative.empty() && *relative.begin() != "..";
  std::string text = (below ? relative : absolute).generic_string();
  if (text.size() > 1 && text.back() == '/') text.pop_back();
  return text;
}

// A YAML scalar in double quotes.
std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result + "\"";
}

// A file that was found beside the images, and the reason why it is not used; empty: it is used.
struct Candidate {
  FoundInput input;
  std::string refused;
};

std::string value_of(const FoundInput& input, const fs::path& folder) {
  const std::string file = quoted(path_for(input.files[0], folder));
  if (input.files.size() == 1) return file;
  return "{file: " + file + ", exposures: " + quoted(path_for(input.files[1], folder)) + "}";
}

// The keys `control` and `positions` of what was found. Files that do not fit stand in comments with the reason.
std::string lines_of_inputs(const std::vector<Candidate>& candidates, const fs::path& folder) {
  std::string text;
  std::vector<const Candidate*> positions;
  for (const Candidate& candidate : candidates) {
    const std::string value = value_of(candidate.input, folder);
    if (!candidate.refused.empty())
      text += "# " + candidate.input.key + ": " + value + "  # " + candidate.input.describe +
              "; not used: " + candidate.refused + "\n";
    else if (candidate.input.key == "positions")
      positions.push_back(&candidate);
    else
      text += candidate.input.key + ": " + value + "\n";
  }
  if (positions.size() == 1)
    return text + "positions: " + value_of(positions[0]->input, folder) + "  # " + positions[0]->input.describe + "\n";
  if (!positions.empty()) text += "positions:\n";
  for (const Candidate* candidate : positions)
    text += "  - " + value_of(candidate->input, folder) + "  # " + candidate->input.describe + "\n";
  return text;
}

std::string head(const InitOptions& options, const std::vector<Candidate>& candidates, const fs::path& folder) {
  std::string text =
      "# Project of an image block; all keys: reference/project-file.md in share/doc/megablock/docs of the "
      "installation\nimages: " +
      quoted(path_for(options.images, folder)) + "\n";
  if (!options.mask_folder.empty()) text += "masks: " + quoted(path_for(options.mask_folder, folder)) + "\n";
  if (!options.gcp_file.empty()) text += "control: " + quoted(path_for(options.gcp_file, folder)) + "\n";
  return text + lines_of_inputs(candidates, folder) + "cameras:\n  grouping: " + options.camera_grouping + "\n";
}

std::vector<Candidate> candidates_of(const InitOptions& options) {
  std::vector<Candidate> candidates;
  for (const FoundInput& input : find_inputs(options.images))
    if (input.key != "control" || options.gcp_file.empty()) candidates.push_back({input, ""});
  return candidates;
}

// Marks the candidate that a message is about. Returns false if it is about none.
bool refuse_candidate(std::vector<Candidate>& candidates, const std::string& message) {
  for (Candidate& candidate : candidates)
    for (const std::string& file : candidate.input.files) {
      if (!candidate.refused.empty() || message.find(file) == std::string::npos) continue;
      candidate.refused = message;
      return true;
    }
  return false;
}

std::string found_text(const Project& project) {
  std::ostringstream text;
  for (const Camera& camera : project.block.cameras) {
    char line[128];
    std::snprintf(line, sizeof line, "  #   focal_px: %.1f  # %s\n", camera.intrinsics[kFocal],
                  camera.focal_known ? "from the image headers" : "a guess: 1.2 x the larger side");
    text << "  # " << quoted(camera.name) << ":\n" << line;
    if (camera.readout_s != 0)
      text << "  #   readout_ms: auto  # rolling shutter of " << 1000 * camera.readout_s
           << " ms by a table of cameras, if the images confirm it\n";
  }
  for (const std::string& line : project.found) text << "# " << line << "\n";
  const GroundFrame& ground = project.block.ground;
  if (ground.georeferenced) {
    char line[160];
    std::snprintf(line, sizeof line, "origin: [%.9g, %.9g, %.9g]  # latitude_deg, longitude_deg, height_m (WGS84)\n",
                  ground.latitude_deg, ground.longitude_deg, ground.height_m);
    text << line;
  }
  return text.str();
}

std::string control_text(const std::vector<ControlPoint>& points) {
  const auto checks = std::ranges::count(points, PointRole::kCheck, &ControlPoint::role);
  const auto controls = std::ssize(points) - checks;
  std::string text = counted(controls, "control point");
  if (checks > 0) text += " and " + counted(checks, "check point");
  return text;
}

// Names points that a single image sees. Empty if there are none.
std::string lone_marks_text(const std::vector<ControlPoint>& points) {
  constexpr std::int64_t kNamed = 5;
  std::string names;
  std::int64_t lone = 0;
  for (const ControlPoint& point : points) {
    if (point.measurements.size() != 1 || ++lone > kNamed) continue;
    names += (lone > 1 ? ", " : "") + point.name;
  }
  if (lone == 0) return "";
  return fmt::format("control: {} of {} {} marked in one image only, so that nothing can check {}: {}{}", lone,
                     counted(std::ssize(points), "point"), lone == 1 ? "is" : "are", lone == 1 ? "it" : "them", names,
                     lone > kNamed ? ", ..." : "");
}

std::string summary(const Project& project, const std::vector<Candidate>& candidates, const fs::path& folder,
                    const std::string& output) {
  std::int64_t positions = 0, attitudes = 0;
  for (const Frame& frame : project.block.frames) {
    positions += frame.position_prior.has_value();
    attitudes += frame.attitude_prior.has_value();
  }
  std::ostringstream text;
  text << output << ": " << project.block.images.size() << " images of " << project.block.cameras.size()
       << (project.block.cameras.size() == 1 ? " camera, " : " cameras, ") << positions << " with a position, "
       << attitudes << " with angles";
  if (!project.block.control_points.empty()) text << ", " << control_text(project.block.control_points);
  if (!project.unreadable.empty()) text << ", " << project.unreadable.size() << " unreadable files left out";
  text << ".";
  for (const std::string& line : project.found) text << "\n" << line;
  if (const std::string lone = lone_marks_text(project.block.control_points); !lone.empty()) text << "\n" << lone;
  for (const Candidate& candidate : candidates) {
    text << "\nfound: " << candidate.input.key << ": " << path_for(candidate.input.files[0], folder) << " ("
         << candidate.input.describe << ")";
    if (!candidate.refused.empty()) text << ", not used: " << candidate.refused;
  }
  for (const auto& [name, reason] : project.unreadable) text << "\nunreadable: " << name << ": " << reason;
  for (const std::string& warning : project.warnings) text << "\nwarning: " << warning;
  return text.str();
}

void write_file(const fs::path& path, const std::string& text) {
  std::ofstream stream(path, std::ios::trunc);
  stream << text;
  stream.close();
  if (!stream) throw_file_error(path.string(), "written", errno);
}

}  // namespace

std::string init_project(const InitOptions& options) {
  std::error_code error;
  if (!fs::is_directory(options.images, error))
    throw InputError("'" + options.images + "' is not a folder that can be read; give the folder of the images");
  check_parent(options.output);
  const fs::path output = fs::absolute(options.output).lexically_normal();
  if (fs::exists(output, error))
    throw InputError("'" + options.output + "' exists already; remove it or choose another name with -o");
  // The draft is read by the reader of project files, so `run` will later understand the file in the same way. Files
  // that were found and do not fit are left to the user.
  const fs::path draft = output.string() + ".draft", folder = output.parent_path();
  std::vector<Candidate> candidates = candidates_of(options);
  while (true) {
    const std::string text = head(options, candidates, folder);
    write_file(draft, text);
    try {
      const Project project = read_project(draft.string());
      write_file(output, text + found_text(project));
      fs::remove(draft, error);
      return summary(project, candidates, folder, options.output);
    } catch (const InputError& wrong) {
      fs::remove(draft, error);
      // A place in the draft says nothing to the user, who has never seen this file.
      std::string message = wrong.what();
      const std::string place = draft.string() + ":";
      const std::size_t end = message.find(": ");
      if (message.starts_with(place) && end != std::string::npos) message = message.substr(end + 2);
      if (!refuse_candidate(candidates, message)) throw InputError(message);
    } catch (...) {
      fs::remove(draft, error);
      throw;
    }
  }
}

}  // namespace megablock
