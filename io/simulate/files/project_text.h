// Writes the text files of a simulated block: block.yaml, without overwriting one that the user has edited, and what is
// known of the poses.
// Internal to io/: it is not installed.
#pragma once

#include <string>

#include "io/simulate/blocks/simulate.h"

namespace megablock {

// The treatment of an existing block.yaml that differs from the new one.
enum class EditedProject { kRefuse, kOverwrite };

// Throws InputError if there is a block.yaml with other contents that must not be overwritten. It is called before
// anything is written.
void refuse_edited_project(const std::string& folder, const std::string& text, EditedProject edited);
// Writes a text file. Throws InputError if that is impossible.
void write_text(const std::string& path, const std::string& text);

// Writes the observations of poses that a block has as a user's own files: trajectory.csv (positions, attitudes),
// relative_poses.csv, and poses.csv (start values). A file without lines is not written.
void write_pose_files(const Block& block, const std::string& folder);

}  // namespace megablock
