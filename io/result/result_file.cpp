// Reads and writes result/block.h5 (docs/reference/file-formats.md, "Result").
//
// The digest is an attribute at the end, because it is complete only when all tracks have been written. Readers treat
// groups that later programs added as optional, so older results stay readable.
#include <algorithm>
#include <utility>

#include "io/base/error.h"
#include "io/result/result.h"
#include "io/result/result_digest.h"
#include "io/result/result_precision.h"
#include "io/result/result_tracks.h"
#include "io/result/track_batches.h"
#include "io/store/hdf5/hdf5_matrices.h"
#include "io/store/hdf5/hdf5_tables.h"
#include "io/store/units/hdf5_block.h"
#include "io/store/units/hdf5_state.h"
#include "io/store/units/hdf5_tiles.h"

namespace megablock {

namespace {

void check_sizes(const BlockResult& result) {
  require_size(result.state.frames.size(), result.block.frames.size(), "frame poses");
  require_size(result.boundary.size(), result.block.frames.size(), "boundary flags");
  for (RigIndex rig(0); result.mount_covariance.contains(rig); ++rig.value)
    require_size(result.mount_covariance[rig].size(), result.block.rigs[rig].mounts.size(), "covariances of mounts");
  if (!result.control.empty())
    require_size(result.control.size(), result.block.control_points.size(), "control point results");
  for (std::size_t p = 0; p < result.control.size(); ++p) {
    require_size(result.control[p].residual_px.size(), result.block.control_points[p].measurements.size(),
                 "residuals of a control point");
    if (!result.control[p].kept.empty())
      require_size(result.control[p].kept.size(), result.control[p].residual_px.size(), "verdicts on measurements");
  }
  if (!result.image_records.empty())
    require_size(result.image_records.size(), result.block.images.size(), "image records");
}

std::int64_t rows(const auto& items) { return static_cast<std::int64_t>(items.size()); }

void put_control_results(Hdf5Writer& file, const BlockResult& of) {
  const std::vector<BlockResult::ControlResult>& control = of.control;
  if (control.empty()) return;
  using Result = BlockResult::ControlResult;
  file.matrix("control/adjusted", vectors3(control, [](const Result& c) { return c.adjusted; }), 3,
              {"m", "ground frame; NaN: not seen by two oriented images"});
  file.array("control/covariance", flattened<double>(column(control, [](const Result& c) { return c.covariance; })),
             {rows(control), 3, 3}, {"m^2", "posterior, of the adjusted position"});
  if (!of.empirical.control.empty())
    file.array("control/empirical_covariance", flattened<double>(of.empirical.control),
               {rows(of.empirical.control), 3, 3}, {"m^2", "the same from the residuals"});
  std::vector<double> residuals;
  for (const Result& result : control)
    for (const Eigen::Vector2d& r : result.residual_px) residuals.insert(residuals.end(), {r.x(), r.y()});
  file.matrix("control/measurement/residual", residuals, 2,
              {"px", "adjusted minus measured, x, y; NaN: image not oriented"});
  std::vector<std::uint8_t> kept;
  for (const Result& result : control) kept.insert(kept.end(), result.kept.begin(), result.kept.end());
  // Only if every point has verdicts; a part of them could not be assigned.
  if (2 * kept.size() == residuals.size())
    file.vector("control/measurement/kept", kept, {"", "1: kept, 0: takes no part"});
}

std::vector<BlockResult::ControlResult> get_control_results(const Hdf5Reader& file, const Block& block) {
  if (!file.has("control/adjusted")) return {};
  const std::int64_t count = rows(block.control_points);
  const auto adjusted = file.matrix<double>("control/adjusted", 3, count);
  const auto covariances = square_matrices<Eigen::Matrix3d>(file.array<double>("control/covariance", {count, 3, 3}));
  const auto residuals =
      file.matrix<double>("control/measurement/residual", 2, file.shape("control/measurement/image").at(0));
  const bool verdicts = file.has("control/measurement/kept");
  const auto kept = verdicts ? file.vector<std::uint8_t>("control/measurement/kept", rows(residuals) / 2)
                             : std::vector<std::uint8_t>();
  std::vector<BlockResult::ControlResult> control;
  std::size_t row = 0;
  for (std::size_t p = 0; p < block.control_points.size(); ++p) {
    BlockResult::ControlResult result{vector3(adjusted, p), covariances[p], {}};
    for (std::size_t m = 0; m < block.control_points[p].measurements.size(); ++m, ++row) {
      result.residual_px.push_back({residuals[2 * row], residuals[2 * row + 1]});
      if (verdicts) result.kept.push_back(kept[row]);
    }
    control.push_back(std::move(result));
  }
  return control;
}

void put_figures(Hdf5Writer& file, const BlockResult& result) {
  file.attribute("/", "variance_factor", result.variance_factor);
  file.attribute("/", "chi2", result.chi2);
  file.attribute("/", "degrees_of_freedom", result.degrees_of_freedom);
  file.attribute("/", "image_sigma_px", result.image_sigma_px);
  file.attribute("/", "sigma_scaled", static_cast<std::uint8_t>(result.sigma_scaled));
  file.attribute("/", "global_iterations", result.global_iterations);
  file.attribute("/", "newton_decrement", result.newton_decrement);
  file.attribute("/", "newton_decrement_limit", result.decrement_limit);
  file.attribute("/", "gauge", result.gauge);
  file.attribute("/", "digest", result.digest);
}

void get_figures(const Hdf5Reader& file, BlockResult& result) {
  result.variance_factor = file.attribute<double>("/", "variance_factor");
  result.chi2 = file.attribute<double>("/", "chi2");
  result.degrees_of_freedom = file.attribute<std::int64_t>("/", "degrees_of_freedom");
  result.image_sigma_px = file.attribute<double>("/", "image_sigma_px");
  result.sigma_scaled = file.attribute<std::uint8_t>("/", "sigma_scaled") != 0;
  result.global_iterations = file.attribute<int>("/", "global_iterations");
  result.newton_decrement = file.attribute<double>("/", "newton_decrement");
  if (file.has_attribute("/", "newton_decrement_limit"))
    result.decrement_limit = file.attribute<double>("/", "newton_decrement_limit");
  result.gauge = file.text_attribute("/", "gauge");
  result.digest = file.text_attribute("/", "digest");
}

// The first kinds of the table have a row even without observations. This keeps the files equal to those of earlier
// programs, which wrote them always.
constexpr std::size_t kKindsOfEveryResult = 14;

void put_observation_table(Hdf5Writer& file, const ObservationTable& table) {
  std::vector<std::string> words;
  std::vector<ObservationStatistics> kinds;
  for (std::size_t k = 0; k < kObservationKinds; ++k) {
    if (k >= kKindsOfEveryResult && table.kinds[k].count == 0) continue;
    words.push_back(word_of(static_cast<ObservationKind>(k)));
    kinds.push_back(table.kinds[k]);
  }
  file.group("statistics", "of the observations, by kind");
  file.texts("statistics/kind", words);
  file.vector("statistics/count", column(kinds, [](const ObservationStatistics& s) { return s.count; }),
              {"", "scalar residuals"});
  file.vector("statistics/weighted_squares",
              column(kinds, [](const ObservationStatistics& s) { return s.weighted_squares; }),
              {"", "sum of (residual / sigma)^2, with the weights of the robust loss"});
  file.vector("statistics/redundancy", column(kinds, [](const ObservationStatistics& s) { return s.redundancy; }),
              {"", "sum of redundancy numbers"});
  file.vector("statistics/scale", column(kinds, [](const ObservationStatistics& s) { return s.scale; }),
              {"", "sigma of the adjustment over the stated one"});
}

// Reads the kinds by their words. Results of earlier programs have no such table.
void get_observation_table(const Hdf5Reader& file, ObservationTable& table) {
  if (!file.has("statistics")) return;
  const std::vector<std::string> words = file.texts("statistics/kind");
  const auto count = file.vector<std::int64_t>("statistics/count", rows(words));
  const auto squares = file.vector<double>("statistics/weighted_squares", rows(words));
  const auto redundancy = file.vector<double>("statistics/redundancy", rows(words));
  const auto scale = file.vector<double>("statistics/scale", rows(words));
  for (std::size_t row = 0; row < words.size(); ++row)
    for (std::size_t k = 0; k < kObservationKinds; ++k)
      if (words[row] == word_of(static_cast<ObservationKind>(k)))
        table.kinds[k] = {count[row], squares[row], redundancy[row], scale[row]};
}

void put_seams(Hdf5Writer& file, const std::vector<SeamCheck>& seams) {
  file.group("seams", "chi-square test of each merge of two groups of tiles");
  file.vector("seams/node", column(seams, [](const SeamCheck& s) { return s.node; }), {"", "of the merge tree"});
  file.vector("seams/statistic", column(seams, [](const SeamCheck& s) { return s.statistic; }));
  file.vector("seams/degrees", column(seams, [](const SeamCheck& s) { return s.degrees; }));
  file.vector("seams/threshold", column(seams, [](const SeamCheck& s) { return s.threshold; }));
  file.texts("seams/note", column(seams, [](const SeamCheck& s) { return s.note; }));
}

std::vector<SeamCheck> get_seams(const Hdf5Reader& file) {
  const auto node = file.vector<std::int64_t>("seams/node");
  const auto statistic = file.vector<double>("seams/statistic", rows(node));
  const auto degrees = file.vector<std::int64_t>("seams/degrees", rows(node));
  const auto threshold = file.vector<double>("seams/threshold", rows(node));
  const std::vector<std::string> note = file.texts("seams/note", rows(node));
  std::vector<SeamCheck> seams;
  for (std::size_t i = 0; i < node.size(); ++i)
    seams.push_back({node[i], statistic[i], degrees[i], threshold[i], note[i]});
  return seams;
}

void put_record(Hdf5Writer& file, const BlockResult& result) {
  const std::vector<FailedUnit>& failures = result.failures;
  file.group("failures", "images and units that failed");
  file.texts("failures/stage", column(failures, [](const FailedUnit& f) { return f.stage; }));
  file.texts("failures/unit", column(failures, [](const FailedUnit& f) { return f.unit; }));
  file.texts("failures/reason", column(failures, [](const FailedUnit& f) { return f.reason; }));
  const std::vector<StageStatistics>& stages = result.stages;
  file.group("stages", "what the stages took");
  file.texts("stages/name", column(stages, [](const StageStatistics& s) { return s.name; }));
  file.vector("stages/seconds", column(stages, [](const StageStatistics& s) { return s.seconds; }),
              {"s", "wall clock"});
  file.vector("stages/peak_rss", column(stages, [](const StageStatistics& s) { return s.peak_rss_mib; }),
              {"MiB", "largest of the ranks"});
  file.vector("stages/units", column(stages, [](const StageStatistics& s) { return s.units; }));
  file.vector("stages/failed", column(stages, [](const StageStatistics& s) { return s.failed; }));
  file.texts("notes", result.notes, {"", "warnings, one line each"});
}

void get_record(const Hdf5Reader& file, BlockResult& result) {
  const std::vector<std::string> stage = file.texts("failures/stage");
  const std::vector<std::string> unit = file.texts("failures/unit", rows(stage));
  const std::vector<std::string> reason = file.texts("failures/reason", rows(stage));
  for (std::size_t i = 0; i < stage.size(); ++i) result.failures.push_back({stage[i], unit[i], reason[i]});
  const std::vector<std::string> name = file.texts("stages/name");
  const auto seconds = file.vector<double>("stages/seconds", rows(name));
  const auto peak = file.vector<double>("stages/peak_rss", rows(name));
  const auto units = file.vector<std::int64_t>("stages/units", rows(name));
  const auto failed = file.vector<std::int64_t>("stages/failed", rows(name));
  for (std::size_t i = 0; i < name.size(); ++i)
    result.stages.push_back({name[i], seconds[i], peak[i], units[i], failed[i]});
  result.notes = file.texts("notes");
}

void put_provenance(Hdf5Writer& file, const Provenance& provenance) {
  file.attribute("/", "project", provenance.project);
  file.attribute("/", "program", provenance.program);
  file.attribute("/", "arithmetic", provenance.arithmetic);
  const std::vector<OptionRecord>& options = provenance.options;
  file.group("options", "of the stages, as a project file would give them");
  file.texts("options/name", column(options, [](const OptionRecord& o) { return o.name; }), {"", "section.key"});
  file.texts("options/value", column(options, [](const OptionRecord& o) { return o.value; }));
  file.texts("options/default", column(options, [](const OptionRecord& o) { return o.default_value; }));
}

// Reads the origin of the result, which results of earlier programs lack.
void get_provenance(const Hdf5Reader& file, Provenance& provenance) {
  if (!file.has("options")) return;
  provenance.project = file.text_attribute("/", "project");
  provenance.program = file.text_attribute("/", "program");
  provenance.arithmetic = file.text_attribute("/", "arithmetic");
  const std::vector<std::string> name = file.texts("options/name");
  const std::vector<std::string> value = file.texts("options/value", rows(name));
  const std::vector<std::string> standard = file.texts("options/default", rows(name));
  for (std::size_t i = 0; i < name.size(); ++i) provenance.options.push_back({name[i], value[i], standard[i]});
}

void put_image_records(Hdf5Writer& file, const IndexedVector<ImageIndex, ImageRecord>& records) {
  if (records.empty()) return;
  std::vector<std::int32_t> size;
  for (const ImageRecord& record : records) size.insert(size.end(), {record.width, record.height});
  file.matrix("images/size", size, 2, {"px", "width, height of the decoded image; -1: not known"});
  const auto put = [&](const char* name, std::int64_t ImageRecord::*member, const char* description) {
    file.vector(name, column(records, [&](const ImageRecord& r) { return r.*member; }), {"", description});
  };
  put("images/features", &ImageRecord::features, "number of keypoints");
  put("images/matched_images", &ImageRecord::matched_images, "number of images with verified matches");
  put("images/matches", &ImageRecord::matches, "number of verified matches in these pairs");
}

void get_image_records(const Hdf5Reader& file, BlockResult& result) {
  if (!file.has("images/matched_images")) return;
  const std::int64_t count = rows(result.block.images);
  const auto size = file.matrix<std::int32_t>("images/size", 2, count);
  const auto features = file.vector<std::int64_t>("images/features", count);
  const auto matched = file.vector<std::int64_t>("images/matched_images", count);
  const auto matches = file.vector<std::int64_t>("images/matches", count);
  for (std::size_t i = 0; i < features.size(); ++i)
    result.image_records.push_back({size[2 * i], size[2 * i + 1], features[i], matched[i], matches[i]});
}

void put_free_parts(Hdf5Writer& file, const std::vector<FreePart>& parts) {
  file.group("free_parts", "connected parts of the block whose place nothing fixes completely");
  file.vector("free_parts/frame", column(parts, [](const FreePart& p) { return p.frame.value; }),
              {"", "its first one"});
  file.vector("free_parts/defect", column(parts, [](const FreePart& p) { return p.defect; }), {"", "of its datum"});
}

void get_free_parts(const Hdf5Reader& file, BlockResult& result) {
  if (!file.has("free_parts")) return;
  const auto frame = file.vector<std::int64_t>("free_parts/frame");
  const auto defect = file.vector<std::int32_t>("free_parts/defect", rows(frame));
  for (std::size_t i = 0; i < frame.size(); ++i) {
    if (frame[i] < 0 || frame[i] >= rows(result.block.frames))
      file.fail("free_parts/frame", "names a frame that is not there");
    result.free_parts.push_back({FrameIndex(frame[i]), defect[i]});
  }
}

void put_position_scales(Hdf5Writer& file, const BlockResult& result) {
  const std::vector<PositionScale>& scales = result.position_scales;
  if (scales.empty()) return;
  file.group("position_scales", "sigma of the adjustment over the stated one, of groups of positions");
  file.vector("position_scales/group", column(scales, [](const PositionScale& s) { return s.group.value; }),
              {"", "rows of rigs"});
  file.vector("position_scales/horizontal", column(scales, [](const PositionScale& s) { return s.horizontal; }));
  file.vector("position_scales/height", column(scales, [](const PositionScale& s) { return s.height; }));
}

void get_position_scales(const Hdf5Reader& file, BlockResult& result) {
  if (!file.has("position_scales")) return;
  const auto group = file.vector<std::int64_t>("position_scales/group");
  const auto horizontal = file.vector<double>("position_scales/horizontal", rows(group));
  const auto height = file.vector<double>("position_scales/height", rows(group));
  for (std::size_t row = 0; row < group.size(); ++row) {
    if (!result.block.rigs.contains(RigIndex(group[row])))
      file.fail("position_scales/group", "names a rig that is not there");
    result.position_scales.push_back({RigIndex(group[row]), horizontal[row], height[row]});
  }
}

void put_set_aside(Hdf5Writer& file, const BlockResult& result) {
  file.group("set_aside", "observations that contradict the rest of the block and take no part");
  file.vector("set_aside/position", column(result.positions_aside, [](FrameIndex f) { return f.value; }),
              {"", "frames"});
  file.vector("set_aside/control", result.control_aside, {"", "rows of control"});
}

void get_set_aside(const Hdf5Reader& file, BlockResult& result) {
  if (!file.has("set_aside")) return;
  const auto checked = [&](const char* name, std::int64_t behind) {
    auto list = file.vector<std::int64_t>(name);
    for (const std::int64_t row : list)
      if (row < 0 || row >= behind) file.fail(name, "names a row that is not there");
    return list;
  };
  for (const std::int64_t frame : checked("set_aside/position", rows(result.block.frames)))
    result.positions_aside.emplace_back(frame);
  result.control_aside = checked("set_aside/control", rows(result.block.control_points));
}

}  // namespace

namespace {

// The groups of the file before the tracks, and those after them.
void put_head(Hdf5Writer& file, const BlockResult& result) {
  put_provenance(file, result.provenance);
  put_block(file, result.block);
  put_image_records(file, result.image_records);
  put_state(file, result.state);
  file.vector("frames/boundary", result.boundary, {"", "1: touched by observations of two or more tiles"});
  put_tiles(file, result.tiles);
  file.link("tiles/tile_of_frame", "frames/tile");
  put_precision(file, result);
}

void put_tail(Hdf5Writer& file, const BlockResult& result) {
  put_control_results(file, result);
  put_set_aside(file, result);
  put_position_scales(file, result);
  put_free_parts(file, result.free_parts);
  put_observation_table(file, result.observation_table);
  put_seams(file, result.seams);
  put_record(file, result);
  put_figures(file, result);
}

// Small files are made in memory; large ones are written to disk while they grow.
Hdf5Storage storage_for(const TrackBatches& tracks) {
  constexpr std::int64_t kMostInMemory = 1 << 20;
  return tracks.track_count() > kMostInMemory ? Hdf5Storage::kDisk : Hdf5Storage::kMemory;
}

BlockResult get_head_and_tail(const Hdf5Reader& file) {
  BlockResult result;
  get_figures(file, result);
  get_provenance(file, result.provenance);
  result.block = get_block(file);
  get_image_records(file, result);
  result.state = get_state(file);
  result.boundary =
      IndexedVector<FrameIndex, std::uint8_t>(file.vector<std::uint8_t>("frames/boundary", rows(result.block.frames)));
  result.tiles = get_tiles(file);
  get_precision(file, result);
  result.control = get_control_results(file, result.block);
  if (file.has("control/empirical_covariance"))
    result.empirical.control = square_matrices<Eigen::Matrix3d>(
        file.array<double>("control/empirical_covariance", {rows(result.block.control_points), 3, 3}));
  get_set_aside(file, result);
  get_position_scales(file, result);
  get_free_parts(file, result);
  get_observation_table(file, result.observation_table);
  result.seams = get_seams(file);
  get_record(file, result);
  return result;
}

}  // namespace

void write_result(const std::string& path, const BlockResult& result) {
  check_sizes(result);
  const WholeTracks tracks(result);
  Hdf5Writer file(path, "result", storage_for(tracks));
  put_head(file, result);
  ResultTrackWriter points(file);
  points.append(result);
  points.finish();
  put_tail(file, result);
  file.close();
}

void write_result(const std::string& path, BlockResult& result, const TrackBatches& tracks,
                  std::function<void()> after_table) {
  check_sizes(result);
  Hdf5Writer file(path, "result", storage_for(tracks));
  if (after_table) file.after_datasets(std::move(after_table));
  put_head(file, result);
  ResultTrackWriter points(file);
  ResultDigest digest(result.state, tracks.track_count());
  tracks.visit([&](const TrackResults& batch) {
    points.append(batch);
    digest.add(batch);
  });
  points.finish();
  result.digest = digest.text();
  put_tail(file, result);
  file.close();
}

BlockResult read_result(const std::string& path) {
  const Hdf5Reader file(path, "result");
  BlockResult result = get_head_and_tail(file);
  static_cast<TrackResults&>(result) = read_result_tracks(file, {0, count_result_tracks(file)});
  return result;
}

std::string read_result_digest(const std::string& path) {
  return Hdf5Reader(path, "result").text_attribute("/", "digest");
}

BlockResult read_result_without_tracks(const std::string& path) {
  return get_head_and_tail(Hdf5Reader(path, "result"));
}

}  // namespace megablock
