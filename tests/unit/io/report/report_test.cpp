#include "io/report/report.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "io/evaluation/figures.h"
#include "io/report/drawing/html.h"
#include "io/report/drawing/page.h"
#include "io/text/number_reader.h"
#include "tests/support/io/image_names.h"
#include "tests/support/io/made_up_result.h"

namespace megablock {
namespace {

using testing::HasSubstr;
using testing::Not;

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
  EXPECT_THAT(page, HasSubstr(result.block.name_of(ImageIndex(3))));
  const auto json = figures_in(page);
  const ReprojectionStatistics statistics = reprojection_statistics(result);
  EXPECT_EQ(json["oriented"], 59);
  EXPECT_EQ(json["points"], statistics.points);
  EXPECT_EQ(json["observations"], statistics.observations);
  EXPECT_DOUBLE_EQ(json["rms_reprojection_px"], statistics.rms_px);
}

TEST(Report, SaysWhatTheResultComesFrom) {
  const std::string page = report_html(made_up_result(small_block()), {"/data/jobs/harbour/", 1763719620});
  expect_sound(page);
  EXPECT_THAT(page, HasSubstr("Block report: harbour"));
  EXPECT_THAT(page, HasSubstr("2025-11-21 10:07 UTC"));
  for (const char* words : {"block.yaml", "megablock 0.1.0", "avx2", "matching.ratio", "merge.decrement"})
    EXPECT_THAT(visible_text(page), HasSubstr(words));
}

TEST(Report, IsCalledByTheProjectOrTheImageFolder) {
  BlockResult result = made_up_result(small_block());
  result.block.image_folder = "/data/flight/";
  EXPECT_THAT(report_html(result, {"/data/job", 0}), HasSubstr("<h1>Block report: flight</h1>"));
  result.provenance.project = "harbour-2024.yaml";
  EXPECT_THAT(report_html(result, {"/data/job", 0}), HasSubstr("<h1>Block report: harbour-2024</h1>"));
}

TEST(Report, ABlockThatDidNotConvergeIsSaidFirstAndInRed) {
  BlockResult result = made_up_result(small_block());
  EXPECT_THAT(report_html(result), Not(HasSubstr("not converged")));
  result.newton_decrement = 0.37;
  const std::string page = report_html(result);
  expect_sound(page);
  EXPECT_THAT(page,
              HasSubstr("<ul class=assessment>\n<li class=bad>The adjustment has <b>not converged</b>: the Newton "
                        "decrement is 0.37, the limit 0.010"));
  result.newton_decrement = std::nan("");
  EXPECT_THAT(report_html(result), HasSubstr("not converged"));
}

// A control point whose measurements are all rejected stays where it was given: that is no agreement.
TEST(Report, PointsThatNoMeasurementHoldsRaiseAnAlarm) {
  BlockResult result = made_up_result(small_block());
  EXPECT_THAT(report_html(result), Not(HasSubstr("no part")));
  std::size_t control = 0;
  while (result.block.control_points[control].role != PointRole::kControl) ++control;
  ControlPoint& given = result.block.control_points[control];
  given.name = "pillar";
  result.control[control].adjusted = given.position;
  result.control[control].kept.assign(given.measurements.size(), 0);
  result.control[control].residual_px[1] = {1.4e6, 0};
  const std::string page = report_html(result);
  expect_sound(page);
  const std::string image = result.block.name_of(given.measurements[1].image);
  EXPECT_THAT(page, HasSubstr("<li class=bad>1 control point takes no part: pillar (more than 100 000 px in " + image));
  EXPECT_THAT(page, HasSubstr("<tr class=\"bad\"><td class=t>pillar</td><td class=t>control</td><td>–</td>"
                              "<td>–</td><td>–</td>"));
  EXPECT_EQ(figures_in(page)["control_points_unused"], 1);
  EXPECT_EQ(figures_in(page)["check_points_unused"], 0);

  result.control[control].kept[0] = 1;  // one that holds
  EXPECT_THAT(report_html(result), Not(HasSubstr("no part")));
}

// Two halves without a common tie point.
BlockResult two_parts() {
  BlockResult result = made_up_result(small_block());
  result.block.control_points.clear();
  result.control.clear();
  const auto first_half = [&](std::size_t o) { return result.block.images[result.tracks.image[o]].frame.value < 30; };
  for (std::size_t t = 0; t + 1 < result.tracks.begin.size(); ++t)
    for (auto o = static_cast<std::size_t>(result.tracks.begin[t]);
         o < static_cast<std::size_t>(result.tracks.begin[t + 1]); ++o)
      if (first_half(o) != first_half(static_cast<std::size_t>(result.tracks.begin[t]))) result.kept[o] = 0;
  return result;
}

std::size_t count_of(const std::string& text, const std::string& word) {
  std::size_t n = 0;
  for (std::size_t i = text.find(word); i != std::string::npos; i = text.find(word, i + 1)) ++n;
  return n;
}

TEST(Report, PartsWithoutADatumHaveMapsOfTheirOwn) {
  BlockResult result = two_parts();
  const report::Figures figures = report::figures_of(result);
  ASSERT_EQ(figures.parts.size(), 2u);
  EXPECT_EQ(figures.parts[0].frames, 30);
  EXPECT_EQ(figures.parts[1].frames, 29);  // one is not oriented
  for (FrameIndex f(0); f.value < 60; ++f.value)
    EXPECT_EQ(figures.part_of_frame[f], f.value == 3 ? -1 : f.value < 30 ? 1 : 0);
  const std::string placed = report_html(result);
  EXPECT_EQ(count_of(placed, "aria-label=\"Map of the block\""), 1u);
  EXPECT_THAT(placed, HasSubstr("only its own positions or control points place each of them"));

  result.free_parts = {{FrameIndex(0), 7}, {FrameIndex(30), 7}};
  const std::string free = report_html(result);
  expect_sound(free);
  EXPECT_EQ(count_of(free, "aria-label=\"Map of the block\""), 2u);
  EXPECT_THAT(free, HasSubstr("<li class=bad>The block consists of 2 parts"));
  EXPECT_THAT(free, HasSubstr("are arbitrary, also relative to the other parts"));
  EXPECT_THAT(free, Not(HasSubstr(" km</text>")));  // a free scale is not in metres
}

TEST(Report, LengthsOfAnArbitraryScaleAreNotMetres) {
  BlockResult result = made_up_result(small_block());
  BlockDiagnostics diagnostics;
  diagnostics.gaps.push_back({false, FrameIndex(1), FrameIndex(2), {0, 0}, {6, 0}, 1, 6.25});
  ReportContext context;
  context.diagnostics = &diagnostics;
  const auto metric = testing::AnyOf(HasSubstr("E [m]"), HasSubstr("E [mm]"), HasSubstr("east [mm]"),
                                     HasSubstr("distance [m]"), HasSubstr("E, N [m]"));
  const auto in_sections = [&] {  // residuals of positions and control stay in metres
    std::string page = report_html(result, context), kept;
    expect_sound(page);
    for (const char* id : {"map-section", "coverage", "diagnostics", "images", "accuracy"}) {
      const std::size_t at = page.find("<section id=\"" + std::string(id) + "\"");
      EXPECT_NE(at, std::string::npos) << id;
      if (at != std::string::npos) kept += page.substr(at, page.find("</section>", at) - at);
    }
    return kept + page.substr(page.find("<div class=cards>"),
                              page.find("per pixel in object space") - page.find("<div class=cards>"));
  };
  EXPECT_THAT(in_sections(), testing::AllOf(HasSubstr("E [m]"), HasSubstr("σE [mm]"), HasSubstr("distance [m]"),
                                            Not(HasSubstr("units]")), Not(HasSubstr("<i> units</i>"))));
  for (const std::int32_t defect : {4, 7}) {
    result.free_parts = {{FrameIndex(0), defect}};
    EXPECT_THAT(in_sections(),
                testing::AllOf(HasSubstr("<i> units</i>"), HasSubstr("E [units]"), HasSubstr("σE [units]"),
                               HasSubstr("frames, east [units]"), HasSubstr("distance [units]"),
                               HasSubstr("whose scale is arbitrary"), Not(metric)))
        << defect;
  }
  result.free_parts = {{FrameIndex(0), 1}};  // a rotation about a line
  EXPECT_THAT(in_sections(), Not(HasSubstr("units]")));
}

TEST(Report, JointsThatShareNothingAreNotGood) {
  BlockResult result = made_up_result(small_block());
  result.seams = {{4, 0, 0, 0, ""}};
  EXPECT_THAT(report_html(result),
              HasSubstr("<li class=look>The joint of the merge tree joins parts without common unknowns"));
  result.seams.push_back({5, 30, 40, 81, ""});
  EXPECT_THAT(report_html(result),
              HasSubstr("the tiles agree at the joint of the merge tree that was tested. 1 more joins "
                        "parts without common unknowns"));
}

TEST(Report, ImagesAreListedUpToALimit) {
  BlockResult result = made_up_result(small_block());
  const std::string page = report_html(result);
  const std::size_t table = page.find("<section id=\"images\"");
  ASSERT_NE(table, std::string::npos);
  const std::string part = page.substr(table, page.find("</section>", table) - table);
  EXPECT_EQ(count_of(part, "<tr>") - 1, 59u);
  EXPECT_THAT(part, HasSubstr("8\u202f010"));  // features of an image
  SimulationOptions large = small_block();
  large.frames = 2000;
  large.points_per_frame = 12;
  const std::string long_page = report_html(made_up_result(large));
  EXPECT_THAT(long_page, HasSubstr("The 1\u202f500 images with the largest residuals of 1\u202f999"));
}

TEST(Report, FailedImagesWithWhatIsKnownOfThem) {
  BlockResult result = made_up_result(small_block());
  const std::string name = result.block.name_of(ImageIndex(3));
  result.failures = {{"init", "gone.jpg", "is empty"}, {"orientation", name, "too few points"}};
  const std::string page = report_html(result);
  expect_sound(page);
  const std::size_t row = page.find("<td class=t>" + name, page.find("id=\"failures\""));
  ASSERT_NE(row, std::string::npos);
  const std::string cells = page.substr(row, page.find("</tr>", row) - row);
  std::int64_t measured = 0;
  for (const ImageIndex image : result.tracks.image) measured += image.value == 3;
  for (const std::string& cell : {std::string("too few points"), std::string("1920 × 1280"), std::string("8\u202f003"),
                                  std::string("12"), std::string("3\u202f400"), report::count(measured)})
    EXPECT_THAT(cells, HasSubstr(">" + cell + "<"));
}

TEST(Report, StreetBlockWithRigs) {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kStreet;
  options.frames = 40;
  const std::string page = report_html(made_up_result(options));
  expect_sound(page);
  EXPECT_THAT(page, HasSubstr("Mounts"));
  EXPECT_THAT(page, Not(HasSubstr("σx")));  // all are held
}

TEST(Report, SigmasOfFreeMounts) {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kStereopolis;
  options.frames = 40;
  options.rig_cameras = 4;
  BlockResult result = made_up_result(options);
  auto& covariances = result.mount_covariance[RigIndex(0)];
  covariances[3].setZero();  // no image tells of it
  const auto cells = [](const std::string& page, const std::string& mount) {
    const std::size_t row = page.find("<td class=t>" + mount, page.find("<h3>Mounts"));
    return page.substr(row, page.find("</tr>", row) - row);
  };
  const std::string page = report_html(result);
  expect_sound(page);
  EXPECT_THAT(cells(page, "1 "), HasSubstr("<td>1.00</td><td>2.00</td><td>3.00</td>"
                                           "<td>0.0057</td><td>0.011</td><td>0.017</td>"));
  EXPECT_THAT(cells(page, "0 "), HasSubstr("<td>held</td><td>held</td><td></td>"));
  EXPECT_THAT(cells(page, "3 "), HasSubstr("<td>–</td><td>–</td><td>–</td><td>–</td><td>–</td><td>–</td>"));
  const auto mount = figures_in(page)["mounts"][1];
  EXPECT_EQ(mount["camera"], result.block.cameras[result.block.rigs[RigIndex(0)].mounts[1].camera].name);
  EXPECT_NEAR(mount["sigma_position_m"][2].get<double>(), 3e-3, 1e-12);
  EXPECT_NEAR(mount["sigma_rotation_rad"][0].get<double>(), 1e-4, 1e-12);

  for (auto& covariance : covariances) covariance.setConstant(std::nan(""));
  expect_sound(report_html(result));
  result.mount_covariance.clear();
  EXPECT_THAT(report_html(result), Not(HasSubstr("σx")));
}

TEST(Report, NamesAreEscaped) {
  BlockResult result = made_up_result(small_block());
  const std::string evil = "<script>alert('x')</script>\"&";
  result.block.cameras[CameraIndex(0)].name = evil;
  result.block.frames[FrameIndex(0)].name = evil;
  result.block.control_points[0].name = evil;
  rename_images(result.block, [&](ImageIndex i) { return i.value == 3 ? evil : result.block.name_of(i); });
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

// The sigma of a difference, by drawing many: a check point takes no part, a control point is pulled towards its given
// place, here by an observation of equal weight.
TEST(ReportFigures, SigmasOfControlAndCheckPoints) {
  BlockResult result = made_up_result(small_block());
  const double given = 0.02, alone = 0.03, adjusted = 1 / std::sqrt(1 / (given * given) + 1 / (alone * alone));
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  double check_squares = 0, control_squares = 0;
  const int draws = 200000;
  for (int i = 0; i < draws; ++i) {
    const double l = given * normal(random), x = alone * normal(random);
    const double together = adjusted * adjusted * (l / (given * given) + x / (alone * alone));
    check_squares += (x - l) * (x - l) / draws;
    control_squares += (together - l) * (together - l) / draws;
  }
  for (std::size_t p = 0; p < result.block.control_points.size(); ++p) {
    ControlPoint& point = result.block.control_points[p];
    point.sigma.setConstant(given);
    const double sigma = point.role == PointRole::kCheck ? alone : adjusted;
    result.control[p].covariance = Eigen::Matrix3d::Identity() * sigma * sigma;
    result.control[p].adjusted = point.position + Eigen::Vector3d(0, -0.06, 0.01);
  }
  for (const report::PointResidual& r : report::figures_of(result).points) {
    const bool check = result.block.control_points[r.point].role == PointRole::kCheck;
    const double expected = std::sqrt(check ? check_squares : control_squares);
    EXPECT_NEAR(r.sigma.x(), expected, 0.01 * expected);
    EXPECT_NEAR(r.ratio, 0.06 / expected, 0.02 * r.ratio);
  }
  const std::string page = report_html(result);
  expect_sound(page);
  EXPECT_THAT(page, HasSubstr("<li class=look>4 of 4 control points differ by more than 3 sigma"));
}

TEST(Report, CorrelationsAndInsignificantParameters) {
  BlockResult result = made_up_result(small_block());
  const CameraIndex camera(0);
  result.state.cameras[camera][3] = 1e-6;  // k1, sigma 1e-5
  result.state.cameras[camera][4] = 1e-3;
  const std::string page = report_html(result);
  EXPECT_THAT(page, HasSubstr("\u22120.90</span>"));
  EXPECT_THAT(page, HasSubstr("<tr class=\"weak\"><td class=t>k1"));
  EXPECT_THAT(page, Not(HasSubstr("<tr class=\"weak\"><td class=t>k2")));
}

}  // namespace
}  // namespace megablock
