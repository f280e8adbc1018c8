#include "io/block/crs.h"

#include <gmock/gmock.h>

#include <cmath>
#include <optional>
#include <thread>

#include "geometry/numbers/angles.h"
#include "io/base/error.h"

namespace megablock {
namespace {

// Geocentric coordinates from the defining formulas of the ellipsoid.
Eigen::Vector3d geocentric(const Geodetic& p) {
  const double a = 6378137, f = 1 / 298.257223563, e2 = f * (2 - f);
  const double phi = p.latitude_deg * kDegree, lambda = p.longitude_deg * kDegree;
  const double n = a / std::sqrt(1 - e2 * std::sin(phi) * std::sin(phi));
  return {(n + p.height_m) * std::cos(phi) * std::cos(lambda), (n + p.height_m) * std::cos(phi) * std::sin(lambda),
          (n * (1 - e2) + p.height_m) * std::sin(phi)};
}

const GroundFrame kGround{true, 46.84, -91.99, 200, "EPSG:4979"};

TEST(Georeference, IsEastNorthUpAboutTheOrigin) {
  const Georeference reference(kGround);
  EXPECT_LT(reference.to_local({46.84, -91.99, 200}).norm(), 1e-8);
  EXPECT_LT((reference.to_local({46.84, -91.99, 230}) - Eigen::Vector3d(0, 0, 30)).norm(), 1e-8);
  const Eigen::Vector3d east = reference.to_local({46.84, -91.989, 200}),
                        north = reference.to_local({46.841, -91.99, 200});
  EXPECT_NEAR(east.x(), 76.25, 0.05);
  EXPECT_LT(std::abs(east.y()), 0.01);
  EXPECT_NEAR(north.y(), 111.17, 0.05);
  EXPECT_NEAR(north.x(), 0, 1e-6);
}

TEST(Georeference, IsARigidMotionOfGeocentricCoordinatesAndReturns) {
  const Georeference reference(kGround);
  const Geodetic a{46.9, -92.1, 350}, b{46.7, -91.8, 10};
  const double distance = (reference.to_local(a) - reference.to_local(b)).norm();
  EXPECT_NEAR(distance, (geocentric(a) - geocentric(b)).norm(), 1e-6);
  const Geodetic back = reference.to_geodetic(reference.to_local(a));
  EXPECT_NEAR(back.latitude_deg, a.latitude_deg, 1e-12);
  EXPECT_NEAR(back.longitude_deg, a.longitude_deg, 1e-12);
  EXPECT_NEAR(back.height_m, a.height_m, 1e-7);
}

TEST(Georeference, OwnVerticalTiltsByTheDistanceOverTheEarthsRadius) {
  const Georeference reference(kGround);
  const Geodetic far{46.93, -91.99, 200};  // 10 km north
  const Eigen::Quaterniond turn = reference.own_from_block(far);
  // The own vertical, seen in the block, leans to the north (+y).
  const Eigen::Vector3d up = turn.conjugate() * Eigen::Vector3d::UnitZ();
  EXPECT_NEAR(std::atan2(up.y(), up.z()) / kDegree, 0.09, 1e-6);
  EXPECT_NEAR(up.x(), 0, 1e-12);
  // It is the difference of two heights on the same plumb line.
  const Eigen::Vector3d plumb = reference.to_local({46.93, -91.99, 300}) - reference.to_local(far);
  EXPECT_LT((plumb / 100 - up).norm(), 1e-8);
}

TEST(Georeference, RefusesABlockWithoutOrigin) { EXPECT_THROW(Georeference(GroundFrame{}), InputError); }

TEST(Georeference, ObjectsOfDifferentThreadsAgree) {
  std::vector<Eigen::Vector3d> results(4);
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < results.size(); ++i)
    threads.emplace_back([&, i] {
      const Georeference reference(kGround);
      for (int k = 0; k < 2000; ++k) results[i] = reference.to_local({46.85, -91.98, 210});
    });
  for (std::thread& thread : threads) thread.join();
  for (const Eigen::Vector3d& result : results) EXPECT_EQ(result, results[0]);
}

TEST(CrsToWgs84, KnowsUtmByEveryNameOfIt) {
  // Central meridian of zone 33 at the equator's false easting.
  for (const char* name : {"EPSG:32633", "WGS84 UTM 33N", "+proj=utm +zone=33 +datum=WGS84 +units=m +no_defs"}) {
    const CrsToWgs84 crs(name);
    const Geodetic p = crs.to_wgs84({500000, 0, 123});
    EXPECT_NEAR(p.latitude_deg, 0, 1e-9) << name;
    EXPECT_NEAR(p.longitude_deg, 15, 1e-9) << name;
    EXPECT_NEAR(p.height_m, 123, 1e-6) << name;
    const Eigen::Vector3d back = crs.from_wgs84(crs.to_wgs84({400123, 5820456, 34}));
    EXPECT_LT((back - Eigen::Vector3d(400123, 5820456, 34)).norm(), 1e-4) << name;
  }
}

TEST(CrsToWgs84, ReadsWkt) {
  const char* const wkt =
      R"(PROJCS["of the job",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],)"
      R"(PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],)"
      R"(PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",15],PARAMETER["scale_factor",0.9996],)"
      R"(PARAMETER["false_easting",500000],PARAMETER["false_northing",0],UNIT["metre",1]])";
  EXPECT_NEAR(CrsToWgs84(wkt).to_wgs84({500000, 0, 0}).longitude_deg, 15, 1e-9);
}

