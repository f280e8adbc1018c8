#include "io/block/crs.h"

#include <proj.h>
#include <proj_experimental.h>

#include <cctype>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "io/base/error.h"

namespace megablock {

namespace detail {

// A PROJ transformation together with its context.
class ProjTransform {
 public:
  ProjTransform() : context_(proj_context_create()) {
    proj_log_level(context_, PJ_LOG_NONE);
    // A grid that is fetched on one machine and missing on another would change heights without a word.
    proj_context_set_enable_network(context_, 0);
  }
  ~ProjTransform() {
    proj_destroy(transform_);
    proj_context_destroy(context_);
  }
  ProjTransform(const ProjTransform&) = delete;
  ProjTransform& operator=(const ProjTransform&) = delete;

  PJ_CONTEXT* context() const { return context_; }
  void set(PJ* transform) { transform_ = transform; }

  // Transforms a point in place. Returns false when PROJ cannot.
  bool apply(PJ_DIRECTION direction, Eigen::Vector3d& xyz) const {
    proj_errno_reset(transform_);
    const PJ_COORD result = proj_trans(transform_, direction, proj_coord(xyz.x(), xyz.y(), xyz.z(), HUGE_VAL));
    if (proj_errno(transform_) != 0) return false;
    xyz = {result.xyz.x, result.xyz.y, result.xyz.z};
    return xyz.allFinite();
  }

