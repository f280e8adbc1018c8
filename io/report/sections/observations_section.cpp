// Are the stated sigmas true? One row per kind of observation (io/block/observation_statistics.h).
#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "io/evaluation/reliability.h"
#include "io/evaluation/remarks.h"
#include "io/report/drawing/html.h"
#include "io/report/sections/sections.h"

namespace megablock::report {

namespace {

// By more than chance, and at least 10 %.
bool misstated(const ObservationStatistics& statistics) {
  const double factor = statistics.sigma_factor();
  const double tolerance = std::max(0.1, chance_of_factor(statistics));
  return std::isfinite(factor) && std::abs(factor - 1) > tolerance;
}

// What more large residuals than expected mean, if there are more than chance explains (five standard deviations).
std::string verdict(const Reliability& r) {
  const double expected = kFalseAlarmProbability * static_cast<double>(r.tested);
  const auto found = static_cast<double>(r.beyond_normal);
  if (found <= expected + 5 * std::sqrt(std::max(1.0, expected)))
    return "No more measurements are beyond the limit than normally distributed errors leave there.";
  return fmt::format(
      "{} times as many measurements are beyond the limit as normally distributed errors of one sigma would leave "
      "there. "
      "By itself that is no fault: matched points are not all measured equally well, so that large errors are more "
      "frequent than normal ones, about ten times so on rendered pictures without any fault. The sigma of the tie "
      "points, which is estimated, includes them. It matters where they lie together: see whether the largest, below, "
      "are of one image or one object.",
      significant(found / expected, 2));
}

// Baarda's and Pope's tests of the tie point observations, and how large an error must be to be found.
std::string reliability_part(const BlockResult& result, const Reliability& r) {
  if (r.tested == 0) return "";
  Table tests({"test of tie point measurements", "limit", "beyond it", "expected by chance"});
  const auto expected = static_cast<std::int64_t>(std::llround(kFalseAlarmProbability * static_cast<double>(r.tested)));
  tests.add({"Baarda: |w| = |residual| ÷ (sigma √redundancy)", fixed(r.normal_limit, 2), count(r.beyond_normal),
             count(expected)});
  if (std::isfinite(r.tau_limit))
    tests.add({"Pope: |τ| = |w| ÷ sigma0", fixed(r.tau_limit, 2), count(r.beyond_tau), count(expected)});
  Table largest({"largest |w|", "image", "axis", "residual [px]", "redundancy", "|w|"});
  for (const TestedMeasurement& test : r.largest)
    largest.add({"track " + std::to_string(test.track.value), escape(result.block.name_of(test.image)),
                 test.vertical ? "y" : "x", fixed(test.residual, 2), fixed(test.redundancy, 2),
                 fixed(test.normalised, 2)});
  const std::string reliability = fmt::format(
      "Reliability: an error of one measurement is found (with a probability of {:.0f} %, at a false alarm in {:.0f}) "
      "from {} px on for half of the measurements, from {} px on for 95 % of them. {} of {} have a redundancy below "
      "{}; "
      "{} are checked by nothing else; of the others, an error that is just not found moves no result by more than {} "
      "of "
      "its own sigmas. Residuals are taken as they are: beyond the corner of a robust loss, |w| is too large by the "
      "root "
      "of the loss's weight.",
      100 * kDetectionProbability, 1 / kFalseAlarmProbability, significant(r.detectable_px.median, 2),
      significant(r.detectable_px.p95, 2), count(r.poorly_checked), count(r.tested),
      fixed(Reliability::kPoorRedundancy, 1), count(r.unchecked), significant(r.worst_external, 2));
  const std::string listed = fmt::format("Listed are the largest |w| of measurements with a redundancy of {} and more.",
                                         fixed(Reliability::kListedRedundancy, 2));
  return tests.html("compact") + paragraph(verdict(r)) + paragraph(reliability) +
         (largest.empty() ? "" : paragraph(listed, "muted") + largest.html("compact"));
}

}  // namespace

std::string observations_section(const BlockResult& result, const Figures& figures) {
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
                     table.html("compact") + reliability_part(result, figures.reliability));
}

}  // namespace megablock::report
