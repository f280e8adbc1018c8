// Checks of values on the command line, with messages of our own.
#pragma once

#include <CLI/Validators.hpp>
#include <cmath>
#include <string>

namespace megablock {

// The name of a file or folder.
inline CLI::Validator named() {
  return CLI::Validator(
      [](std::string& text) { return text.empty() ? std::string("the name is empty; name a file or folder") : ""; }, "",
      "named");
}

// A number of 0 or more.
inline CLI::Validator not_negative() {
  return CLI::Validator(
      [](std::string& text) {
        double value = -1;
        const bool number = CLI::detail::lexical_cast(text, value) && std::isfinite(value) && value >= 0;
        return number ? std::string() : "'" + text + "' is not a number of 0 or more";
      },
      "NUMBER", "not negative");
}

// A number above 0.
inline CLI::Validator positive() {
  return CLI::Validator(
      [](std::string& text) {
        double value = 0;
        const bool number = CLI::detail::lexical_cast(text, value) && std::isfinite(value) && value > 0;
        return number ? std::string() : "'" + text + "' is not a number above 0";
      },
      "NUMBER", "positive");
}

}  // namespace megablock
