// A simulated block as rendered images, with the project files around them.
#pragma once

#include <string>

#include "io/simulate/files/project_text.h"
#include "io/simulate/scene/simulation_options.h"

namespace megablock {

// Renders the images of a small block (textured terrain and boxes, ray cast, Brown distortion) as JPEG with EXIF GPS
// into folder/images, and writes the project files around them:
//   folder/block.yaml, folder/truth.csv and truth.h5 (poses of the frames), folder/control.csv (control and check
//   points, with roles and sigmas), folder/gcp_list.txt (the control points for other programs), folder/poses.csv (the
//   given poses; block.yaml does not use them), folder/rig_cameras.json and rig_assignments.json (street: the rig,
//   held), folder/truth_masks/<camera>.png (vehicle: where it is in the images; block.yaml does not use them)
// Attitude priors and relative poses have no place in these files and are not written.
void write_rendered_block(const SimulationOptions& options, const std::string& folder,
                          EditedProject edited = EditedProject::kRefuse);

}  // namespace megablock
