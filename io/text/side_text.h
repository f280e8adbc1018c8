// Says in words on which side something lies: "46.90 m above", "2.00 m west of and 3.00 m below".
#pragma once

#include <Eigen/Core>
#include <string>

namespace megablock {

// `offset`: east, north, up, metres; its zeros are left out. Empty where all are zero.
std::string side_text(const Eigen::Vector3d& offset);

}  // namespace megablock
