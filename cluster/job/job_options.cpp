// Describes each option struct once, for both the project file and the fingerprints, so that no option can be read
// without being hashed.

#include "cluster/job/job_options.h"

#include <cctype>
#include <sstream>

#include "cluster/job/job_json.h"
#include "cluster/job/stage.h"
#include "io/base/error.h"
#include "io/text/plausible.h"
#include "io/text/settings_reader.h"

namespace megablock {

namespace {

void describe(OptionVisitor& visit, FeatureOptions& o) {
  visit.integer("max_features", o.max_features);
  visit.number("max_megapixels", o.max_megapixels);
  visit.number("contrast_threshold", o.contrast_threshold);
  visit.flag("root_sift", o.root_sift);
}

void describe(OptionVisitor& visit, CandidateOptions& o) {
  visit.integer("neighbours", o.neighbours);
  visit.number("max_pair_distance_m", o.max_pair_distance_m);
  visit.number("max_view_angle_deg", o.max_view_angle_deg);
  visit.integer("order_neighbours", o.order_neighbours);
  visit.integer("descriptor_neighbours", o.descriptor_neighbours);
  visit.integer("exhaustive_below", o.exhaustive_below);
  visit.integer("cell_pairs", o.cell_pairs);
}

void describe(OptionVisitor& visit, MatchOptions& o) {
  visit.integer("k_best", o.k_best);
  visit.number("ratio", o.ratio);
  visit.number("max_residual_px", o.max_residual_px);
  visit.number("sample_spacing_px", o.sample_spacing_px);
  visit.integer("min_inliers", o.min_inliers);
  visit.flag("by_turn", o.by_turn);
  visit.flag("guided", o.guided);
  visit.number("min_distance_m", o.min_distance_m);
  visit.number("max_distance_m", o.max_distance_m);
  visit.flag("filter", o.filter);
  visit.text("filter_model", o.filter_model);
  visit.flag("use_trajectory", o.trust.use_trajectory);
  visit.number("trajectory_seconds", o.trust.max_seconds);
  visit.number("trajectory_position_sigma_m", o.trust.position_sigma_m);
  visit.number("trajectory_rotation_sigma_deg", o.trust.rotation_sigma_deg);
}

void describe(OptionVisitor& visit, TrackOptions& o) {
  visit.integer("min_track_length", o.min_length);
  visit.flag("remove_eccentricity", o.remove_eccentricity);
}

void describe(OptionVisitor& visit, TileOptions& o) {
  visit.integer("tile_max_frames", o.tile_max_frames);
  visit.integer("min_tiles", o.min_tiles);
  visit.integer("min_tiles_from", o.min_tiles_from);
  visit.integer("weak_link_tracks", o.weak_link_tracks);
}

void describe_loss(OptionVisitor& visit, const std::string& name, RobustLoss& loss) {
  int kind = static_cast<int>(loss.kind);
  visit.choice(name, {"none", "huber", "cauchy", "cauchy_tail"}, kind);
  loss.kind = static_cast<RobustLoss::Kind>(kind);
  visit.number(name + "_scale", loss.scale);
}

void describe(OptionVisitor& visit, ObservationOptions& o) {
  visit.number("image_sigma_px", o.image_sigma_px);
  describe_loss(visit, "image_loss", o.image_loss);
  describe_loss(visit, "position_loss", o.position_loss);
  describe_loss(visit, "control_loss", o.control_loss);
  describe_loss(visit, "attitude_loss", o.attitude_loss);
  describe_loss(visit, "relative_loss", o.relative_loss);
  describe_loss(visit, "line_loss", o.line_loss);
  describe_loss(visit, "vertical_loss", o.vertical_loss);
  visit.flag("use_position_priors", o.use_position_priors);
  visit.flag("use_attitude_priors", o.use_attitude_priors);
}

void describe(OptionVisitor& visit, OrientationOptions& o) {
  visit.number("max_rotation_error_deg", o.max_rotation_error_deg);
  visit.integer("min_points_per_image", o.min_points_per_image);
  visit.integer("tracks_per_pair", o.tracks_per_pair);
  visit.integer("part_frames", o.part_frames);
  visit.flag("shift_positions", o.shift_positions);
}

void describe(OptionVisitor& visit, EnvironmentOptions& o) {
  visit.flag("refraction", o.refraction);
  visit.flag("earth_curvature", o.earth_curvature);
}

void describe(OptionVisitor& visit, AdjustOptions& o) {
  describe(visit, o.observations);
  visit.flag("estimate_image_sigma", o.estimate_image_sigma);
  visit.number("min_intersection_deg", o.min_intersection_deg);
  visit.number("max_residual_sigmas", o.max_residual_sigmas);
  visit.integer("screening_rounds", o.screening_rounds);
  visit.integer("max_iterations", o.max_iterations);
}

void describe(OptionVisitor& visit, DiagnosticsOptions& o) {
  visit.number("min_base_to_height", o.min_base_to_height);
  visit.number("max_base_to_height", o.max_base_to_height);
  visit.number("min_overlap", o.min_overlap);
  visit.integer("min_images", o.min_images);
  visit.integer("min_link_points", o.min_link_points);
  visit.number("gap_factor", o.gap_factor);
}

void describe(OptionVisitor& visit, MergeSettings& o) {
  visit.integer("max_iterations", o.max_iterations);
  visit.number("decrement", o.decrement);
  visit.integer("screening_rounds", o.screening_rounds);
  visit.flag("estimate_sigmas", o.estimate_sigmas);
  visit.flag("scale_contradicted_sigmas", o.scale_contradicted_sigmas);
  visit.flag("scale_sigma", o.scale_sigma);
  visit.flag("empirical_sigmas", o.empirical_sigmas);
}

// The section that sets these members.
template <auto... members>
constexpr OptionSection section(const char* name, const char* file_key = nullptr) {
  return {name, file_key,
          [](OptionVisitor& visitor, JobOptions& options) { (describe(visitor, options.*members), ...); },
          [](const JobOptions& options) { ((options.*members).check(), ...); }};
}

// Sets every described value that the project file gives.
class ReadingVisitor final : public OptionVisitor {
 public:
  ReadingVisitor(const StageSettings& settings, const char* section) : reader_(settings, section) {}
  void number(const std::string& key, double& value) override { reader_.number(key, value); }
  void integer(const std::string& key, int& value) override { reader_.integer(key, value); }
  void integer(const std::string& key, std::int64_t& value) override { reader_.integer(key, value); }
  void flag(const std::string& key, bool& value) override { reader_.flag(key, value); }
  void text(const std::string& key, std::string& value) override { reader_.text(key, value); }
  void choice(const std::string& key, const std::vector<std::string>& names, int& value) override {
    reader_.choice(key, names, value);
  }
  void finish() const { reader_.finish(); }

