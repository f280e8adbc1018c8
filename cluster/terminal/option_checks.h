// Checks the values of options on the command line. The messages say how to correct a value.
#pragma once

#include <fmt/core.h>

#include <CLI/App.hpp>
#include <CLI/Validators.hpp>
#include <cmath>
#include <string>

#include "cluster/process/job_log.h"

namespace megablock {

// Accepts the name of a file or folder, which must not be empty.
inline CLI::Validator named() {
  return CLI::Validator(
      [](std::string& text) { return text.empty() ? std::string("the name is empty; name a file or folder") : ""; }, "",
      "named");
}

// Accepts a number for which `holds` is true; `words` describes these numbers in the message.
template <typename Holds>
CLI::Validator number(Holds holds, const std::string& words, const std::string& name) {
  return CLI::Validator(
      [=](std::string& text) {
        double value = 0;
        const bool number = CLI::detail::lexical_cast(text, value) && std::isfinite(value) && holds(value);
        return number ? std::string() : "'" + text + "' is not a number " + words;
      },
      "NUMBER", name);
}

inline CLI::Validator not_negative() {
  return number([](double value) { return value >= 0; }, "of 0 or more", "not negative");
}

inline CLI::Validator positive() {
  return number([](double value) { return value > 0; }, "above 0", "positive");
}

// Accepts a number of threads of a process; 0 means as many as there are cores. Each thread has a stack and tables of
// its own, so that thousands of them would end the process without a message.
inline CLI::Validator threads() {
  return number([](double value) { return value >= 0 && value <= 1024; }, "of 0 to 1024", "threads");
}

// Adds the option for the level of the log. The environment variable MEGABLOCK_LOG_LEVEL sets it as well.
inline void add_log_level(CLI::App& command, LogLevel& level) {
  command
      .add_option_function<std::string>(
          "--log-level", [&level](const std::string& name) { level = *log_level_of(name); },
          "Level of the job's log, JOB/log/<host>-<rank>.log: debug, info, warning, error or off. Default: info")
      ->envname("MEGABLOCK_LOG_LEVEL")
      ->check(CLI::IsMember(log_level_names()));
}

// Accepts an amount of memory or of disk space, MiB.
inline CLI::Validator mebibytes(double most) {
  return number([=](double value) { return value >= 0 && value <= most; }, fmt::format("of 0 to {:g} MiB", most),
                "mebibytes");
}

}  // namespace megablock