TEST(CrsToWgs84, TakesLongitudeFirstAndKeepsWgs84) {
  for (const char* name : {"WGS84", "EPSG:4326", "EPSG:4979"}) {
    const Geodetic p = CrsToWgs84(name).to_wgs84({13.4, 52.5, 30});
    EXPECT_NEAR(p.latitude_deg, 52.5, 1e-12) << name;
    EXPECT_NEAR(p.longitude_deg, 13.4, 1e-12) << name;
    EXPECT_NEAR(p.height_m, 30, 1e-9) << name;
  }
}

TEST(CrsToWgs84, KnowsTheNamesOfOtherPrograms) {
  const Eigen::Vector3d place(500000, 5000000, 10);
  const auto same = [&](const char* name, const char* code) {
    EXPECT_LT((CrsToWgs84(name).from_wgs84(CrsToWgs84(code).to_wgs84(place)) - place).norm(), 1e-4) << name;
  };
  for (const char* name : {"WGS84 UTM 11 N", "wgs84 utm 11n", "WGS 84 / UTM zone 11N", "+init=epsg:32611",
                           "EPSG::32611", "+init=epsg:32611 +units=m", "epsg:32611", "EPSG: 32611"})
    same(name, "EPSG:32611");
  same("WGS84 UTM 33S", "EPSG:32733");
  same("ETRS89 / UTM zone 32N", "EPSG:25832");
  same("NAD83 UTM 11N", "EPSG:26911");
  for (const char* name : {"WGS84 UTM 61N", "ETRS89 UTM 33S", "WGS84 UTM 11", "WGS84 UTM 11NX", "EPSG:32611+nothing"})
    EXPECT_THROW(CrsToWgs84{name}, InputError) << name;
}

// Undulations that the NGA publishes as the test of its program for EGM96 (outintpt.dat of f477).
TEST(CrsToWgs84, HeightsAboveTheGeoidAreThoseOfEgm96) {
  for (const char* name : {"EPSG:4326+5773", "EPSG:4326+EPSG:5773", "EPSG:4326 + EGM96"}) {
    std::optional<CrsToWgs84> crs;
    try {
      crs.emplace(name);
    } catch (const InputError&) {
      GTEST_SKIP() << "the grid of EGM96 is not installed";
    }
    EXPECT_NEAR(crs->to_wgs84({269.7791550 - 360, 38.6281550, 100}).height_m, 100 - 31.629, 0.1) << name;
    EXPECT_NEAR(crs->to_wgs84({102.4487290, 46.8743190, 0}).height_m, -43.572, 0.1) << name;
    EXPECT_NEAR(crs->to_wgs84({0.0023, -0.466744, 0}).height_m, 17.330, 0.1) << name;
  }
}

// Heights above a geoid are transformed with its grid, or refused; never passed through.
TEST(CrsToWgs84, OrthometricHeightsNeedTheirGrid) {
  for (const char* name : {"EPSG:4326+5773", "EPSG:25832+7837", "EPSG:32633+3855"}) {
    try {
      const CrsToWgs84 crs(name);
      const bool geographic = std::string(name).starts_with("EPSG:4326");
      const Geodetic p =
          crs.to_wgs84(geographic ? Eigen::Vector3d(13.4, 52.5, 30) : Eigen::Vector3d(500000, 5800000, 30));
      EXPECT_GT(std::abs(p.height_m - 30), 30) << name << ": the geoid lies about 40 m above the ellipsoid here";
      EXPECT_LT(std::abs(p.height_m - 30), 60) << name;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), ::testing::HasSubstr("grid")) << name;
    }
  }
}

TEST(CrsToWgs84, RefusesUnknownSystemsAndImpossiblePositions) {
  EXPECT_THROW(CrsToWgs84("EPSG:99999999"), InputError);
  EXPECT_THROW(CrsToWgs84("the town's grid"), InputError);
  for (const char* part_of_names : {"FOO", "utm", "Paris", "WGS 84 / UTM", "ETRS89"})
    EXPECT_THROW(CrsToWgs84{part_of_names}, InputError) << part_of_names;
  EXPECT_THROW(CrsToWgs84(""), InputError);
  EXPECT_THROW(CrsToWgs84("EPSG:4326").to_wgs84({13, 152, 0}), InputError);
}

}  // namespace
}  // namespace megablock
