// Declares the table of observation types whose rows are one number between two frames, with its sigma.
//
// A row here is all that the project file, the block's file and its checks, appending, tiles and fingerprints need to
// know of such a type. Its residual is in adjust/terms/, and asks for its numbers by the key.
#pragma once

#include <span>

#include "io/text/plausible.h"

namespace megablock {

struct FrameMeasurementType {
  const char* key;           // in the project file: names the CSV file; in the block's file: the group
  const char* value_column;  // of the CSV file, with its unit
  const char* sigma_column;
  // What a number may be: beyond, it is a typing error or in another unit.
  Limits values, sigmas;
  Limits sigma_shares;  // of a sigma in the size of its value
};
std::span<const FrameMeasurementType> frame_measurement_types();

}  // namespace megablock
