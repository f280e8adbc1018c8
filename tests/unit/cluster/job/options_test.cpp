#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <regex>
#include <sstream>

#include "cluster/job/job_options.h"
#include "cluster/job/option_section.h"
#include "io/base/error.h"

namespace megablock {
namespace {

StageSettings setting(const std::string& section, const std::string& key, const std::string& value) {
  return {{{section, key, value, "block.yaml:7"}}};
}

// Empty: the settings are accepted.
std::string message(const StageSettings& settings) {
  try {
    read_options(settings);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

std::uint64_t hash_of(const auto& options) {
  Hasher hasher;
  add_to_hash(hasher, options);
  return hasher.value();
}

TEST(JobOptions, DefaultsAreValidAndUnsetOptionsKeepThem) {
  const JobOptions options = read_options({});
  EXPECT_EQ(options.features.max_features, FeatureOptions().max_features);
  EXPECT_EQ(options.merge.decrement, MergeSettings().decrement);
}

TEST(JobOptions, ReadsEverySectionOfTheProjectFile) {
  EXPECT_EQ(read_options(setting("features", "max_features", "1234")).features.max_features, 1234);
  EXPECT_EQ(read_options(setting("matching", "ratio", "0.7")).matching.ratio, 0.7);
  EXPECT_EQ(read_options(setting("matching", "min_track_length", "3")).tracks.min_length, 3);
  EXPECT_EQ(read_options(setting("tiles", "tile_max_frames", "42")).tiles.tile_max_frames, 42);
  const JobOptions cauchy = read_options(setting("adjustment", "image_loss", "cauchy"));
  EXPECT_EQ(cauchy.adjustment.observations.image_loss.kind, RobustLoss::Kind::kCauchy);
  EXPECT_EQ(cauchy.orientation.observations.image_loss.kind, RobustLoss::Kind::kCauchy);
  EXPECT_EQ(read_options(setting("merge", "scale_sigma", "true")).merge.scale_sigma, true);
  EXPECT_EQ(read_options(setting("merge", "estimate_sigmas", "true")).merge.estimate_sigmas, true);
}

TEST(JobOptions, RefusesUnknownKeysAndWrongUnitsNamingFileAndLine) {
  EXPECT_THAT(message(setting("matching", "ratoi", "0.7")), testing::HasSubstr("block.yaml:7"));
  EXPECT_THAT(message(setting("matching", "ratoi", "0.7")), testing::HasSubstr("ratio"));
  EXPECT_THAT(message(setting("adjustment", "image_sigma_px", "0.5 mm")), testing::HasSubstr("block.yaml:7"));
  EXPECT_EQ(message(setting("matching", "filter_model", "filter.yaml")),
            "block.yaml:7: matching: filter_model needs 'filter: true', not false");
  EXPECT_THAT(message(setting("merge", "decrement", "-1")), testing::StartsWith("block.yaml:7: merge: decrement"));
  EXPECT_THAT(message(setting("merge", "decrement", "-1")), testing::EndsWith(", not -1"));
  EXPECT_EQ(message(setting("matching", "k_best", "9")), "block.yaml:7: matching: k_best must be 1 to 7, not 9");
  EXPECT_EQ(message(setting("orientation", "max_rotation_error_deg", "200")),
            "block.yaml:7: orientation: max_rotation_error_deg must lie between 0 and 180, not 200");
  StageSettings two = setting("tiles", "min_tiles", "2");  // the name of the second begins with that of the first
  two.entries.push_back({"tiles", "min_tiles_from", "1", "block.yaml:8"});
  EXPECT_EQ(message(two), "block.yaml:8: tiles: min_tiles_from must be at least 2, not 1");
}

TEST(JobOptions, ValuesInForceAreWrittenDownWithTheirDefaults) {
  bool found = false;
  for (const OptionValue& option : option_values(read_options(setting("matching", "ratio", "0.7")))) {
    if (option.key == "ratio") {
      EXPECT_EQ(option.value, "0.7");
    }
    found = found || (option.section == "tiles" && option.key == "tile_max_frames" &&
                      option.value == std::to_string(TileOptions().tile_max_frames));
  }
  EXPECT_TRUE(found);
}

TEST(JobOptions, EveryOptionReachesItsStagesFingerprintAndNoOther) {
  const JobOptions defaults = read_options({});
  const JobOptions changed = read_options(setting("matching", "ratio", "0.7"));
  EXPECT_NE(hash_of(defaults.matching), hash_of(changed.matching));
  EXPECT_EQ(hash_of(defaults.features), hash_of(changed.features));
  EXPECT_EQ(hash_of(defaults.adjustment), hash_of(changed.adjustment));
}

struct Documented {
  std::string usual, limits;
};

// The rows "| `section.key` | default | limits | ..." of the project file's documentation.
std::map<std::string, Documented> documented_options() {
  std::ifstream in(MEGABLOCK_SOURCE "/docs/reference/project-file.md");
  EXPECT_TRUE(in);
  const std::regex row(R"(\| `([\w.]+)` \| *(.*?) *\| *(.*?) *\| .*)");
  std::map<std::string, Documented> rows;
  bool section = false;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("#")) section = line == "## Options of the stages";
    std::smatch cells;
    if (section && std::regex_match(line, cells, row)) rows[cells[1]] = {cells[2], cells[3]};
  }
  return rows;
}

TEST(JobOptions, AreDocumentedWithTheirDefaults) {
  std::map<std::string, std::string> options, documented;
  for (const OptionValue& option : option_values({})) options[option.section + "." + option.key] = option.value;
  for (const auto& [key, row] : documented_options()) documented[key] = row.usual;
  EXPECT_EQ(documented, options);
}

// Whatever the option, an absurd value ends with its place.
TEST(JobOptions, RefuseAbsurdValues) {
  for (const OptionValue& option : option_values({}))
    EXPECT_THAT(message(setting(option.section, option.key, "1e300")), testing::StartsWith("block.yaml:7: "))
        << option.section << "." << option.key;
  EXPECT_EQ(message(setting("adjustment", "image_loss_scale", "1e-300")),
            "block.yaml:7: adjustment: image_loss_scale must lie in [0.0001, 1e+06], not 1e-300");
  EXPECT_EQ(message(setting("adjustment", "image_sigma_px", "1e5")),
            "block.yaml:7: adjustment: image_sigma_px must lie in [1e-06, 10000], not 1e5");
}

TEST(JobOptions, RefuseValuesBeyondTheDocumentedLimits) {
  int found = 0;
  for (const auto& [key, row] : documented_options()) {
    const std::size_t point = key.find('.');
    const auto message_of = [&, name = key](double value) {
      return message(setting(name.substr(0, point), name.substr(point + 1), (std::ostringstream() << value).str()));
    };
    std::smatch limits;
    if (!std::regex_search(row.limits, limits, std::regex(R"(([0-9][0-9.e-]*) to ([0-9][0-9.e-]*))"))) continue;
    ++found;
    const double least = std::stod(limits[1]), most = std::stod(limits[2]);
    EXPECT_THAT(message_of(2 * most), testing::StartsWith("block.yaml:7: ")) << key;
    if (least > 0) {
      EXPECT_THAT(message_of(least / 2), testing::StartsWith("block.yaml:7: ")) << key;
    }
  }
  EXPECT_GT(found, 15);
}

}  // namespace
}  // namespace megablock