 private:
  SettingsReader reader_;
};

// Adds every described value to a hash.
class HashVisitor final : public OptionVisitor {
 public:
  explicit HashVisitor(Hasher& hasher) : hasher_(hasher) {}
  void number(const std::string& key, double& value) override { hasher_.add(key).add(value); }
  void integer(const std::string& key, int& value) override { hasher_.add(key).add(std::int64_t{value}); }
  void integer(const std::string& key, std::int64_t& value) override { hasher_.add(key).add(value); }
  void flag(const std::string& key, bool& value) override { hasher_.add(key).add(value); }
  void text(const std::string& key, std::string& value) override { hasher_.add(key).add(value); }
  void choice(const std::string& key, const std::vector<std::string>&, int& value) override {
    hasher_.add(key).add(value);
  }

 private:
  Hasher& hasher_;
};

// Writes every described value as text.
class TextVisitor final : public OptionVisitor {
 public:
  TextVisitor(std::string section, std::vector<OptionValue>& values) : section_(std::move(section)), values_(values) {}
  void number(const std::string& key, double& value) override {
    std::ostringstream text;
    text.imbue(std::locale::classic());
    text << value;
    add(key, text.str());
  }
  void integer(const std::string& key, int& value) override { add(key, std::to_string(value)); }
  void integer(const std::string& key, std::int64_t& value) override { add(key, std::to_string(value)); }
  void flag(const std::string& key, bool& value) override { add(key, value ? "true" : "false"); }
  void text(const std::string& key, std::string& value) override { add(key, value); }
  void choice(const std::string& key, const std::vector<std::string>& names, int& value) override {
    add(key, names[static_cast<std::size_t>(value)]);
  }

