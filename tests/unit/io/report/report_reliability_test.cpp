// The report's tests of single observations, against a plain count over all of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "io/evaluation/figures.h"
#include "io/evaluation/reliability.h"
#include "io/report/report.h"
#include "tests/support/io/made_up_result.h"

namespace megablock {
namespace {

BlockResult result_with_redundancy() {
  BlockResult result = made_up_result(small_block());
  result.image_sigma_px = 0.5;
  result.variance_factor = 1.21;
  result.degrees_of_freedom = 40;  // few, so that tau's limit lies well below the normal one
  std::mt19937 random(3);
  for (std::size_t o = 0; o < result.kept.size(); ++o) {
    result.redundancy_x.push_back(static_cast<std::uint8_t>(result.kept[o] ? random() % 256 : 0));
    result.redundancy_y.push_back(static_cast<std::uint8_t>(result.kept[o] ? 20 + random() % 200 : 0));
  }
  return result;
}

TEST(ReportReliability, CountsEveryMeasurement) {
  const BlockResult result = result_with_redundancy();
  std::int64_t tested = 0, unchecked = 0, poor = 0, beyond_normal = 0, beyond_tau = 0;
  std::vector<double> all;
  double worst = 0;
  for (std::size_t t = 0; t < result.points.size(); ++t) {
    if (!result.points[t].allFinite()) continue;
    for (auto o = static_cast<std::size_t>(result.tracks.begin[t]);
         o < static_cast<std::size_t>(result.tracks.begin[t + 1]); ++o) {
      if (!result.kept[o] || !std::isfinite(result.residual_x[o])) continue;
      for (const auto& [v, stored] : {std::pair(result.residual_x[o], result.redundancy_x[o]),
                                      std::pair(result.residual_y[o], result.redundancy_y[o])}) {
        if (stored == 0) {
          ++unchecked;
          continue;
        }
        const double r = stored / 255.0, w = std::abs(v) / (0.5 * std::sqrt(r));
        ++tested;
        poor += r < 0.1;
        beyond_normal += w > 3.290527;
        beyond_tau += w / 1.1 > tau_critical_value(40);
        worst = std::max(worst, 4.132147 * std::sqrt((1 - r) / r));
        if (stored > 5) all.push_back(w);  // 0.02: of others |w| is not known well
      }
    }
  }
  const report::Reliability found = report::figures_of(result).reliability;
  EXPECT_EQ(found.tested, tested);
  EXPECT_EQ(found.unchecked, unchecked);
  EXPECT_EQ(found.poorly_checked, poor);
  EXPECT_EQ(found.beyond_normal, beyond_normal);
  EXPECT_EQ(found.beyond_tau, beyond_tau);
  EXPECT_GT(tested, 100);
  EXPECT_GT(unchecked, 0);
  EXPECT_NEAR(found.worst_external, worst, 1e-4 * worst);
  std::sort(all.rbegin(), all.rend());
  ASSERT_EQ(found.largest.size(), 10u);
  for (const auto& test : found.largest) EXPECT_GT(test.redundancy, 0.02);
  for (std::size_t i = 0; i < 10; ++i) EXPECT_NEAR(found.largest[i].normalised, all[i], 1e-12 * all[i]);
}

// Normal errors as they are simulated, and errors of two kinds of points, one measured three times as badly.
TEST(ReportReliability, SaysWhetherItMattersThatMoreThanExpectedAreBeyondTheLimit) {
  BlockResult result = result_with_redundancy();
  result.redundancy_x.assign(result.kept.size(), 204);  // 0.8
  result.redundancy_y = result.redundancy_x;
  const auto page_with_errors = [&](double share_of_bad) {
    std::mt19937 random(7);
    std::normal_distribution<float> normal(0, static_cast<float>(0.5 * std::sqrt(0.8)));
    for (std::size_t i = 0; i < result.kept.size(); ++i) {
      const float factor = static_cast<double>(random() % 1000) < 1000 * share_of_bad ? 3.0F : 1.0F;
      result.residual_x[i] = factor * normal(random);
      result.residual_y[i] = factor * normal(random);
    }
    result.observation_table.kinds[0] = {100, 95, 60, 1};
    return report_html(result);
  };
  const std::string normal = page_with_errors(0), mixed = page_with_errors(0.2);
  constexpr const char* kNoMore = "No more observations exceed the limit than normally distributed errors";
  constexpr const char* kMore = " times as many observations exceed the limit";
  EXPECT_THAT(normal, testing::HasSubstr(kNoMore));
  EXPECT_THAT(normal, testing::Not(testing::HasSubstr(kMore)));
  EXPECT_THAT(mixed, testing::HasSubstr(kMore));
  EXPECT_THAT(mixed, testing::HasSubstr("This alone is no fault"));
}

TEST(ReportReliability, IsOnThePage) {
  using testing::HasSubstr;
  using testing::Not;
  BlockResult result = result_with_redundancy();
  result.observation_table.kinds[0] = {100, 95, 60, 1};
  const std::string page = report_html(result);
  EXPECT_THAT(page, HasSubstr("Baarda"));
  EXPECT_THAT(page, HasSubstr("Pope"));
  EXPECT_THAT(page, Not(HasSubstr("nan px")));
  result.redundancy_x.clear();  // a result of an earlier program
  result.redundancy_y.clear();
  EXPECT_THAT(report_html(result), Not(HasSubstr("Baarda")));
}

}  // namespace
}  // namespace megablock
