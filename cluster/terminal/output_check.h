// Where a command may write what -o names: over its own earlier output, over nothing that cannot be had back.
#pragma once

#include <string>
#include <vector>

namespace megablock {

// What a command reads: the project file and the files and folders that it names; of a job directory, those of its
// project. `made`: the key of a project file whose file the command makes. What is wrong with the source is said where
// it is read.
std::vector<std::string> inputs_of(const std::string& source, const std::string& made = "");

// InputError when the file or folder `output` would take the place of one of the inputs (of a folder: of a picture
// below it), or lies in a job directory: there a command writes new files in result/ alone, and `own`, a name in the
// job that it makes itself. Links are followed.
void check_output(const std::string& output, const std::vector<std::string>& inputs = {}, const std::string& own = "");

}  // namespace megablock
