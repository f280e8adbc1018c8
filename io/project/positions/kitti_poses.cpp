// Poses of the KITTI odometry benchmark: a line for each frame, in their order, with the first three rows of the matrix
// that turns coordinates of the left camera (x right, y down, z along the view) into those of the first frame:
//
//     r11 r12 r13 tx r21 r22 r23 ty r31 r32 r33 tz
//
// The axes of the first frame become right, ahead and up, so that the third axis of the block points upward as far as
// the first camera looks along the horizon.
//
// Source: A. Geiger, P. Lenz, R. Urtasun, Are we ready for autonomous driving? CVPR 2012; development kit, readme.txt.
#include <Eigen/LU>
#include <algorithm>

#include "io/base/error.h"
#include "io/project/positions/position_fields.h"
#include "io/project/positions/position_formats.h"

namespace megablock {

namespace {

constexpr std::size_t kKittiFields = 12;

std::vector<std::string> kitti_fields(const TextLine& line) { return split_fields(line.text, Separator::kBlanks); }

bool is_kitti(const PositionText& text) {
  const std::vector<std::string> fields = kitti_fields(text.lines[0]);
  return fields.size() == kKittiFields && std::ranges::all_of(fields, is_number);
}

PositionTable read_kitti(const PositionText& text, const PositionOptions&) {
  PositionTable table;
  table.kind = PositionTable::Kind::kOrdered;
  table.crs = "local";
  Eigen::Matrix3d upright;  // axes of the block from right, down, ahead
  upright << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  for (const TextLine& line : text.lines) {
    const std::string where = text.where(line);
    const std::vector<std::string> fields = kitti_fields(line);
    if (fields.size() != kKittiFields)
      throw InputError(where + ": " + std::to_string(fields.size()) +
                       " fields in this line; expected the 12 of a pose: r11 r12 r13 tx r21 ... tz");
    Eigen::Matrix<double, 3, 4, Eigen::RowMajor> pose;
    for (std::size_t f = 0; f < kKittiFields; ++f)
      pose.data()[f] = position_number(fields[f], Separator::kBlanks, "pose", where);
    const Eigen::Matrix3d axes = pose.leftCols<3>();
    if ((axes * axes.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() > 1e-3 || axes.determinant() < 0)
      throw InputError(where +
                       ": the first three columns of the pose are no rotation; expected r11 r12 r13 tx r21 ...");
    PositionTable::Row row;
    row.where = where;
    row.place = upright * pose.col(3);
    row.rotation = Eigen::Quaterniond((upright * axes).transpose()).normalized();
    row.angles = AngleKind::kRotation;
    table.rows.push_back(std::move(row));
  }
  return table;
}

}  // namespace

const PositionFormat kKitti = {"kitti", "poses of the KITTI benchmark", is_kitti, read_kitti};

}  // namespace megablock
