#include "io/report.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "io/report/drawing.h"
#include "io/report/figures.h"
#include "io/report/html.h"
#include "tests/unit/io/made_up_result.h"

namespace megablock {
namespace {

using testing::HasSubstr;
using testing::Not;

SimulationOptions small_block() {
  SimulationOptions options;
  options.frames = 60;
  options.control_points = 4;
  options.check_points = 5;
  options.attitude_sigma_deg = 1;
  return options;
}

nlohmann::json figures_in(const std::string& page) {
  const std::string open = "id=\"figures\">";
  const std::size_t begin = page.find(open) + open.size();
  return nlohmann::json::parse(page.substr(begin, page.find("</script>", begin) - begin));
}

// What a reader would see: text between tags outside style and script.
std::string visible_text(const std::string& page) {
  std::string text;
  for (std::size_t i = 0; i < page.size();) {
    if (page.compare(i, 6, "<style") == 0) i = page.find("</style", i);
    if (page.compare(i, 7, "<script") == 0) i = page.find("</script", i);
    if (page[i] == '<')
      i = page.find('>', i) + 1, text += ' ';
    else
      text += page[i++];
  }
  return text;
}

// Every element that is opened is closed in order (void elements aside), attributes in quotes are closed.
void expect_balanced(const std::string& page) {
  std::vector<std::string> open;
  for (std::size_t i = 0; (i = page.find('<', i)) != std::string::npos;) {
    if (page[i + 1] == '!') {
      i = page.find('>', i);
      continue;
    }
    const bool closing = page[i + 1] == '/';
    std::size_t end = i + 1 + closing;
    std::string name;
    while (std::isalnum(static_cast<unsigned char>(page[end]))) name += page[end++];
    ASSERT_FALSE(name.empty()) << page.substr(i, 60);
    bool quoted = false;
    while (quoted || page[end] != '>') {
      if (page[end] == '"') quoted = !quoted;
      ASSERT_LT(++end, page.size());
    }
    const bool void_element = name == "meta" || name == "input" || page[end - 1] == '/';
    if (closing) {
      ASSERT_FALSE(open.empty()) << name;
      ASSERT_EQ(open.back(), name) << page.substr(i > 80 ? i - 80 : 0, 160);
      open.pop_back();
    } else if (!void_element) {
      open.push_back(name);
    }
    i = name == "script" || name == "style" ? page.find("</" + name, end) : end;
    if (closing) i = end;
  }
  EXPECT_TRUE(open.empty());
}

void expect_sound(const std::string& page) {
  expect_balanced(page);
  const std::string text = visible_text(page);
  for (const char* bad : {"nan", "NaN", "inf ", "-inf", "1e+", "e-0"}) EXPECT_THAT(text, Not(HasSubstr(bad)));
  for (const char* bad : {"\"nan", "=nan", " nan", "=-nan", "=inf", "Mnan", "Lnan"})
    EXPECT_THAT(page, Not(HasSubstr(bad)));
  for (const char* fetched : {"http://", "https://", "src=", "<link", "@import", "url("})
    EXPECT_THAT(page, Not(HasSubstr(fetched)));
}

TEST(Report, EmptyBlock) {
  const std::string page = report_html({});
  expect_sound(page);
  EXPECT_EQ(figures_in(page)["images"], 0);
  EXPECT_THAT(page, HasSubstr("The block has no images"));
}

TEST(Report, BlockBeforeAnythingWasComputed) {
  BlockResult result;
  result.block = simulate_block(small_block()).block;
  const std::string page = report_html(result);
  expect_sound(page);
  EXPECT_EQ(figures_in(page)["oriented"], 0);
  EXPECT_TRUE(figures_in(page)["chi2_per_dof"].is_null());
}

TEST(Report, WholeBlockWithFailures) {
  const BlockResult result = made_up_result(small_block());
  const std::string page = report_html(result);
  expect_sound(page);
  for (const char* id : {"map-section", "tie-points", "residuals", "positions", "control", "cameras", "accuracy",
                         "tiles", "failures", "stages"})
    EXPECT_THAT(page, HasSubstr("<section id=\"" + std::string(id) + "\"")) << id;
  EXPECT_THAT(page, HasSubstr("truncated JPEG"));
  EXPECT_THAT(page, HasSubstr("tile 2 disagrees"));
  EXPECT_THAT(page, HasSubstr("9f3b6c1d20a87e55"));
  EXPECT_THAT(page, HasSubstr(result.block.images[ImageIndex(3)].name));
  const auto json = figures_in(page);
  const ReprojectionStatistics statistics = reprojection_statistics(result);
  EXPECT_EQ(json["oriented"], 59);
  EXPECT_EQ(json["points"], statistics.points);
  EXPECT_EQ(json["observations"], statistics.observations);
  EXPECT_DOUBLE_EQ(json["rms_reprojection_px"], statistics.rms_px);
}

TEST(Report, StreetBlockWithRigs) {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kStreet;
  options.frames = 40;
  const std::string page = report_html(made_up_result(options));
  expect_sound(page);
  EXPECT_THAT(page, HasSubstr("Mounts"));
}

TEST(Report, NamesAreEscaped) {
  BlockResult result = made_up_result(small_block());
  const std::string evil = "<script>alert('x')</script>\"&";
  result.block.cameras[CameraIndex(0)].name = evil;
  result.block.frames[FrameIndex(0)].name = evil;
  result.block.control_points[0].name = evil;
  result.block.images[ImageIndex(3)].name = evil;
  result.block.ground.crs = evil;
  result.failures.push_back({evil, evil, evil});
  result.notes.push_back(evil);
  result.gauge = result.digest = evil;
  result.seams[0].note = result.stages[0].name = evil;
  const std::string page = report_html(result);
  expect_sound(page);
  EXPECT_THAT(page, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(page, HasSubstr("&lt;script&gt;alert(&#39;x&#39;)&lt;/script&gt;&quot;&amp;"));
  EXPECT_EQ(figures_in(page)["notes"].back(), evil);
}

TEST(Report, NotANumberIsNeverPrinted) {
  BlockResult result = made_up_result(small_block());
  const double nan = std::nan("");
  result.variance_factor = result.newton_decrement = nan;
  for (auto& point : result.points) point.setConstant(nan);
  for (auto& covariance : result.frame_covariance) covariance.setConstant(nan);
  for (auto& covariance : result.camera_covariance) covariance.setConstant(nan);
  for (auto& control : result.control) {
    control.adjusted.setConstant(nan);
    control.covariance.setConstant(nan);
    for (auto& residual : control.residual_px) residual.setConstant(nan);
  }
  result.block.control_points[0].position.z() = nan;
  result.stages[1].seconds = nan;
  result.stages[1].peak_rss_mib = nan;
  result.seams[0].statistic = nan;
  expect_sound(report_html(result));
  result.block.cameras[CameraIndex(0)].prior_sigma.fill(std::numeric_limits<double>::infinity());
  expect_sound(report_html(result));
}

TEST(Report, InvalidUtf8InNames) {
  BlockResult result = made_up_result(small_block());
  result.notes.push_back("\xff\xfe broken");
  EXPECT_NO_THROW(figures_in(report_html(result)));
}

TEST(ReportFigures, GnssResidualsApplyTheLeverArm) {
  BlockResult result = made_up_result(small_block());
  const Eigen::Vector3d lever(0.3, -0.2, 1.1), error(0.01, -0.02, 0.05);
  for (FrameIndex f(0); result.block.frames.contains(f); ++f.value) {
    const Pose& pose = result.state.frames[f];
    result.block.frames[f].position_prior =
        PositionPrior{pose.centre + pose.rotation.toRotationMatrix().transpose() * lever - error,
                      Eigen::Vector3d::Constant(0.05), lever};
  }
  const report::Figures figures = report::figures_of(result);
  ASSERT_EQ(figures.positions.size(), 59u);  // one frame is not oriented
  for (const auto& residual : figures.positions) EXPECT_LT((residual.difference - error).norm(), 1e-9);
}

TEST(ReportFigures, IntersectionAnglesAndTrackLengths) {
  BlockResult result;  // two photos 2 m apart, a point 1 m in front: rays cross at a right angle
  Camera camera;
  camera.name = "camera";
  camera.width = camera.height = 100;
  camera.intrinsics = {100, 50, 50, 0, 0, 0, 0, 0};
  result.block.cameras.push_back(camera);
  result.block.rigs.push_back({"rig", {Mount{CameraIndex(0), Pose{}, 0, 0}}});
  for (int i = 0; i < 2; ++i) {
    result.block.frames.push_back({});
    result.block.frames.back().rig = RigIndex(0);
    result.block.images.push_back({std::to_string(i), "", FrameIndex(i), 0, 0});
    result.state.frames.push_back({Eigen::Quaterniond::Identity(), Eigen::Vector3d(2.0 * i, 0, 0)});
    result.state.oriented.push_back(1);
  }
  result.state.cameras.push_back(result.block.cameras[CameraIndex(0)].intrinsics);
  result.state.mounts.push_back({Pose{}});
  result.tracks = {{TrackIndex(0)}, {0, 2}, {ImageIndex(0), ImageIndex(1)}, {102400, 0}, {51200, 51200}, {-1, -1}};
  result.points = {Eigen::Vector3d(1, 0, 1)};
  result.kept = {1, 1};
  result.residual_x = {3, 0};
  result.residual_y = {4, 0};
  const report::Figures figures = report::figures_of(result);
  EXPECT_EQ(figures.track_length.bins[0], 1);
  EXPECT_EQ(figures.intersection_deg.total(), 1);
  EXPECT_EQ(figures.intersection_deg.bins[17] + figures.intersection_deg.bins[18], 1);  // 90 degrees, to rounding
  EXPECT_NEAR(figures.ground_resolution_m, std::sqrt(2.0) / 100, 1e-12);
  EXPECT_DOUBLE_EQ(figures.reprojection.mean_px, 2.5);
  const report::ResidualField& field = figures.fields[CameraIndex(0)];
  EXPECT_EQ(field.observations, 2);
  EXPECT_EQ(field.mean(field.rows / 2, field.columns - 1), Eigen::Vector2d(3, 4));
}

TEST(ReportFigures, HistogramsAndSpreads) {
  report::Histogram histogram{0, 2, {0, 0, 0}};
  for (double v : {-1.0, 0.0, 1.9, 2.0, 5.0, 99.0, std::nan("")}) histogram.add(v);
  EXPECT_THAT(histogram.bins, testing::ElementsAre(3, 1, 2));
  std::vector<double> values;
  for (int i = 100; i >= 0; --i) values.push_back(i);
  const report::Spread spread = report::spread(values);
  EXPECT_EQ(spread.median, 50);
  EXPECT_EQ(spread.p95, 95);
  EXPECT_EQ(spread.largest, 100);
  EXPECT_TRUE(std::isnan(report::spread({}).median));
}

TEST(ReportNumbers, ReadWell) {
  EXPECT_EQ(report::count(27503), "27\u202f503");
  EXPECT_EQ(report::count(-1234567), "\u22121\u202f234\u202f567");
  EXPECT_EQ(report::count(999), "999");
  EXPECT_EQ(report::fixed(-0.0001, 2), "0.00");
  EXPECT_EQ(report::with_sign(0.0123, 3), "+0.012");
  EXPECT_EQ(report::with_sign(-0.0123, 3), "\u22120.012");
  EXPECT_EQ(report::fixed(std::nan(""), 2), report::kMissing);
  EXPECT_EQ(report::significant(0.012345), "0.0123");
  EXPECT_EQ(report::significant(12345), "12345");
  EXPECT_EQ(report::significant(3.1e-7, 2), "3.1\u00b710<sup>\u22127</sup>");
  EXPECT_EQ(report::percent(9999, 10000), "99.9\u202f%");
  EXPECT_EQ(report::percent(5, 5), "100\u202f%");
  EXPECT_EQ(report::percent(1, 0), report::kMissing);
  EXPECT_EQ(report::duration(0.44), "0.4\u202fs");
  EXPECT_EQ(report::duration(59.9), "1\u202fmin 00\u202fs");
  EXPECT_EQ(report::duration(7800), "2\u202fh 10\u202fmin");
  EXPECT_EQ(report::memory(2150), "2.1\u202fGiB");
  EXPECT_EQ(report::round_step(10, 5), 2);
  EXPECT_EQ(report::round_step(11, 5), 5);
  EXPECT_DOUBLE_EQ(report::round_step(0.7, 6), 0.2);
}

}  // namespace
}  // namespace megablock
