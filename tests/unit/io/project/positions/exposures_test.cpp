#include "io/project/positions/exposures.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>

#include "io/base/error.h"
#include "io/project/positions/position_fields.h"
#include "io/project/positions/position_table.h"
#include "tests/support/io/image_files.h"

namespace megablock {
namespace {

using fixture::message_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const double kFirstExposure = calendar_seconds(2021, 6, 1, 36000);

PositionTable exposures_at(const std::vector<double>& times, bool numbered = true) {
  PositionTable table;
  table.kind = PositionTable::Kind::kExposures;
  for (std::size_t e = 0; e < times.size(); ++e) {
    PositionTable::Row row;
    row.where = "e:" + std::to_string(e + 1);
    row.time_s = kFirstExposure + times[e];
    if (numbered) row.number = static_cast<std::int64_t>(e + 1);
    table.rows.push_back(row);
  }
  return table;
}

// Irregular, as at turns of a flight.
const std::vector<double> kExposureTimes = {0, 2.1, 4, 6.2, 15, 17.1, 19, 21.3, 33, 35.2};

TEST(Exposures, BelongToImagesByTheirNumbers) {
  const std::vector<ImageTime> images = {{"a/DJI_20210601120004_0003_W.JPG", kNoNumber, kNoNumber},
                                         {"a/DJI_20210601120000_0001_W.JPG", kNoNumber, kNoNumber},
                                         {"100_0001_0010.JPG", kNoNumber, kNoNumber}};
  EXPECT_THAT(rows_of_images(exposures_at(kExposureTimes), images, "f.MRK"), ElementsAre(2, 0, 9));
}

TEST(Exposures, BelongToAllCamerasOfADrone) {
  const std::vector<ImageTime> images = {{"DJI_0001_W.JPG", kNoNumber, 100},
                                         {"DJI_0001_T.JPG", kNoNumber, 101},
                                         {"DJI_0002_W.JPG", kNoNumber, 102},
                                         {"DJI_0002_T.JPG", kNoNumber, 102}};
  EXPECT_THAT(rows_of_images(exposures_at({0, 2.1, 4}), images, "f.MRK"), ElementsAre(0, 0, 1, 1));
}

TEST(Exposures, BelongToImagesByTheirOrder) {
  std::vector<ImageTime> images;
  for (std::size_t i = 0; i < kExposureTimes.size(); ++i)  // an unknown clock, in whole seconds; names that begin anew
    images.push_back({"DSC" + std::to_string(i < 4 ? 96 + i : i - 4), kNoNumber,
                      std::floor(kFirstExposure + 7200 + kExposureTimes[i])});
  std::reverse(images.begin(), images.end());
  EXPECT_THAT(rows_of_images(exposures_at(kExposureTimes, false), images, "f.pos"),
              ElementsAre(9, 8, 7, 6, 5, 4, 3, 2, 1, 0));
  for (ImageTime& image : images) image.clock_s = kNoNumber;
  images = {{"b", kNoNumber, kNoNumber}, {"a", kNoNumber, kNoNumber}};
  EXPECT_THAT(rows_of_images(exposures_at({0, 1}, false), images, "f.pos"), ElementsAre(1, 0));
}

TEST(Exposures, OfOtherImagesAreRefused) {
  std::vector<ImageTime> images;
  for (std::size_t i = 0; i < kExposureTimes.size(); ++i)
    images.push_back({std::to_string(1001 + i), kNoNumber, kFirstExposure + 3 * static_cast<double>(i)});
  EXPECT_THAT(message_of<InputError>([&] { rows_of_images(exposures_at(kExposureTimes, false), images, "f.pos"); }),
              HasSubstr("f.pos: its exposures do not belong to these images: the time of image '"));
}

TEST(Exposures, BelongToImagesByTheirTimesWhereSomeLackAPartner) {
  std::vector<ImageTime> images;
  for (const std::size_t e : {0, 1, 3, 4, 5, 7, 8, 9})  // two images were deleted; the clock is 3605.4 s behind
    images.push_back({"P" + std::to_string(e), kNoNumber, std::floor(kFirstExposure + kExposureTimes[e] - 3605.4)});
  EXPECT_THAT(rows_of_images(exposures_at(kExposureTimes, false), images, "f.pos"),
              ElementsAre(0, 1, 3, 4, 5, 7, 8, 9));
  std::vector<double> regular(10);
  for (std::size_t e = 0; e < regular.size(); ++e) regular[e] = 2 * static_cast<double>(e);
  std::vector<ImageTime> fewer;
  for (std::size_t i = 0; i < 8; ++i) fewer.push_back({"P" + std::to_string(i), kNoNumber, 2 * static_cast<double>(i)});
  EXPECT_THAT(message_of<InputError>([&] { rows_of_images(exposures_at(regular, false), fewer, "f.pos"); }),
              HasSubstr("f.pos: its 10 exposures cannot be told apart for 8 images (their times fit in several ways)"));
  fewer[0].clock_s = kNoNumber;
  EXPECT_THAT(message_of<InputError>([&] { rows_of_images(exposures_at(regular, false), fewer, "f.pos"); }),
              HasSubstr("not all headers have times"));
}

// An antenna on a circling of 100 m at 10 m/s, at 5 Hz, with a gap.
PositionTable circling() {
  PositionTable path;
  path.kind = PositionTable::Kind::kPath;
  path.crs = "EPSG:25832";
  for (int i = 0; i <= 300; ++i) {
    const double t = 0.2 * i;
    if (t > 20.1 && t < 29.9) continue;
    PositionTable::Row row;
    row.where = "p:" + std::to_string(i);
    row.time_s = kFirstExposure + t;
    row.place = {5e5 + 100 * std::cos(t / 10), 5.3e6 + 100 * std::sin(t / 10), 600 + t};
    row.sigma_horizontal_m = i == 50 ? 0.5 : 0.02;
    row.sigma_vertical_m = 0.04;
    path.rows.push_back(row);
  }
  return path;
}

TEST(Path, IsInterpolatedToAMillimetre) {
  for (const double t : {0.0, 0.05, 7.1234, 15.29, 59.99, 60.0}) {
    const PositionTable::Row row = interpolate(circling(), {kFirstExposure + t}).at(0);
    const Eigen::Vector3d truth(5e5 + 100 * std::cos(t / 10), 5.3e6 + 100 * std::sin(t / 10), 600 + t);
    // At the ends a line replaces the cubic: v^2 / r dt^2 / 8 = 5 mm in the middle of an epoch.
    EXPECT_LT((row.place - truth).norm(), t < 0.2 || t > 59.8 ? 5e-3 : 1e-3) << t;
    EXPECT_EQ(row.sigma_horizontal_m, 0.02) << t;
  }
  EXPECT_EQ(interpolate(circling(), {kFirstExposure + 10.1}).at(0).sigma_horizontal_m, 0.5)
      << "the worse of the neighbours";
  for (const double t : {-1.0, 25.0, 61.0})
    EXPECT_EQ(interpolate(circling(), {kFirstExposure + t}).at(0).where, "") << t;
  EXPECT_EQ(interpolate(circling(), {kNoNumber}).at(0).where, "");
}

TEST(Path, TimesOfImagesComeFromReceiverOffsetOrZone) {
  std::vector<std::string> notes;
  const auto times = [&](const std::vector<ImageTime>& images, double offset) {
    notes.clear();
    return times_on_path(circling(), images, offset, "f.pos", notes);
  };
  EXPECT_THAT(times({{"a", kFirstExposure + 3, kNoNumber}}, kNoNumber), ElementsAre(kFirstExposure + 3));
  EXPECT_THAT(times({{"a", kNoNumber, 100}}, 5), ElementsAre(105));
  // Local time two hours ahead of UTC, which is 18 s behind GPS.
  const double local = 7200 - 18;
  EXPECT_THAT(
      times({{"a", kNoNumber, kFirstExposure + 5 + local}, {"b", kNoNumber, kFirstExposure + 50 + local}}, kNoNumber),
      ElementsAre(kFirstExposure + 5, kFirstExposure + 50));
  EXPECT_THAT(notes, ElementsAre(HasSubstr("f.pos: the clock of the camera is taken as UTC+02:00")));
  EXPECT_THAT(message_of<InputError>([&] {
                times({{"a", kNoNumber, kFirstExposure + 400}}, kNoNumber);
              }),
              HasSubstr("f.pos: the images were not taken while it was recorded, whatever zone their clock has; give "
                        "'time_offset_s'"));
  EXPECT_THAT(message_of<InputError>([&] {
                times({{"a", kNoNumber, kNoNumber}}, kNoNumber);
              }),
              HasSubstr("f.pos: the headers of the images have no times"));
}

TEST(Path, GivesExposuresBetterPlacesAndKeepsTheirOffsets) {
  PositionTable exposures = exposures_at({1, 7.1234, 25});
  exposures.rows[1].offset_m = {0.01, -0.02, -0.19};
  exposures.rows[1].place = {7, 45, 283};
  std::vector<std::string> notes;
  const PositionTable better = exposures_on(circling(), exposures, "f.pos", notes);
  ASSERT_THAT(better.rows, SizeIs(3));
  EXPECT_EQ(better.crs, "EPSG:25832");
  EXPECT_NEAR(better.rows[1].place.x(), 5e5 + 100 * std::cos(0.71234), 1e-3);
  EXPECT_EQ(better.rows[1].offset_m, Eigen::Vector3d(0.01, -0.02, -0.19));
  EXPECT_EQ(better.rows[1].number, 2);
  EXPECT_FALSE(better.rows[2].place.allFinite());
  EXPECT_THAT(notes, ElementsAre(HasSubstr("f.pos: 1 of 3 exposures do not lie on it")));
  // Events of the same times.
  PositionTable events = circling();
  events.kind = PositionTable::Kind::kExposures;
  exposures = exposures_at({1.0004, 7.1234});
  const PositionTable same = exposures_on(events, exposures, "f_events.pos", notes);
  EXPECT_EQ(same.rows[0].place, events.rows[5].place);
  EXPECT_TRUE(same.rows[1].place.allFinite()) << "within a tenth of a second";
  EXPECT_THAT(message_of<InputError>([&] { exposures_on(circling(), exposures_at({-50}), "f.pos", notes); }),
              HasSubstr("f.pos: no exposure lies on it"));
}

}  // namespace
}  // namespace megablock
