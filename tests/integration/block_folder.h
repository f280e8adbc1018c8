// Writes a block and its tie points as the files that a job reads, and runs the job in this process.
#pragma once

#include <fstream>
#include <functional>
#include <string>

#include "cluster/stages/pipeline.h"
#include "io/simulate/blocks/simulate.h"
#include "io/store/units/block_file.h"
#include "io/store/units/tracks_file.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {

class BlockFolder {
 public:
  std::string path(const std::string& name) const { return folder_.path(name); }
  std::string job(const std::string& name) const { return folder_.path("job/" + name); }

  // `settings`: more lines of the project file.
  void write(const SimulatedBlock& s, const std::string& settings = "") const {
    write_block(path("given.h5"), s.block);
    write_tracks(path("tie_points.h5"), s.tracks);
    std::ofstream(path("block.yaml")) << "block: given.h5\ntie_points: tie_points.h5\n" << settings;
  }

  // Its exit code; throws what it throws.
  int run(const std::function<int(const RunOptions&, Communicator&)>& command = run_job) const {
    RunOptions options;
    options.project = path("block.yaml");
    options.directory = path("job");
    options.threads = 1;
    options.quiet = true;
    int argc = 0;
    char** argv = nullptr;
    Communicator ranks(&argc, &argv);
    return command(options, ranks);
  }

 private:
  ScratchDirectory folder_;
};

}  // namespace megablock
