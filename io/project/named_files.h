// The files that a project file names: what no output may be written over.
#pragma once

#include <string>
#include <vector>

namespace megablock {

// Of the files and folders that are there, absolute. `made`: a key (of any section) that is passed over, because its
// file is what the command makes anew. InputError when the project file cannot be read.
std::vector<std::string> files_named_in(const std::string& project, const std::string& made);

}  // namespace megablock