 private:
  PJ_CONTEXT* context_;
  PJ* transform_ = nullptr;
};

}  // namespace detail

namespace {

struct ProjDeleter {
  void operator()(PJ* object) const { proj_destroy(object); }
};
using ProjObject = std::unique_ptr<PJ, ProjDeleter>;

double radians(double degrees) { return degrees * (std::numbers::pi / 180); }

// Rotation from geocentric axes to east, north, up; the rows are these directions.
Eigen::Matrix3d enu_from_geocentric(double latitude_deg, double longitude_deg) {
  // With latitude p and longitude l: east = (-sin l, cos l, 0), up = (cos p cos l, cos p sin l, sin p), north = up x
  // east.
  const double sp = std::sin(radians(latitude_deg)), cp = std::cos(radians(latitude_deg));
  const double sl = std::sin(radians(longitude_deg)), cl = std::cos(radians(longitude_deg));
  Eigen::Matrix3d m;
  m << -sl, cl, 0, -sp * cl, -sp * sl, cp, cp * cl, cp * sl, sp;
  return m;
}

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

// The code of a UTM zone from a name in upper case without blanks, slashes and the word ZONE: WGS84UTM11N. Each datum
// numbers its codes by zone. Empty for other names.
std::string code_of_utm(const std::string& name) {
  struct Datum {
    const char* name;
    int north, south, first_zone, last_zone;  // the code of a zone is `north` or `south` plus its number; 0: none
  };
  static constexpr Datum kDatums[] = {
      {"WGS84", 32600, 32700, 1, 60}, {"ETRS89", 25800, 0, 28, 38}, {"NAD83", 26900, 0, 1, 23}};
  for (const Datum& datum : kDatums) {
    int zone = 0;
    char hemisphere = 0, more = 0;
    const std::string format = std::string(datum.name) + "UTM%d%c%c";
    if (std::sscanf(name.c_str(), format.c_str(), &zone, &hemisphere, &more) != 2) continue;
    const int base = hemisphere == 'N' ? datum.north : hemisphere == 'S' ? datum.south : 0;
    if (base > 0 && zone >= datum.first_zone && zone <= datum.last_zone) return "EPSG:" + std::to_string(base + zone);
  }
  return "";
}

std::string without(std::string text, const std::string& part) {
  for (std::size_t at; (at = text.find(part)) != std::string::npos;) text.erase(at, part.size());
  return text;
}

// "EPSG:32611+5773" from a name in upper case without blanks; codes may have two colons, and the vertical part may
// repeat EPSG or be the name of a world-wide geoid. Empty for other names.
std::string code_of_epsg(std::string name) {
  if (name.starts_with("EPSG::")) name.erase(5, 1);
  if (!name.starts_with("EPSG:")) return "";
  const std::size_t plus = name.find('+');
  std::string horizontal = name.substr(5, plus == std::string::npos ? plus : plus - 5), vertical;
  if (horizontal == "4326" && plus == std::string::npos) return "EPSG:4979";
  if (plus != std::string::npos) vertical = without(without(name.substr(plus + 1), "EPSG::"), "EPSG:");
  if (vertical == "EGM96") vertical = "5773";
  if (vertical == "EGM2008") vertical = "3855";
  return "EPSG:" + horizontal + (vertical.empty() ? "" : "+" + vertical);
}

// PROJ's name of a system, also for the other forms that control files use.
std::string proj_name(const std::string& crs) {
  if (crs.find('[') != std::string::npos) return crs;  // WKT
  const std::string name = without(without(upper(crs), " "), "\t");
  if (name == "WGS84") return "EPSG:4979";
  if (const std::string code = code_of_utm(without(without(name, "/"), "ZONE")); !code.empty()) return code;
  if (const std::string code = code_of_epsg(name); !code.empty()) return code;
  // The old form of PROJ 4. Further parameters would only repeat the definition.
  if (name.starts_with("+INIT=EPSG:")) return code_of_epsg(name.substr(6, name.find('+', 1) - 6));
  if (crs.starts_with("+") && crs.find("+type=crs") == std::string::npos) return crs + " +type=crs";
  return crs;
}

// Whether the text is a code of an authority, a PROJ string or WKT. PROJ would take any other text as a part of a name
// and choose among the systems that contain it.
bool names_one_system(const std::string& proj_name) {
  const std::size_t colon = proj_name.find(':');
  const bool code = colon != std::string::npos && colon > 0 && proj_name.find_first_of(" \t") == std::string::npos;
  return code || proj_name.starts_with("+") || proj_name.find('[') != std::string::npos;
}

// Whether longitude and latitude (degrees) are plausible.
bool in_range(const Eigen::Vector3d& p) { return std::abs(p.x()) <= 360 && std::abs(p.y()) <= 90; }

}  // namespace

Georeference::Georeference(const GroundFrame& ground)
    : ground_(ground), transform_(std::make_unique<detail::ProjTransform>()) {
  if (!ground.georeferenced) throw InputError("the block is not georeferenced: no WGS84 coordinates can be given");
  char pipeline[512];
  std::snprintf(pipeline, sizeof pipeline,
                "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 "
                "+step +proj=topocentric +ellps=WGS84 +lat_0=%.15g +lon_0=%.15g +h_0=%.15g",
                ground.latitude_deg, ground.longitude_deg, ground.height_m);
  PJ* transform = proj_create(transform_->context(), pipeline);
  if (!transform) throw Error("PROJ cannot set up the local frame; is proj-data installed?");
  transform_->set(transform);
}
Georeference::~Georeference() = default;
Georeference::Georeference(Georeference&&) noexcept = default;
Georeference& Georeference::operator=(Georeference&&) noexcept = default;

Eigen::Vector3d Georeference::to_local(const Geodetic& position) const {
  Eigen::Vector3d xyz(position.longitude_deg, position.latitude_deg, position.height_m);
  if (!in_range(xyz) || !transform_->apply(PJ_FWD, xyz))
    throw InputError(
        "a WGS84 position is out of range; latitudes must lie in [-90, 90], longitudes in [-360, 360] degrees");
  return xyz;
}

Geodetic Georeference::to_geodetic(const Eigen::Vector3d& local) const {
  Eigen::Vector3d xyz = local;
  if (!transform_->apply(PJ_INV, xyz)) throw InputError("a local position has no WGS84 coordinates; check 'origin'");
  return {xyz.y(), xyz.x(), xyz.z()};
}

Eigen::Quaterniond Georeference::own_from_block(const Geodetic& position) const {
  const Eigen::Matrix3d own = enu_from_geocentric(position.latitude_deg, position.longitude_deg);
  const Eigen::Matrix3d block = enu_from_geocentric(ground_.latitude_deg, ground_.longitude_deg);
  return Eigen::Quaterniond(Eigen::Matrix3d(own * block.transpose())).normalized();
}

CrsToWgs84::CrsToWgs84(const std::string& crs) : crs_(crs), transform_(std::make_unique<detail::ProjTransform>()) {
  PJ_CONTEXT* context = transform_->context();
  const std::string name = proj_name(crs);
  ProjObject source(names_one_system(name) ? proj_create(context, name.c_str()) : nullptr);
  if (!source || !proj_is_crs(source.get()))
    throw InputError("coordinate reference system '" + crs +
                     "' is not known to PROJ; write a code (EPSG:25832), WGS84, WGS84 UTM 32N, a PROJ string or WKT");
  // A two-dimensional system gets an ellipsoidal height. One with a vertical part keeps its own heights.
  ProjObject source_3d(proj_crs_promote_to_3D(context, nullptr, source.get()));
  ProjObject target(proj_create(context, "EPSG:4979"));
  const char* const options[] = {"ALLOW_BALLPARK=NO", nullptr};
  PJ* transform = proj_create_crs_to_crs_from_pj(context, source_3d ? source_3d.get() : source.get(), target.get(),
                                                 nullptr, options);
  if (!transform)
    throw InputError("coordinates in '" + crs +
                     "' cannot be transformed to WGS84: a grid (a geoid, say) that PROJ needs is not installed; "
                     "install it (package proj-data or cdn.proj.org) or give ellipsoidal heights");
  // PROJ follows the axis order of each authority, which is often latitude first. Normalised, x is always east or
  // longitude.
  PJ* normalised = proj_normalize_for_visualization(context, transform);
  proj_destroy(transform);
  transform_->set(normalised);
}
CrsToWgs84::~CrsToWgs84() = default;
CrsToWgs84::CrsToWgs84(CrsToWgs84&&) noexcept = default;
CrsToWgs84& CrsToWgs84::operator=(CrsToWgs84&&) noexcept = default;

Geodetic CrsToWgs84::to_wgs84(const Eigen::Vector3d& xyz) const {
  Eigen::Vector3d p = xyz;
  if (!transform_->apply(PJ_FWD, p) || !in_range(p)) {
    char text[160];
    std::snprintf(text, sizeof text, "position (%.3f, %.3f, %.3f) cannot be transformed from ", xyz.x(), xyz.y(),
                  xyz.z());
    throw InputError(text + crs_ + " to WGS84; check the order of the coordinates and the installed grids");
  }
  return {p.y(), p.x(), p.z()};
}

Eigen::Vector3d CrsToWgs84::from_wgs84(const Geodetic& position) const {
  Eigen::Vector3d p(position.longitude_deg, position.latitude_deg, position.height_m);
  if (!transform_->apply(PJ_INV, p))
    throw InputError("a WGS84 position cannot be transformed to " + crs_ +
                     "; check that 'origin' lies in the area of that system");
  return p;
}

}  // namespace megablock
