#include "io/block/observation_statistics.h"

namespace megablock {

namespace {

struct Names {
  const char *name, *word;
};
constexpr std::array<Names, kObservationKinds> kNames{{{"image, tie points", "image_tie"},
                                                       {"image, control points", "image_control"},
                                                       {"image, check points", "image_check"},
                                                       {"position, horizontal", "position_horizontal"},
                                                       {"position, height", "position_height"},
                                                       {"attitude", "attitude"},
                                                       {"relative rotation", "relative_rotation"},
                                                       {"relative position", "relative_position"},
                                                       {"control, horizontal", "control_horizontal"},
                                                       {"control, height", "control_height"},
                                                       {"camera, prior values", "intrinsics"},
                                                       {"mount, prior values", "mount"},
                                                       {"lines of known direction", "line"},
                                                       {"vertical in images", "vertical"}}};

}  // namespace

const char* name_of(ObservationKind kind) { return kNames[static_cast<std::size_t>(kind)].name; }
const char* word_of(ObservationKind kind) { return kNames[static_cast<std::size_t>(kind)].word; }

void ObservationTable::add(const ObservationTable& other) {
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    kinds[k].count += other.kinds[k].count;
    kinds[k].weighted_squares += other.kinds[k].weighted_squares;
    kinds[k].redundancy += other.kinds[k].redundancy;
  }
}

}  // namespace megablock
