// Describes each option struct once, for both the project file and the fingerprints, so that no option can be read
// without being hashed.

#include "cluster/job/job_options.h"

#include <cctype>

#include "cluster/job/job_json.h"
#include "io/base/error.h"
#include "io/text/plausible.h"
#include "io/text/settings_reader.h"

namespace megablock {

namespace {

template <typename Visitor>
void describe(Visitor& visit, FeatureOptions& o) {
  visit.integer("max_features", o.max_features);
  visit.number("max_megapixels", o.max_megapixels);
  visit.number("contrast_threshold", o.contrast_threshold);
  visit.flag("root_sift", o.root_sift);
}

template <typename Visitor>
void describe(Visitor& visit, CandidateOptions& o) {
  visit.integer("neighbours", o.neighbours);
  visit.number("max_pair_distance_m", o.max_pair_distance_m);
  visit.number("max_view_angle_deg", o.max_view_angle_deg);
  visit.integer("order_neighbours", o.order_neighbours);
  visit.integer("descriptor_neighbours", o.descriptor_neighbours);
  visit.integer("exhaustive_below", o.exhaustive_below);
  visit.integer("cell_pairs", o.cell_pairs);
}

template <typename Visitor>
void describe(Visitor& visit, MatchOptions& o) {
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

template <typename Visitor>
void describe(Visitor& visit, TrackOptions& o) {
  visit.integer("min_track_length", o.min_length);
  visit.flag("remove_eccentricity", o.remove_eccentricity);
}

template <typename Visitor>
void describe(Visitor& visit, TileOptions& o) {
  visit.integer("tile_max_frames", o.tile_max_frames);
  visit.integer("min_tiles", o.min_tiles);
  visit.integer("min_tiles_from", o.min_tiles_from);
  visit.integer("weak_link_tracks", o.weak_link_tracks);
}

template <typename Visitor>
void describe_loss(Visitor& visit, const std::string& name, RobustLoss& loss) {
  int kind = static_cast<int>(loss.kind);
  visit.choice(name, {"none", "huber", "cauchy", "cauchy_tail"}, kind);
  loss.kind = static_cast<RobustLoss::Kind>(kind);
  visit.number(name + "_scale", loss.scale);
}

template <typename Visitor>
void describe(Visitor& visit, ObservationOptions& o) {
  visit.number("image_sigma_px", o.image_sigma_px);
  describe_loss(visit, "image_loss", o.image_loss);
  describe_loss(visit, "position_loss", o.position_loss);
  describe_loss(visit, "attitude_loss", o.attitude_loss);
  describe_loss(visit, "relative_loss", o.relative_loss);
  describe_loss(visit, "line_loss", o.line_loss);
  describe_loss(visit, "vertical_loss", o.vertical_loss);
  visit.flag("use_position_priors", o.use_position_priors);
  visit.flag("use_attitude_priors", o.use_attitude_priors);
}

template <typename Visitor>
void describe(Visitor& visit, OrientationOptions& o) {
  visit.number("max_rotation_error_deg", o.max_rotation_error_deg);
  visit.integer("min_points_per_image", o.min_points_per_image);
  visit.integer("tracks_per_pair", o.tracks_per_pair);
  visit.integer("part_frames", o.part_frames);
}

template <typename Visitor>
void describe(Visitor& visit, EnvironmentOptions& o) {
  visit.flag("refraction", o.refraction);
  visit.flag("earth_curvature", o.earth_curvature);
}

template <typename Visitor>
void describe(Visitor& visit, AdjustOptions& o) {
  describe(visit, o.observations);
  visit.flag("estimate_image_sigma", o.estimate_image_sigma);
  visit.number("min_intersection_deg", o.min_intersection_deg);
  visit.number("max_residual_sigmas", o.max_residual_sigmas);
  visit.integer("screening_rounds", o.screening_rounds);
  visit.integer("max_iterations", o.max_iterations);
}

template <typename Visitor>
void describe(Visitor& visit, DiagnosticsOptions& o) {
  visit.number("min_base_to_height", o.min_base_to_height);
  visit.number("max_base_to_height", o.max_base_to_height);
  visit.number("min_overlap", o.min_overlap);
  visit.integer("min_images", o.min_images);
  visit.integer("min_link_points", o.min_link_points);
  visit.number("gap_factor", o.gap_factor);
}

template <typename Visitor>
void describe(Visitor& visit, MergeSettings& o) {
  visit.integer("max_iterations", o.max_iterations);
  visit.number("decrement", o.decrement);
  visit.integer("screening_rounds", o.screening_rounds);
  visit.flag("estimate_sigmas", o.estimate_sigmas);
  visit.flag("scale_sigma", o.scale_sigma);
}

// The sections of the project file and the options that each sets, in the order of the docs.
template <typename JobOptionsOrConst, typename Function>
void for_each_section(JobOptionsOrConst& o, Function&& function) {
  function("features", o.features);
  function("candidates", o.candidates);
  function("matching", o.matching, o.tracks);
  function("tiles", o.tiles);
  function("orientation", o.orientation);
  function("environment", o.environment);
  function("adjustment", o.adjustment);
  function("merge", o.merge);
  function("diagnostics", o.diagnostics);
}

// Adds every described value to a hash.
class HashVisitor {
 public:
  explicit HashVisitor(Hasher& hasher) : hasher_(hasher) {}
  void number(const std::string& key, double value) { hasher_.add(key).add(value); }
  void integer(const std::string& key, std::int64_t value) { hasher_.add(key).add(value); }
  void flag(const std::string& key, bool value) { hasher_.add(key).add(value); }
  void choice(const std::string& key, const std::vector<std::string>&, int value) { hasher_.add(key).add(value); }
  void text(const std::string& key, const std::string& value) { hasher_.add(key).add(value); }

 private:
  Hasher& hasher_;
};

// Writes every described value as text.
class TextVisitor {
 public:
  TextVisitor(std::string section, std::vector<OptionValue>& values) : section_(std::move(section)), values_(values) {}
  void number(const std::string& key, double value) {
    std::ostringstream text;
    text.imbue(std::locale::classic());
    text << value;
    values_.push_back({section_, key, text.str()});
  }
  void integer(const std::string& key, std::int64_t value) {
    values_.push_back({section_, key, std::to_string(value)});
  }
  void flag(const std::string& key, bool value) { values_.push_back({section_, key, value ? "true" : "false"}); }
  void choice(const std::string& key, const std::vector<std::string>& names, int value) {
    values_.push_back({section_, key, names[static_cast<std::size_t>(value)]});
  }
  void text(const std::string& key, const std::string& value) { values_.push_back({section_, key, value}); }

 private:
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
template <typename Options>
void check_section(const StageSettings& settings, const std::string& section, const Options& options) {
  try {
    options.check();
  } catch (const InputError& error) {
    const std::string message = error.what();
    for (const auto& entry : settings.entries)
      if (entry.section == section && names_key(message, entry.key))
        throw InputError(entry.where + ": " + section + ": " + message +
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

JobOptions read_options(const StageSettings& settings) {
  JobOptions options;
  for_each_section(options, [&](const std::string& section, auto&... parts) {
    SettingsReader reader(settings, section);
    (describe(reader, parts), ...);
    reader.finish();
  });
  for_each_section(options, [&](const std::string& section, const auto&... parts) {
    (check_section(settings, section, parts), ...);
  });
  options.orientation.observations = options.adjustment.observations;  // all stages share one description of them
  return options;
}

JobOptions options_of_job(const JobStore& store) { return read_options(JobJson::of_job(store).settings()); }

std::vector<OptionValue> option_values(const JobOptions& options) {
  std::vector<OptionValue> values;
  JobOptions described = options;  // a copy, because a visitor could also write
  for_each_section(described, [&](const std::string& section, auto&... parts) {
    TextVisitor visitor(section, values);
    (describe(visitor, parts), ...);
  });
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
void add_to_hash(Hasher& hasher, const AdjustOptions& options) { hash_options(hasher, options); }
void add_to_hash(Hasher& hasher, const MergeSettings& options) { hash_options(hasher, options); }

}  // namespace megablock
