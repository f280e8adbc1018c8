#include "cluster/stages/result/provenance.h"

#include <algorithm>
#include <filesystem>
#include <tuple>

#include "cluster/job/job_json.h"
#include "cluster/job/stage.h"
#include "cluster/process/arithmetic.h"
#include "cluster/process/version.h"
#include "cluster/stages/pipeline/features.h"
#include "io/store/units/features_file.h"
#include "io/store/units/graph_files.h"

namespace megablock {

namespace {

// The names of the units of a stage; empty when the job does not have the stage.
std::vector<std::string> units_of(const JobRecord& record, const std::string& name) {
  std::vector<std::string> names;
  for (const StageRecord& stage : record.stages)
    if (stage.stage == name)
      for (const auto& unit : stage.units) names.push_back(unit.first);
  return names;
}

}  // namespace

// The block only holds the resulting priors of positions and attitudes. Here the options of the project file are listed
// as they were written.
void add_prior_options(const StageSettings& settings, std::vector<OptionRecord>& options) {
  constexpr const char* kOwn = "as given";  // the values are those of the images or of the block
  for (const auto& [section, key, otherwise] :
       {std::tuple("gps", "use", "true"), std::tuple("gps", "sigma_horizontal_m", kOwn),
        std::tuple("gps", "sigma_vertical_m", kOwn), std::tuple("gps", "lever_arm_m", "[0, 0, 0]"),
        std::tuple("attitude", "use", "true"), std::tuple("attitude", "sigma_deg", kOwn)}) {
    const auto given = std::ranges::find_if(
        settings.entries, [&](const StageSettings::Entry& e) { return e.section == section && e.key == key; });
    options.push_back(
        {std::string(section) + "." + key, given == settings.entries.end() ? otherwise : given->value, otherwise});
  }
}

Provenance provenance_of(const Job& job) {
  Provenance provenance;
  provenance.project = std::filesystem::path(job.options.project).filename().string();
  provenance.program = kProgram;
  provenance.arithmetic = arithmetic_level();
  add_prior_options(JobJson::of_job(job.store).settings(), provenance.options);
  const std::vector<OptionValue> values = option_values(job.settings), defaults = option_values({});
  for (std::size_t i = 0; i < values.size(); ++i)
    provenance.options.push_back({values[i].section + "." + values[i].key, values[i].value, defaults[i].value});
  return provenance;
}

IndexedVector<ImageIndex, ImageRecord> image_records(const Job& job, const JobRecord& record) {
  IndexedVector<ImageIndex, ImageRecord> records;
  const std::vector<std::string> shards = units_of(record, kFeatureStage);
  if (shards.empty()) return records;
  records.assign(job.block.images.size(), {-1, -1, 0, 0, 0});
  for (const std::string& shard : shards)
    for (const ImageFeatures& image : read_keypoints(job.store.verified_path(shard))) {
      if (!records.contains(image.image)) continue;
      ImageRecord& row = records[image.image];
      if (image.width > 0) row.width = image.width;
      if (image.height > 0) row.height = image.height;
      row.features = static_cast<std::int64_t>(image.keypoints.size());
    }
  for (const std::string& cell : units_of(record, kMatchingStage)) {
    if (!job.store.seal(cell)) continue;  // the unit failed
    for (const VerifiedPair& pair : read_matches(job.store.verified_path(cell))) {
      if (pair.model == PairModel::kNone) continue;
      for (const ImageIndex image : {pair.a, pair.b}) {
        ++records[image].matched_images;
        records[image].matches += static_cast<std::int64_t>(pair.feature_a.size());
      }
    }
  }
  return records;
}

std::function<std::string(const UnknownId&)> names_of(const Block& block) {
  return [&block](const UnknownId& id) -> std::string {
    switch (id.kind) {
      case UnknownKind::kFrame: {
        const FrameIndex frame(id.index);
        const bool single = block.rig_of(frame).cameras().size() == 1;
        return (single ? "image '" : "frame '") + block.frames[frame].name + "'";
      }
      case UnknownKind::kCamera:
        return "camera '" + block.cameras[CameraIndex(id.index)].name + "'";
      case UnknownKind::kMount: {
        const Rig& rig = block.rigs[RigIndex(id.index)];
        if (rig.is_group()) return "shift of the " + rig.name;
        const bool receiver = id.part == std::ssize(rig.cameras());
        return (receiver ? "receiver" : "mount " + std::to_string(id.part)) + " of rig '" + rig.name + "'";
      }
    }
    return describe(id);
  };
}

}  // namespace megablock
