// Writes the section that compares residuals with the stated sigmas, one row per kind of observation
// (io/block/observation_statistics.h), and the section's tests of single tie point observations.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "io/evaluation/reliability.h"
#include "io/evaluation/remarks/remarks.h"
#include "io/report/drawing/html.h"
#include "io/report/sections/sections.h"

namespace megablock::report {

namespace {

// Whether the sigma that the residuals show differs from the stated one by more than chance explains, and by at least
// 10 %.
bool misstated(const ObservationStatistics& statistics) {
  const double factor = statistics.sigma_factor();
  const double tolerance = std::max(0.1, chance_of_factor(statistics.redundancy));
  return std::isfinite(factor) && std::abs(factor - 1) > tolerance;
}

// Explains a surplus of large residuals, if there are more than chance explains (five standard deviations).
std::string verdict(const Reliability& r) {
  // The number beyond the limit is about Poisson distributed if the errors are normal: its standard deviation is the
  // root of its mean.
  const double expected = kFalseAlarmProbability * static_cast<double>(r.tested);
  const auto found = static_cast<double>(r.beyond_normal);
  if (found <= expected + 5 * std::sqrt(std::max(1.0, expected)))
    return "No more observations exceed the limit than normally distributed errors give.";
  return fmt::format(
      "{} times as many observations exceed the limit as normally distributed errors of one sigma would give. "
      "This alone is no fault: matched points are not all equally accurate, so large errors are more frequent than "
      "with a normal distribution, about ten times as frequent on rendered images without any fault. The estimated "
      "sigma of the tie points includes them. They matter if they lie close together: see in the list below whether "
      "the largest belong to one image or to one object.",
      significant(found / expected, 2));
}

// The tests of Baarda and Pope for tie point observations, and the size of the errors that they detect.
std::string reliability_part(const BlockResult& result, const Reliability& r) {
  if (r.tested == 0) return "";
  Table tests({"test of tie point observations", "limit", "beyond it", "expected by chance"});
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
      "Reliability: an error of one observation is detected (with a probability of {:.0f} %, and one false alarm in "
      "{:.0f}) if it exceeds {} px for half of the observations, and {} px for 95 % of them. {} of {} have a "
      "redundancy below {}; {} more are not checked by any other observation. For the others, an error that is just "
      "not detected "
      "changes no result by more than {} of its own sigmas. Residuals are used without the weight of the robust loss: "
      "where the loss reduces the weight, |w| is too large by the square root of this weight.",
      100 * kDetectionProbability, 1 / kFalseAlarmProbability, significant(r.detectable_px.median, 2),
      significant(r.detectable_px.p95, 2), count(r.poorly_checked), count(r.tested),
      fixed(Reliability::kPoorRedundancy, 1), count(r.unchecked), significant(r.worst_external, 2));
  const std::string listed =
      fmt::format("The list has the largest |w| of observations with a redundancy of at least {}.",
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
  return section(
      "observations", "Observations and their sigmas",
      paragraph("Numbers count every coordinate and angle. Redundancy: how many observations of a kind could be "
                "dropped because the others determine them. The last column is the sigma that the residuals "
                "show, over the one they were weighted with (1: equal); that of the tie points is estimated, so "
                "it is near 1 in any block.") +
          table.html("compact") + reliability_part(result, figures.reliability));
}

}  // namespace megablock::report
