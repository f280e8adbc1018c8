// Are the stated sigmas true? One row per kind of observation (io/observation_statistics.h).
#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "io/report/html.h"
#include "io/report/sections.h"

namespace megablock::report {

namespace {

// Five standard deviations of a factor estimated from `redundancy` observations, and at least 10 %.
bool misstated(const ObservationStatistics& statistics) {
  const double factor = statistics.sigma_factor();
  const double tolerance = std::max(0.1, 5 / std::sqrt(2 * statistics.redundancy));
  return std::isfinite(factor) && std::abs(factor - 1) > tolerance;
}

}  // namespace

std::string observations_section(const BlockResult& result) {
  Table table({"observations", "number", "redundancy", "share", "shown ÷ stated sigma"});
  std::int64_t number = 0;
  double redundancy = 0;
  for (std::size_t k = 0; k < kObservationKinds; ++k) {
    const ObservationStatistics& s = result.observation_table.kinds[k];
    if (s.count == 0) continue;
    number += s.count;
    redundancy += s.redundancy;
    table.add({name_of(static_cast<ObservationKind>(k)), count(s.count), fixed(s.redundancy, 1),
               percent(s.redundancy, static_cast<double>(s.count)), fixed(s.sigma_factor(), 2)},
              misstated(s) ? "look" : "");
  }
  if (table.empty()) return "";
  table.add({"all", count(number), fixed(redundancy, 1), percent(redundancy, static_cast<double>(number)),
             result.degrees_of_freedom > 0 ? fixed(std::sqrt(std::max(0.0, result.variance_factor)), 2) : kMissing},
            "sum");
  return section("observations", "Observations and their sigmas",
                 paragraph("Redundancy says how much of the observations of a kind is checked by all others; the last "
                           "column how far their residuals are from what the stated sigmas promise (1: as promised).") +
                     table.html("compact"));
}

}  // namespace megablock::report
