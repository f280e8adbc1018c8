// Looks for files of control and positions that lie beside images, for `megablock init`. Internal to io/.
#pragma once

#include <string>
#include <vector>

namespace megablock {

// A file that belongs into the project file.
struct FoundInput {
  std::string key;                 // "control" or "positions"
  std::vector<std::string> files;  // the file; for positions, also the exposures that belong to a solution
  std::string describe;            // for the user
};

// Searches the folder of images with its sub-folders, and its parent, as ODM lays projects out. At most one list of
// control is returned: gcp_list.txt before ground_control_points.json. geo.txt counts before logs of receivers, because
// somebody wrote it on purpose. A solution (.pos) and exposures (_Timestamp.MRK) of one folder belong together.
std::vector<FoundInput> find_inputs(const std::string& images);

}  // namespace megablock
