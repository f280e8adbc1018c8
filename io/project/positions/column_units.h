// Reads the unit that the name of a column states, so that heights in feet or accuracies in centimetres become metres:
// "altitude (ft)", "Height [m]", "sigma_mm", "heading_rad". Internal to io/.
#pragma once

#include <cstdint>
#include <string>

namespace megablock {

struct ColumnUnit {
  enum class Kind : std::uint8_t { kUnstated, kLength, kAngle } kind = Kind::kUnstated;
  double factor = 1;      // to metres or degrees
  std::string text = {};  // for messages: "ft"
};

struct ColumnName {
  std::string name;  // comparable: lower case, '_' for whatever is no letter or digit, without brackets and unit
  ColumnUnit unit;
};

// A text in brackets that is no unit (WGS84, ellipsoidal) is dropped.
ColumnName column_name(const std::string& header);

}  // namespace megablock
