#include "cluster/diagnose_command.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "cluster/diagnostics.h"
#include "cluster/exit_codes.h"

namespace megablock {

void add_diagnose(CLI::App& app, std::function<int()>& action) {
  struct Options {
    std::string job;
    bool json = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("diagnose", "Gaps, weak links, bases and missing views of a job, also before its adjustment");
  command->footer(
      "Example: megablock partition block.yaml -j job && megablock diagnose job\n"
      "         megablock diagnose job --json > diagnostics.json");
  command->add_option("job", options->job, "Job directory")->required();
  command->add_flag("--json", options->json, "As JSON: all that is outside what is asked, with its places");
  command->callback([=, &action] {
    action = [options] {
      const JobDiagnostics job = diagnose_job(JobStore(options->job));
      if (options->json)
        std::printf("%s", to_json(job.found, job.block).c_str());
      else
        std::printf("of %s:\n%s", job.source.c_str(), to_text(job.found, job.block).c_str());
      return kExitDone;
    };
  });
}

}  // namespace megablock
