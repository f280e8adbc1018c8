// Columns on their way to scratch and back: every bit comes back, in no more bytes than promised.
#include "merge/scratch/packed_columns.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <numeric>
#include <random>
#include <sstream>

#include "io/block/tracks.h"

namespace megablock {
namespace {

template <typename T>
std::string written(const std::vector<T>& values) {
  std::ostringstream file;
  write_column(file, values);
  EXPECT_TRUE(file);
  return file.str();
}

// Bytes of a column whose values all come back, whatever stood in their place and whatever follows.
template <typename T>
std::size_t packed(const std::vector<T>& values) {
  const std::string bytes = written(values);
  std::istringstream file(bytes + "next");
  std::vector<T> back(7);
  read_column(file, values.size(), back);
  EXPECT_TRUE(file);
  EXPECT_EQ(static_cast<std::size_t>(file.tellg()), bytes.size());
  EXPECT_EQ(back.size(), values.size());
  if (back.size() == values.size() && !values.empty()) {
    EXPECT_EQ(std::memcmp(back.data(), values.data(), values.size() * sizeof(T)), 0);
  }
  return bytes.size();
}

constexpr std::size_t kCount = 10'000;
constexpr std::size_t kHead = 32;  // at most: count, form, least or first value

template <typename T, typename Make>
std::vector<T> made(Make&& make, std::size_t count = kCount) {
  std::vector<T> values;
  for (std::size_t i = 0; i < count; ++i) values.push_back(make(i));
  return values;
}

TEST(PackedColumns, MeasurementsInFourBytes) {
  std::mt19937_64 random(1);
  std::uniform_int_distribution<std::int32_t> units(std::numeric_limits<std::int32_t>::min() + 1);
  EXPECT_LE(packed(made<double>([&](std::size_t) { return units(random) * kPixelUnit; })), 4 * kCount + kHead);
}

TEST(PackedColumns, ControlBehindTiePoints) {
  std::vector<double> values = made<double>([](std::size_t i) { return static_cast<double>(i) * kPixelUnit; });
  for (int i = 0; i < 10; ++i) values.push_back(512.3 + i);
  EXPECT_LE(packed(values), 4 * kCount + 8 * 10 + kHead);
}

TEST(PackedColumns, DoublesOfAnyKindKeepTheirBits) {
  using limits = std::numeric_limits<double>;
  for (const double odd :
       {0.1, -0.0, limits::infinity(), -limits::infinity(), limits::quiet_NaN(), limits::denorm_min(), limits::max(),
        0x1p31 * kPixelUnit, -0x1p31 * kPixelUnit, kPixelUnit / 2}) {
    packed(std::vector<double>{odd});
    packed(std::vector<double>{0.0, odd, odd, 1.0});
    std::vector<double> values = made<double>([](std::size_t i) { return static_cast<double>(i); });
    values[kCount / 2] = odd;
    packed(values);
  }
}

TEST(PackedColumns, SigmasInRuns) {
  EXPECT_LE(packed(std::vector<double>(kCount, 1 / 0.3)), kHead);
  EXPECT_LE(packed(made<double>([](std::size_t i) { return i < 9'000 ? 1 / 0.3 : 1 / 0.7; })), 2 * 12 + kHead);
  EXPECT_LE(packed(made<double>([](std::size_t i) { return i % 2 == 0 ? 1 / 0.3 : 1 / 0.7; })), 8 * kCount + kHead);
}

TEST(PackedColumns, FlagsInRunsOrBytes) {
  EXPECT_LE(packed(made<std::uint8_t>([](std::size_t i) { return i % 500 != 7; })), 2 * 5 * kCount / 500 + kHead);
  EXPECT_LE(packed(made<std::uint8_t>([](std::size_t i) { return i % 2; })), kCount + kHead);
  EXPECT_LE(packed(made<std::uint8_t>([](std::size_t i) { return i; })), kCount + kHead);
}

TEST(PackedColumns, ImagesInTheBytesOfTheirNumber) {
  const auto images = [](std::int32_t count) {
    return made<LocalImage>([=](std::size_t i) {
      return LocalImage(static_cast<std::int32_t>(i * 7919 % static_cast<std::size_t>(count)) - 1);
    });
  };
  EXPECT_LE(packed(images(1)), kHead);
  EXPECT_LE(packed(images(256)), kCount + kHead);
  EXPECT_LE(packed(images(5'000)), 2 * kCount + kHead);
  EXPECT_LE(packed(made<LocalImage>([](std::size_t i) { return LocalImage(static_cast<std::int32_t>(i * 100'000)); })),
            4 * kCount + kHead);
}

TEST(PackedColumns, RangesInTheBytesOfTheirLengths) {
  EXPECT_LE(packed(made<std::int64_t>([](std::size_t i) { return 5 * i; })), kHead);
  std::vector<std::int64_t> lengths = made<std::int64_t>([](std::size_t i) { return i % 250; }), begin;
  std::partial_sum(lengths.begin(), lengths.end(), std::back_inserter(begin));
  EXPECT_LE(packed(begin), kCount + kHead);
  using limits = std::numeric_limits<std::int64_t>;
  packed(std::vector<std::int64_t>{limits::max(), 0, limits::min(), 5, limits::max(), limits::min(), -1});
}

TEST(PackedColumns, PointsInTheBytesOfTheirGaps) {
  const std::int64_t far = std::int64_t{1} << 40;
  std::vector<TilePoint> points;
  for (std::int64_t i = 0; i < 9'000; ++i) points.push_back({PointRole::kTie, far + i * i % 100 + 100 * i});
  for (std::int64_t i = 0; i < 10; ++i) points.push_back({i % 3 ? PointRole::kControl : PointRole::kCheck, i});
  std::stringstream file;
  write_column(file, points);
  EXPECT_LE(file.str().size(), 8 * points.size() + 200);
  std::vector<TilePoint> back;
  read_column(file, points.size(), back);
  ASSERT_EQ(back.size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(back[i].role, points[i].role);
    EXPECT_EQ(back[i].index, points[i].index);
  }
  points.resize(9'000);
  EXPECT_LE(written(points).size(), 2 * points.size() + 2 * kHead);
}

TEST(PackedColumns, EmptyOnes) {
  packed(std::vector<double>());
  packed(std::vector<std::uint8_t>());
  packed(std::vector<std::int64_t>());
  packed(std::vector<LocalImage>());
  packed(std::vector<TilePoint>());
}

// Wherever a file ends too early its state says so.
template <typename T>
void expect_named_when_short(const std::vector<T>& values) {
  const std::string bytes = written(values);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    std::istringstream file(bytes.substr(0, size));
    std::vector<T> back;
    read_column(file, values.size(), back);
    EXPECT_FALSE(file) << size << " of " << bytes.size() << " bytes";
  }
}

TEST(PackedColumns, AFileThatEndsEarly) {
  expect_named_when_short(std::vector<double>{0.1, 0.2, 0.3});
  expect_named_when_short(std::vector<double>{1, 2, 3});
  expect_named_when_short(std::vector<double>(100, 0.1));
  expect_named_when_short(std::vector<std::uint8_t>{1, 0, 1});
  expect_named_when_short(std::vector<std::uint8_t>(100, 1));
  expect_named_when_short(std::vector<std::int64_t>{1, 5, 2});
  expect_named_when_short(std::vector<LocalImage>{LocalImage(3), LocalImage(70'000)});
  expect_named_when_short(std::vector<TilePoint>{{PointRole::kTie, 3}, {PointRole::kControl, 9}});
}

// With one byte of what is written changed.
template <typename T>
void expect_refused(const std::vector<T>& values, std::size_t place, char byte) {
  std::string bytes = written(values);
  ASSERT_NE(bytes.at(place), byte);
  bytes[place] = byte;
  std::istringstream file(bytes);
  std::vector<T> back;
  read_column(file, values.size(), back);
  EXPECT_FALSE(file) << place;
}

TEST(PackedColumns, FormsThatAreNone) {
  constexpr std::size_t kForm = 8;  // behind the count
  const std::vector<double> sigmas(100, 0.1), measurements{1, 2, 3};
  expect_refused(sigmas, written(sigmas).size() - 4, 101);  // longer than the column
  expect_refused(sigmas, kForm, 7);
  expect_refused(measurements, kForm, 7);
  expect_refused(measurements, kForm + 1, 4);  // more of them
  expect_refused(std::vector<std::uint8_t>{1, 0, 1}, kForm, 7);
  expect_refused(std::vector<LocalImage>{LocalImage(3), LocalImage(70'000)}, kForm + 8, 3);  // bytes each
  expect_refused(std::vector<LocalImage>{LocalImage(3), LocalImage(70'000)}, kForm + 8, 16);
}

// A count that is damaged asks for no memory: the last byte of one is 2^56 values.
TEST(PackedColumns, CountsOfAnotherColumn) {
  for (const std::size_t place : {0, 7}) {
    expect_refused(std::vector<double>(100, 0.1), place, 1);
    expect_refused(std::vector<double>{0.1, 0.2}, place, 1);
    expect_refused(std::vector<std::uint8_t>(100, 1), place, 1);
    expect_refused(std::vector<std::int64_t>{7, 7, 7}, place, 1);
    expect_refused(std::vector<LocalImage>(5, LocalImage(3)), place, 1);
    expect_refused(std::vector<TilePoint>(3), place, 1);
    expect_refused(std::vector<Eigen::Vector3d>(3, Eigen::Vector3d::Zero()), place, 1);
  }
}

}  // namespace
}  // namespace megablock
