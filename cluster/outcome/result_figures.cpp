#include "cluster/outcome/result_figures.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "cluster/outcome/diagnostics.h"
#include "io/evaluation/evaluate.h"
#include "io/evaluation/feature_statistics.h"
#include "io/evaluation/remarks/control_remarks.h"
#include "io/evaluation/remarks/remarks.h"
#include "io/report/sections/sections.h"
#include "io/result/track_batches.h"

namespace megablock {

namespace {

using Json = nlohmann::json;

Json observation_kinds(const ObservationTable& table) {
  Json kinds = Json::object();
  for (std::size_t k = 0; k < kObservationKinds; ++k) {
    const ObservationStatistics& s = table.kinds[k];
    if (s.count == 0) continue;
    const double factor = s.sigma_factor();
    kinds[word_of(static_cast<ObservationKind>(k))] = {{"count", s.count},
                                                       {"redundancy", s.redundancy},
                                                       {"sigma_factor", std::isfinite(factor) ? Json(factor) : Json()}};
  }
  return kinds;
}

Json interest_points(const BlockResult& result) {
  Json list = Json::array();
  const auto statistics = feature_statistics(result);
  for (CameraIndex c(0); statistics.contains(c); ++c.value) {
    const FeatureStatistics& s = statistics[c];
    if (s.images == 0) continue;
    list.push_back({{"camera", result.block.cameras[c].name},
                    {"images", s.images},
                    {"least", s.least},
                    {"most", s.most},
                    {"mean", s.mean()},
                    {"total", s.total}});
  }
  return list;
}

Json number_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(); }

Json check_points(const BlockResult& result) {
  const Evaluation evaluation = evaluate_control(result);
  return {{"compared", evaluation.check_points},
          {"rms_horizontal_m", number_or_null(evaluation.check_rms_horizontal_m)},
          {"rms_vertical_m", number_or_null(evaluation.check_rms_vertical_m)},
          {"normalised_error", number_or_null(evaluation.normalised_error_check)}};
}

Json seams(const BlockResult& result) {
  std::int64_t tested = 0, alarms = 0;
  double largest = 0;
  for (const SeamCheck& seam : result.seams) {
    tested += seam.degrees > 0;
    if (!report::alarms(seam)) continue;
    ++alarms;
    largest = std::max(largest, report::sigmas_apart(seam));
  }
  return {{"tested", tested}, {"alarms", alarms}, {"largest_sigmas", largest}};
}

// The notes of a job, without those that seams and failures already give.
Json notes(const BlockResult& result) {
  Json list = Json::array();
  for (const std::string& note : result.notes)
    if (std::ranges::find(result.seams, note, &SeamCheck::note) == result.seams.end() &&
        std::ranges::find(result.failures, note, &FailedUnit::reason) == result.failures.end())
      list.push_back(note);
  return list;
}

Json failures(const BlockResult& result) {
  Json list = Json::array();
  for (const FailedUnit& failure : result.failures)
    list.push_back({{"stage", failure.stage}, {"unit", failure.unit}, {"reason", failure.reason}});
  return list;
}

// The figures that were stored for the present result, or an empty text if there are none.
std::string written_figures(const JobStore& store) {
  std::ifstream file(store.path(kResultFigures));
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const Json json = Json::parse(text, nullptr, false);
  const bool complete = json.is_object() && json.contains("notes");  // older programs stored no notes
  const bool of_result = complete && json.value("digest", "") == read_result_digest(store.path(kResult));
  return of_result ? text : std::string();
}

}  // namespace

std::string to_json(const ResultFigures& figures, const BlockResult& result) {
  const Json json = {{"images", result.block.images.size()},
                     {"oriented", figures.statistics.oriented_images},
                     {"points", figures.statistics.points},
                     {"observations", figures.statistics.observations},
                     {"mean_track_length", figures.statistics.mean_track_length},
                     {"mean_reprojection_px", figures.statistics.mean_px},
                     {"rms_reprojection_px", figures.statistics.rms_px},
                     {"chi2_per_dof", result.variance_factor},
                     {"degrees_of_freedom", result.degrees_of_freedom},
                     {"image_sigma_px", result.image_sigma_px},
                     {"observation_kinds", observation_kinds(result.observation_table)},
                     {"tiles", result.tiles.tile_count},
                     {"boundary_frames", std::count(result.boundary.begin(), result.boundary.end(), 1)},
                     {"global_iterations", result.global_iterations},
                     {"newton_decrement", result.newton_decrement},
                     {"gauge", result.gauge},
                     {"control_points_unused", unused_points(result, PointRole::kControl).size()},
                     {"check_points_unused", unused_points(result, PointRole::kCheck).size()},
                     {"interest_points", interest_points(result)},
                     {"check_points", check_points(result)},
                     {"seams", seams(result)},
                     {"remarks", figures.remarks},
                     {"notes", notes(result)},
                     {"failures", failures(result)},
                     {"digest", result.digest}};
  return json.dump(1, ' ', false, Json::error_handler_t::replace);
}

std::string result_figures(const JobStore& store) {
  const std::string path = store.verified_path(kResult);
  if (std::string written = written_figures(store); !written.empty()) return written;
  const BlockResult result = read_result_without_tracks(path);
  const StoredTracks tracks(path);
  ResultFigures figures{reprojection_statistics(result, tracks), remarks(result, tracks)};
  const BlockDiagnostics diagnostics = diagnose_result(result, tracks, options_of_job(store).diagnostics);
  std::ranges::move(loose_part_remarks(diagnostics, result.block), std::back_inserter(figures.remarks));
  return to_json(figures, result);
}

std::vector<std::string> result_remarks(const JobStore& store) {
  if (!store.seal(kResult)) return {};
  return Json::parse(result_figures(store)).at("remarks");
}

std::string look_text(const std::vector<std::string>& remarks) {
  std::string text;
  for (const std::string& remark : remarks) text += "  look: " + remark + "\n";
  return text;
}

}  // namespace megablock
