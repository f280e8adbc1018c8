// Writes the block.yaml of a simulated block, but does not overwrite one that the user has edited.
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

}  // namespace megablock
