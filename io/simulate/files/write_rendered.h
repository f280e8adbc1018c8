// Writes a simulated block as rendered images with the project files for them.
// Internal to io/: it is not installed.
#pragma once

#include <string>

#include "io/simulate/files/project_text.h"
#include "io/simulate/scene/simulation_options.h"

namespace megablock {

// Renders the images of a small block (textured terrain and boxes, by ray casting, with the distortion of the true
// camera) as JPEG files with EXIF GPS into folder/images, and writes these files:
//
//   block.yaml                                the project file
//   truth.csv, truth.h5                       true poses of the frames
//   control.csv                               control and check points with roles and sigmas
//   gcp_list.txt                              the control points for other programs
//   poses.csv                                 the given poses; only the block.yaml of a Stereopolis block uses them
//   rig_cameras.json, rig_assignments.json    the rig of a street block (held) or of a Stereopolis block
//   truth_masks/<camera>.png                  the vehicle in the images; block.yaml does not use them
//
// Attitude priors and relative poses have no place in these files and are not written.
void write_rendered_block(const SimulationOptions& options, const std::string& folder,
                          EditedProject edited = EditedProject::kRefuse);

}  // namespace megablock
