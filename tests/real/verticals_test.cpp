// Tests verticals in real images. They must be found in all images of streets and of a façade, and in none of trees and
// a shore from above, where the angles of the gimbal exclude that edges are vertical.
#include <algorithm>
#include <cmath>

#include "geometry/transform/rotation.h"
#include "io/images/image_header.h"
#include "match/images/image_vertical.h"
#include "real_data.h"

namespace megablock {
namespace {

using fixture::real_data;
namespace fs = std::filesystem;

struct Shown {
  int images = 0, found = 0;
  double most_roll_deg = 0, most_pitch_deg = 0;
};

Shown verticals_of(const std::string& set) {
  Shown shown;
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(real_data(set)))
    if (entry.path().extension() == ".jpg" || entry.path().extension() == ".JPG") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files) {
    const ImageHeader header = read_image_header(file.string());
    Camera camera;
    camera.width = header.width;
    camera.height = header.height;
    const double larger = std::max(header.width, header.height);
    camera.intrinsics = Intrinsics{focal_px(header).value_or(1.2 * larger), 0.5 * header.width, 0.5 * header.height};
    VerticalPrior prior;
    prior.down = down_of_exif_orientation(header.orientation);
    if (header.attitude) {
      prior.down = header.attitude->rotation * -Eigen::Vector3d::UnitZ();
      prior.roll_sigma = prior.pitch_sigma = 3 * kDegree;
    }
    const ImageVertical v = find_image_vertical(file.string(), camera, prior, 1);
    EXPECT_EQ(v.failure, "") << file;
    ++shown.images;
    if (!v.found) continue;
    ++shown.found;
    const RollPitch angles = roll_pitch_of(v.down);
    shown.most_roll_deg = std::max(shown.most_roll_deg, std::abs(angles.roll) * kDegreesPerRadian);
    shown.most_pitch_deg = std::max(shown.most_pitch_deg, std::abs(angles.pitch) * kDegreesPerRadian);
  }
  return shown;
}

TEST(Verticals, OfAWalkAlongStreets) {
  MEGABLOCK_NEEDS_DATA("lund");
  const Shown shown = verticals_of("lund");
  EXPECT_EQ(shown.found, shown.images);
  EXPECT_LT(shown.most_roll_deg, 6) << "a phone held upright";
  EXPECT_LT(shown.most_pitch_deg, 12);
}

TEST(Verticals, OfAFacadeLookedUpAt) {
  MEGABLOCK_NEEDS_DATA("berlin");
  const Shown shown = verticals_of("berlin");
  EXPECT_EQ(shown.found, shown.images);
  EXPECT_LT(shown.most_roll_deg, 3);
  EXPECT_LT(shown.most_pitch_deg, 35);
}

TEST(Verticals, NoneOfTreesFromAbove) {
  MEGABLOCK_NEEDS_DATA("brighton_beach");
  EXPECT_EQ(verticals_of("brighton_beach").found, 0);
}

}  // namespace
}  // namespace megablock
