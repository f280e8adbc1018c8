#include "cluster/commands/diagnose_command.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "cluster/outcome/block_checks.h"
#include "cluster/outcome/diagnostics.h"
#include "cluster/outcome/result_figures.h"
#include "cluster/process/exit_codes.h"
#include "cluster/terminal/terminal_text.h"

namespace megablock {

namespace {

std::vector<std::vector<std::string>> split(const std::vector<std::string>& lists) {
  std::vector<std::vector<std::string>> names;
  for (const std::string& list : lists) {
    std::istringstream in(list);
    names.emplace_back();
    for (std::string name; std::getline(in, name, ',');) names.back().push_back(name);
  }
  return names;
}

// One object: the diagnostics and the keys 'checks' and 'remarks'.
std::string joined(const std::string& diagnostics, const std::string& checks, const std::vector<std::string>& remarks) {
  auto json = nlohmann::ordered_json::parse(diagnostics);
  json["checks"] = nlohmann::ordered_json::parse(checks);
  json["remarks"] = remarks;
  return json.dump(1) + "\n";
}

}  // namespace

void add_diagnose(CLI::App& app, std::function<int()>& action) {
  struct Options {
    std::string job;
    std::vector<std::string> subsets;
    bool json = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "diagnose", "List gaps, weak links, bases and missing images of a job, also before its adjustment");
  command->footer(
      "Example: megablock partition block.yaml -j job && megablock diagnose job\n"
      "         megablock diagnose job --json > diagnostics.json\n"
      "         megablock diagnose job --subset a.jpg,b.jpg,c.jpg --subset b.jpg,c.jpg,d.jpg");
  command->add_option("job", options->job, "Job directory")->required();
  command->add_flag("--json", options->json, "Print every value outside its limits, with its location, as JSON");
  command->add_option("--subset", options->subsets,
                      "Images, comma-separated: tie points that all of them share; given again, subsets are ranked");
  command->callback([=, &action] {
    action = [options] {
      const JobDiagnostics job = diagnose_job(JobStore(options->job));
      const BlockChecks checks = check_job(JobStore(options->job), job.found.aerial, split(options->subsets));
      const std::vector<std::string> remarks = result_remarks(JobStore(options->job));
      if (options->json)
        std::printf("%s", joined(to_json(job.found, job.block), to_json(checks, job.block), remarks).c_str());
      else
        std::printf("%s", for_terminal("of " + job.source + ":\n" + look_text(remarks) + to_text(job.found, job.block) +
                                       to_text(checks, job.block))
                              .c_str());
      return kExitDone;
    };
  });
}

}  // namespace megablock
