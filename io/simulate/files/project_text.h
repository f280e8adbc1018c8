// The block.yaml of a simulated block, which its user may have edited since.
#pragma once

#include <string>

#include "io/simulate/blocks/simulate.h"

namespace megablock {

// What becomes of a block.yaml that is in the folder and differs from what would be written.
enum class EditedProject { kRefuse, kOverwrite };

// InputError when there is one with other contents, unless it may be overwritten. Asked before anything is written.
void refuse_edited_project(const std::string& folder, const std::string& text, EditedProject edited);
// Throws InputError when that is not possible.
void write_text(const std::string& path, const std::string& text);

}  // namespace megablock
