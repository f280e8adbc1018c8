// result/block.h5: docs/job-format.md, "Result".
#include <algorithm>
#include <utility>

#include "io/error.h"
#include "io/hdf5_block.h"
#include "io/hdf5_cameras.h"
#include "io/hdf5_state.h"
#include "io/hdf5_tables.h"
#include "io/hdf5_tiles.h"
#include "io/measurements.h"
#include "io/result.h"
#include "io/result_digest.h"
#include "io/track_batches.h"

namespace megablock {

namespace {

// Square matrices of a list, one behind the other (symmetric, so the order of rows and columns does not matter).
template <typename Scalar, typename Matrices>
std::vector<Scalar> flattened(const Matrices& matrices) {
  std::vector<Scalar> values;
  for (const auto& matrix : matrices)
    for (Eigen::Index i = 0; i < matrix.size(); ++i) values.push_back(static_cast<Scalar>(matrix.data()[i]));
  return values;
}

template <typename Matrix, typename Scalar>
std::vector<Matrix> square_matrices(const std::vector<Scalar>& values) {
  constexpr std::size_t kSize = Matrix::SizeAtCompileTime;
  std::vector<Matrix> matrices(values.size() / kSize);
  for (std::size_t m = 0; m < matrices.size(); ++m)
    for (std::size_t i = 0; i < kSize; ++i) matrices[m].data()[i] = static_cast<double>(values[m * kSize + i]);
  return matrices;
}

void require_size(std::size_t found, std::size_t expected, const char* what) {
  if (found != expected)
    throw ComputeError("the result has " + std::to_string(found) + " " + what + ", expected " +
                       std::to_string(expected));
}

void check_track_sizes(const TrackResults& result) {
  const std::size_t tracks = result.tracks.id.size(), observations = result.tracks.image.size();
  require_size(result.points.size(), tracks, "points");
  require_size(result.kept.size(), observations, "verdicts on observations");
  require_size(result.residual_x.size(), observations, "residuals");
  require_size(result.residual_y.size(), observations, "residuals");
  if (!result.point_covariance.empty()) require_size(result.point_covariance.size(), tracks, "point covariances");
  require_size(result.redundancy_y.size(), result.redundancy_x.size(), "redundancy numbers");
  if (!result.redundancy_x.empty()) require_size(result.redundancy_x.size(), observations, "redundancy numbers");
  require_size(result.file_tiles.size(), result.file_tracks.size(), "tiles of tracks");
  if (!result.file_tracks.empty()) require_size(result.file_tracks.size(), tracks, "indices of tracks in their tiles");
}

void check_sizes(const BlockResult& result) {
  require_size(result.state.frames.size(), result.block.frames.size(), "frame poses");
  require_size(result.boundary.size(), result.block.frames.size(), "boundary flags");
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

void put_precision(Hdf5Writer& file, const BlockResult& result) {
  if (!result.frame_covariance.empty())
    file.array("frames/covariance", flattened<double>(result.frame_covariance), {rows(result.frame_covariance), 6, 6},
               {"rad, m", "posterior, of (rotation increment about the ground axes, centre)"});
  if (!result.camera_covariance.empty()) put_covariances(file, result.camera_covariance);
}

void get_precision(const Hdf5Reader& file, BlockResult& result) {
  if (file.has("frames/covariance"))
    result.frame_covariance = IndexedVector<FrameIndex, BlockResult::Matrix6>(square_matrices<BlockResult::Matrix6>(
        file.array<double>("frames/covariance", {rows(result.block.frames), 6, 6})));
  if (file.has("cameras/covariance"))
    result.camera_covariance = IndexedVector<CameraIndex, Eigen::MatrixXd>(
        get_covariances(file, column(result.block.cameras, [](const Camera& c) { return c.intrinsics.model(); })));
}

// Writes the tracks, batch behind batch.
class PointWriter {
 public:
  explicit PointWriter(Hdf5Writer& file) : file_(file) {
    file.group("points", "one row per track in global order");
    file.growing<std::int64_t>("points/id", {}, {"", "global index"});
    file.growing<std::int64_t>("points/begin", {},
                               {"", "observations of point i are rows begin[i] to begin[i + 1] (exclusive)"});
    file.append("points/begin", std::vector<std::int64_t>{0});
    file.growing<double>("points/position", {3}, {"m", "ground frame; NaN: not triangulated"});
    file.group("observations", "one row per image measurement, in the order of the points");
    file.growing<std::int32_t>("observations/image", {}, {"", "row in images"});
    file.growing<std::int32_t>("observations/x", {}, {"2^-10 px", "to the right, pixel centres at +0.5"});
    file.growing<std::int32_t>("observations/y", {}, {"2^-10 px", "down, pixel centres at +0.5"});
    file.growing<std::int32_t>("observations/feature", {}, {"", "row in the image's features, -1: none"});
    file.growing<std::uint8_t>("observations/kept", {}, {"", "1: kept, 0: rejected"});
    file.growing<float>("observations/residual_x", {}, {"px", "adjusted minus measured"});
    file.growing<float>("observations/residual_y", {}, {"px", "adjusted minus measured"});
  }

  void append(const TrackResults& batch) {
    check_track_sizes(batch);
    if (batch.points.empty()) return;
    if (first_) add_optional_columns(batch);
    first_ = false;
    const TrackSet& tracks = batch.tracks;
    file_.append("points/id", plain(tracks.id));
    std::vector<std::int64_t> begin(tracks.begin.begin() + 1, tracks.begin.end());
    for (std::int64_t& row : begin) row += observations_;
    observations_ += tracks.observation_count();
    file_.append("points/begin", begin);
    file_.append("points/position", vectors3(batch.points, [](const Eigen::Vector3d& p) { return p; }));
    add_boxes(batch.points);
    if (!batch.file_tracks.empty()) {
      file_.append("points/track", plain(batch.file_tracks));
      file_.append("points/tile", column(batch.file_tiles, narrow));
    }
    if (!batch.point_covariance.empty()) file_.append("points/covariance", flattened<float>(batch.point_covariance));
    file_.append("observations/image", column(tracks.image, narrow));
    file_.append("observations/x", tracks.x);
    file_.append("observations/y", tracks.y);
    file_.append("observations/feature", tracks.feature);
    file_.append("observations/kept", batch.kept);
    file_.append("observations/residual_x", batch.residual_x);
    file_.append("observations/residual_y", batch.residual_y);
    if (!batch.redundancy_x.empty()) {
      file_.append("observations/redundancy_x", batch.redundancy_x);
      file_.append("observations/redundancy_y", batch.redundancy_y);
    }
  }

  void finish() {
    add_boxes({}, true);
    file_.matrix(
        "points/box", boxes_, 6,
        {"m", "bounds of each 1024 successive points: lowest east, north, up, highest; NaN: none has a position"});
    file_.matrix("points/district", districts_of(boxes_), 6, {"m", "the same of each 65536 successive points"});
    file_.attribute("observations", "observations_complete", std::uint8_t{1});
  }

 private:
  static constexpr auto narrow = [](auto index) { return static_cast<std::int32_t>(index.value); };

  void add_optional_columns(const TrackResults& batch) {
    if (!batch.file_tracks.empty()) {
      file_.growing<std::int64_t>("points/track", {}, {"", "index of the track in the file of its tile"});
      file_.growing<std::int32_t>("points/tile", {}, {"", "that owns the track"});
    }
    if (!batch.redundancy_x.empty())
      for (const char* name : {"observations/redundancy_x", "observations/redundancy_y"})
        file_.growing<std::uint8_t>(name, {}, {"1/255", "redundancy number, 0 to 1; 0 as well: takes no part"});
    if (!batch.point_covariance.empty()) file_.growing<float>("points/covariance", {3, 3}, {"m^2", "posterior"});
  }

  // Of whole boxes; the last one may be smaller.
  void add_boxes(const std::vector<Eigen::Vector3d>& more, bool last = false) {
    waiting_.insert(waiting_.end(), more.begin(), more.end());
    const std::size_t whole =
        last ? waiting_.size() : waiting_.size() - waiting_.size() % static_cast<std::size_t>(kPointRun);
    const std::vector<float> boxes =
        boxes_of({waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(whole)});
    boxes_.insert(boxes_.end(), boxes.begin(), boxes.end());
    waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(whole));
  }

  Hdf5Writer& file_;
  bool first_ = true;
  std::int64_t observations_ = 0;
  std::vector<Eigen::Vector3d> waiting_;  // points of a box that is not full
  std::vector<float> boxes_;
};

// Some successive tracks of a result's file.
TrackResults read_tracks(const Hdf5Reader& file, const RowRange& rows_of_points) {
  TrackResults result;
  TrackSet& tracks = result.tracks;
  const std::int64_t count = rows_of_points.count;
  const std::vector<RowRange> points = {rows_of_points};
  tracks.id = indices<TrackIndex>(file.rows<std::int64_t>("points/id", points));
  tracks.begin = file.rows<std::int64_t>("points/begin", {{rows_of_points.first, count + 1}});
  const std::int64_t first = tracks.begin.front();
  for (std::int64_t& row : tracks.begin) row -= first;
  const std::int64_t total = file.shape("observations/image").front();
  begin_of(file, "points/begin", counts_of(tracks.begin));
  if (first < 0 || first + tracks.begin.back() > total)
    file.fail("points/begin", "names rows that are not there: there are " + std::to_string(total) + " observations");
  const std::vector<RowRange> observations = {{first, tracks.begin.back()}};
  tracks.image = indices<ImageIndex>(file.rows<std::int64_t>("observations/image", observations));
  tracks.x = file.rows<std::int32_t>("observations/x", observations);
  tracks.y = file.rows<std::int32_t>("observations/y", observations);
  tracks.feature = file.rows<std::int32_t>("observations/feature", observations);
  result.kept = file.rows<std::uint8_t>("observations/kept", observations);
  result.residual_x = file.rows<float>("observations/residual_x", observations);
  result.residual_y = file.rows<float>("observations/residual_y", observations);
  if (file.has("observations/redundancy_x")) {
    result.redundancy_x = file.rows<std::uint8_t>("observations/redundancy_x", observations);
    result.redundancy_y = file.rows<std::uint8_t>("observations/redundancy_y", observations);
  }
  const auto positions = file.rows<double>("points/position", points);
  for (std::size_t p = 0; p < tracks.id.size(); ++p) result.points.push_back(vector3(positions, p));
  if (file.has("points/track")) {
    result.file_tracks = indices<TrackIndex>(file.rows<std::int64_t>("points/track", points));
    result.file_tiles = indices<TileIndex>(file.rows<std::int64_t>("points/tile", points));
  }
  if (file.has("points/covariance"))
    result.point_covariance = square_matrices<Eigen::Matrix3d>(file.rows<float>("points/covariance", points));
  return result;
}

// Number of tracks; all columns must be as long as there are tracks or observations.
std::int64_t check_columns(const Hdf5Reader& file) {
  if (file.attribute<std::uint8_t>("observations", "observations_complete") != 1)
    file.fail("observations", "is not complete: a file of observations was missing when it was written");
  const auto require = [&](const std::string& name, const std::vector<std::int64_t>& shape) {
    const std::vector<std::int64_t> found = file.shape(name);
    if (found != shape)
      file.fail(name, "has " + std::to_string(found.empty() ? 0 : found[0]) + " rows, expected " +
                          std::to_string(shape[0]) + ", or rows of another width");
  };
  const auto rows_of = [&](const char* name) {
    const std::vector<std::int64_t> shape = file.shape(name);
    if (shape.size() != 1) file.fail(name, "is not a list");
    return shape[0];
  };
  const std::int64_t count = rows_of("points/id"), observations = rows_of("observations/image");
  require("points/begin", {count + 1});
  require("points/position", {count, 3});
  for (const char* name : {"points/track", "points/tile"})
    if (file.has(name)) require(name, {count});
  if (file.has("points/covariance")) require("points/covariance", {count, 3, 3});
  for (const char* name : {"x", "y", "feature", "kept", "residual_x", "residual_y"})
    require(std::string("observations/") + name, {observations});
  if (file.has("observations/redundancy_x"))
    for (const char* name : {"observations/redundancy_x", "observations/redundancy_y"}) require(name, {observations});
  if (file.rows<std::int64_t>("points/begin", {{count, 1}}).front() != observations)
    file.fail("points/begin", "does not end with the number of observations, " + std::to_string(observations));
  return count;
}

void put_control_results(Hdf5Writer& file, const std::vector<BlockResult::ControlResult>& control) {
  if (control.empty()) return;
  using Result = BlockResult::ControlResult;
  file.matrix("control/adjusted", vectors3(control, [](const Result& c) { return c.adjusted; }), 3,
              {"m", "ground frame; NaN: not seen by two oriented images"});
  file.array("control/covariance", flattened<double>(column(control, [](const Result& c) { return c.covariance; })),
             {rows(control), 3, 3}, {"m^2", "posterior, of the adjusted position"});
  std::vector<double> residuals;
  for (const Result& result : control)
    for (const Eigen::Vector2d& r : result.residual_px) residuals.insert(residuals.end(), {r.x(), r.y()});
  file.matrix("control/measurement/residual", residuals, 2,
              {"px", "adjusted minus measured, x, y; NaN: image not oriented"});
  std::vector<std::uint8_t> kept;
  for (const Result& result : control) kept.insert(kept.end(), result.kept.begin(), result.kept.end());
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

void put_observation_table(Hdf5Writer& file, const ObservationTable& table) {
  std::vector<std::string> words;
  for (std::size_t k = 0; k < kObservationKinds; ++k) words.push_back(word_of(static_cast<ObservationKind>(k)));
  const auto& kinds = table.kinds;
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

// Kinds are found by their word; results of earlier programs have none.
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
  file.group("seams", "chi-square test of each merge of two sub-blocks");
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

// Results of earlier programs have none.
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

}  // namespace

namespace {

// What comes before the tracks, and behind them.
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
  put_control_results(file, result.control);
  put_free_parts(file, result.free_parts);
  put_observation_table(file, result.observation_table);
  put_seams(file, result.seams);
  put_record(file, result);
  put_figures(file, result);
}

// Larger files are written as they grow, not put together in memory.
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
  PointWriter points(file);
  points.append(result);
  points.finish();
  put_tail(file, result);
  file.close();
}

void write_result(const std::string& path, BlockResult& result, const TrackBatches& tracks) {
  check_sizes(result);
  Hdf5Writer file(path, "result", storage_for(tracks));
  put_head(file, result);
  PointWriter points(file);
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
  static_cast<TrackResults&>(result) = read_tracks(file, {0, check_columns(file)});
  return result;
}

BlockResult read_result_without_tracks(const std::string& path) {
  return get_head_and_tail(Hdf5Reader(path, "result"));
}

StoredTracks::StoredTracks(std::string path)
    : path_(std::move(path)), count_(check_columns(Hdf5Reader(path_, "result"))) {}

void StoredTracks::visit(const Visit& visit) const {
  constexpr std::int64_t kBatch = 1 << 16;  // tracks
  const Hdf5Reader file(path_, "result");
  for (std::int64_t first = 0; first < count_; first += kBatch)
    visit(read_tracks(file, {first, std::min(kBatch, count_ - first)}));
}

}  // namespace megablock
