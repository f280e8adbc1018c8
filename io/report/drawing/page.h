// Puts the contents of the report into an HTML page with its styles and script.
// Internal to io/: it is not installed.
#pragma once

#include <string>

namespace megablock::report {

std::string page(const std::string& title, const std::string& subtitle, const std::string& body,
                 const std::string& json);

}  // namespace megablock::report
