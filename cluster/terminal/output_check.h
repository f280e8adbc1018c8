// Checks the output that -o names. A command may replace its own earlier output, but no file that cannot be made again.
#pragma once

#include <string>
#include <vector>

namespace megablock {

// The inputs of a command: the project file and the files and folders that it names; for a job directory, those of the
// project of the job. `made` is the key of the project file whose file the command makes itself. Errors in the source
// are left to the reader of the source.
std::vector<std::string> inputs_of(const std::string& source, const std::string& made = "");

// Throws InputError when the file or folder `output` would replace one of the inputs (in a folder: an image), or is in
// a job directory. There a command writes only new files in result/, and `own`, a file in the job that it makes itself.
// Links are followed.
void check_output(const std::string& output, const std::vector<std::string>& inputs = {}, const std::string& own = "");

}  // namespace megablock