 private:
  void add(const std::string& key, const std::string& value) { values_.push_back({section_, key, value}); }

  std::string section_;
  std::vector<OptionValue>& values_;
};

// Whether the message names the key as a whole word, not as a part of another key.
bool names_key(const std::string& message, const std::string& key) {
  const auto part_of_word = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; };
  for (std::size_t at = message.find(key); at != std::string::npos; at = message.find(key, at + 1)) {
    const std::size_t end = at + key.size();
    if ((at == 0 || !part_of_word(message[at - 1])) && (end == message.size() || !part_of_word(message[end])))
      return true;
  }
  return false;
}

// Checks options whose values do not depend on others. The error names the place where the project file sets the value.
void check_section(const StageSettings& settings, const OptionSection& section, const JobOptions& options) {
  try {
    section.check(options);
  } catch (const InputError& error) {
    const std::string message = error.what();
    for (const auto& entry : settings.entries)
      if (entry.section == section.name && names_key(message, entry.key))
        throw InputError(entry.where + ": " + section.name + ": " + message +
                         (message.find(", not ") == std::string::npos ? ", not " + entry.value : ""));
    throw;
  }
}

template <typename Options>
void hash_options(Hasher& hasher, Options options) {
  HashVisitor visitor(hasher);
  describe(visitor, options);
}

}  // namespace

void MergeSettings::check() const {
  if (max_iterations < 1) throw InputError("max_iterations must be at least 1");
  require_within(decrement, {1e-12, 100}, "decrement");
  if (screening_rounds < 0) throw InputError("screening_rounds must not be negative");
}

const OptionSection kFeatureSection = section<&JobOptions::features>("features");
const OptionSection kCandidateSection = section<&JobOptions::candidates>("candidates");
const OptionSection kMatchingSection = section<&JobOptions::matching, &JobOptions::tracks>("matching", "filter_model");
const OptionSection kTileSection = section<&JobOptions::tiles>("tiles");
const OptionSection kOrientationSection = section<&JobOptions::orientation>("orientation");
const OptionSection kEnvironmentSection = section<&JobOptions::environment>("environment");
const OptionSection kAdjustmentSection = section<&JobOptions::adjustment>("adjustment");
const OptionSection kMergeSection = section<&JobOptions::merge>("merge");
const OptionSection kDiagnosticsSection = section<&JobOptions::diagnostics>("diagnostics");

JobOptions read_options(const StageSettings& settings) {
  JobOptions options;
  for (const OptionSection* section : option_sections()) {
    ReadingVisitor visitor(settings, section->name);
    section->describe(visitor, options);
    visitor.finish();
  }
  for (const OptionSection* section : option_sections()) check_section(settings, *section, options);
  options.orientation.observations = options.adjustment.observations;  // all stages share one description of them
  return options;
}

JobOptions options_of_job(const JobStore& store) { return read_options(JobJson::of_job(store).settings()); }

std::vector<OptionValue> option_values(const JobOptions& options) {
  std::vector<OptionValue> values;
  JobOptions described = options;  // a copy, because a visitor could also write
  for (const OptionSection* section : option_sections()) {
    TextVisitor visitor(section->name, values);
    section->describe(visitor, described);
  }
  return values;
}

void add_to_hash(Hasher& hasher, const FeatureOptions& options) { hash_options(hasher, options); }
void add_to_hash(Hasher& hasher, const CandidateOptions& options) { hash_options(hasher, options); }
void add_to_hash(Hasher& hasher, const MatchOptions& options) { hash_options(hasher, options); }
void add_to_hash(Hasher& hasher, const TileOptions& options) { hash_options(hasher, options); }
void add_to_hash(Hasher& hasher, const OrientationOptions& options) {
  hash_options(hasher, options);
  hash_options(hasher, options.observations);
}
void add_to_hash(Hasher& hasher, const EnvironmentOptions& options) { hash_options(hasher, options); }
void add_to_hash(Hasher& hasher, const AdjustOptions& options) {
  hash_options(hasher, options);
  if (const HalfChoice& choice = options.observations.half; choice.half != Half::kNone)
    hasher.add(choice.half).add(choice.division);
}
void add_to_hash(Hasher& hasher, const MergeSettings& options) { hash_options(hasher, options); }

}  // namespace megablock
