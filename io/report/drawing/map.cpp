// Draws the map of the block.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "io/report/drawing/drawing.h"
#include "io/report/drawing/html.h"
#include "io/report/drawing/plane.h"

namespace megablock::report {

namespace {

constexpr std::size_t kSingleMarks = 3000;  // up to so many frames are drawn one by one, with their names
constexpr std::size_t kBackgroundPoints = 6000;
constexpr std::size_t kSpreadAtATime = 128;  // frames between two calls of after_reading; their images are spread
constexpr std::size_t kLinks = 20000;
constexpr std::size_t kMostMarks = 200000;
constexpr std::array<const char*, 10> kColours = {"#4e79a7", "#f28e2b", "#59a14f", "#b07aa1", "#76b7b2",
                                                  "#d4a017", "#e15759", "#9c755f", "#ff7f9f", "#7a8b99"};

// Gives the tiles colours such that tiles with common tie points differ, as far as ten colours suffice: each tile in
// turn takes the colour that the fewest of its coloured neighbours have.
std::vector<std::size_t> tile_colours(const BlockResult& result, const std::function<void()>& after_reading) {
  std::vector<std::set<std::int64_t>> beside(static_cast<std::size_t>(result.tiles.tile_count));
  const auto tile_at = [&](std::int64_t o) {
    const FrameIndex frame = result.block.images[result.tracks.image[static_cast<std::size_t>(o)]].frame;
    return result.tiles.tile_of_frame.contains(frame) ? result.tiles.tile_of_frame[frame].value : -1;
  };
  for (std::size_t t = 0; t + 1 < result.tracks.begin.size(); ++t) {
    if (t % kTracksAtATime == 0) after_reading();
    for (std::int64_t o = result.tracks.begin[t] + 1; o < result.tracks.begin[t + 1]; ++o) {
      const std::int64_t a = tile_at(o - 1), b = tile_at(o);
      if (a < 0 || b < 0 || a == b || std::max(a, b) >= result.tiles.tile_count) continue;
      beside[static_cast<std::size_t>(a)].insert(b);
      beside[static_cast<std::size_t>(b)].insert(a);
    }
  }
  after_reading();
  std::vector<std::size_t> colour(beside.size(), kColours.size());
  for (std::size_t t = 0; t < beside.size(); ++t) {
    std::array<int, kColours.size()> used{};
    for (std::int64_t other : beside[t])
      if (colour[static_cast<std::size_t>(other)] < kColours.size()) ++used[colour[static_cast<std::size_t>(other)]];
    std::size_t best = t % kColours.size();
    for (std::size_t k = 0; k < kColours.size(); ++k) {
      const std::size_t candidate = (t + k) % kColours.size();
      if (used[candidate] < used[best]) best = candidate;
    }
    colour[t] = best;
  }
  return colour;
}

class MapDrawing {
 public:
  MapDrawing(const BlockResult& result, const FrameSelection& selected, const char* unit, bool placed,
             const std::function<void()>& after_reading)
      : result_(result),
        unit_(unit),
        placed_(placed),
        after_reading_(after_reading),
        drawn_(plane_of(result, selected, placed, after_reading)) {
    if (drawn_) plane_ = *drawn_;
    places_.reserve(result.block.frames.size());
    for (FrameIndex f(0); result.block.frames.contains(f); ++f.value)
      places_.push_back(selected(f) ? place_of(result, f) : std::nullopt);
  }

  std::string svg() {
    if (!drawn_) return paragraph("No image has a position.", "muted");
    std::string body = coordinate_grid(plane_, unit_) + background() + links() + frames();
    if (placed_) body += control_points();
    body += scale_bar(plane_, unit_);
    if (placed_ && result_.block.ground.georeferenced) body += north_arrow();
    return open_map(plane_, "Map of the block") + body + "</svg>";
  }

 private:
  // A line of no length with round ends: all dots of one colour are one path, which is far smaller than circles.
  static std::string dot(const Eigen::Vector2d& p) { return fmt::format("M{:.1f} {:.1f}h0", p.x(), p.y()); }

  bool here(std::size_t track) const {  // whether the tie point belongs to the selected frames
    return is_of(result_, track, [&](FrameIndex frame) { return places_[frame].has_value(); });
  }

  std::string background() const {
    std::string path;
    const std::size_t step = 1 + result_.points.size() / kBackgroundPoints;
    for (std::size_t i = 0; i < result_.points.size(); i += step) {
      if (i / step % kSpreadAtATime == 0) after_reading_();
      if (!result_.points[i].allFinite() || !here(i)) continue;
      const Eigen::Vector2d p = plane_.at(result_.points[i].head<2>());
      if (plane_.shows(p)) path += dot(p);
    }
    return "<path class=\"layer points\" d=\"" + path + "\"/>";
  }

  // Lines between frames with common tracks, within tiles and across.
  std::string links() const {
    if (places_.size() > kSingleMarks) return "";
    std::map<std::pair<std::int64_t, std::int64_t>, std::int64_t> shared;
    // A sample of the tracks shows every link of many tracks; single ones may be missing.
    const std::size_t step = 1 + result_.tracks.id.size() / 200000;
    for (std::size_t t = 0; t + 1 < result_.tracks.begin.size(); t += step)
      for (std::int64_t o = result_.tracks.begin[t] + 1; o < result_.tracks.begin[t + 1]; ++o) {
        const auto frame = [&](std::int64_t i) {
          return result_.block.images[result_.tracks.image[static_cast<std::size_t>(i)]].frame.value;
        };
        if (frame(o - 1) != frame(o)) ++shared[std::minmax(frame(o - 1), frame(o))];
      }
    std::string within, across;
    std::size_t drawn = 0;
    for (const auto& [pair, tracks] : shared) {
      const FrameIndex a(pair.first), b(pair.second);
      if (!oriented(result_, a) || !oriented(result_, b) || !places_[a] || !places_[b] || ++drawn > kLinks) continue;
      const Eigen::Vector2d p = plane_.at(*places_[a]), q = plane_.at(*places_[b]);
      const bool crosses = result_.tiles.tile_of_frame.contains(a) && result_.tiles.tile_of_frame.contains(b) &&
                           result_.tiles.tile_of_frame[a] != result_.tiles.tile_of_frame[b];
      (crosses ? across : within) += fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", p.x(), p.y(), q.x(), q.y());
    }
    return "<g class=\"layer links\" hidden><path class=within d=\"" + within + "\"/><path class=across d=\"" + across +
           "\"/></g>";
  }

  // The frames, one path per colour: rings of the separator frames below, dots above.
  std::string frames() const {
    const std::vector<std::size_t> colour = tile_colours(result_, after_reading_);
    const std::size_t step = 1 + places_.size() / kMostMarks;
    const double size = places_.size() > 20000          ? 2.5
                        : places_.size() > kSingleMarks ? 4
                        : places_.size() > 500          ? 7
                                                        : 11;
    std::array<std::string, kColours.size() + 1> dots;
    std::string rings, lost, names;
    for (FrameIndex f(0); places_.contains(f); f.value += static_cast<std::int64_t>(step)) {
      if (!places_[f]) continue;
      const Eigen::Vector2d p = plane_.at(*places_[f]);
      if (!plane_.shows(p)) continue;
      if (!oriented(result_, f)) {
        lost += fmt::format("M{:.1f} {:.1f}l8 8m0-8l-8 8", p.x() - 4, p.y() - 4);
      } else {
        const bool tiled = result_.tiles.tile_of_frame.contains(f) && result_.tiles.tile_of_frame[f].valid();
        const auto tile = tiled ? static_cast<std::size_t>(result_.tiles.tile_of_frame[f].value) : colour.size();
        dots[tile < colour.size() ? colour[tile] : kColours.size()] += dot(p);
        if (result_.boundary.contains(f) && result_.boundary[f]) rings += dot(p);
      }
      if (places_.size() <= kSingleMarks) names += name_mark(f, p, size);
    }
    std::string svg = fmt::format("<path class=\"layer boundary\" stroke-width={:.1f} d=\"{}\"/>", size + 3.6, rings);
    for (std::size_t k = 0; k < dots.size(); ++k)
      if (!dots[k].empty())
        svg += fmt::format("<path class=dots stroke=\"{}\" stroke-width={:.1f} d=\"{}\"/>",
                           k < kColours.size() ? kColours[k] : "#444", size, dots[k]);
    return svg + "<path class=lost d=\"" + lost + "\"/>" + names;
  }

  // An invisible disc that shows the frame's name and figures.
  std::string name_mark(FrameIndex f, const Eigen::Vector2d& p, double size) const {
    std::string words = escape(result_.block.frames[f].name);
    if (!oriented(result_, f)) {
      words += ": not oriented";
    } else if (result_.tiles.tile_of_frame.contains(f) && result_.tiles.tile_of_frame[f].valid()) {
      words += ": tile " + count(result_.tiles.tile_of_frame[f].value);
      if (result_.boundary.contains(f) && result_.boundary[f]) words += ", separator frame";
    }
    return fmt::format("<circle cx={:.1f} cy={:.1f} r={:.1f} fill=transparent><title>{}</title></circle>", p.x(), p.y(),
                       size, words);
  }

  std::string control_points() const {
    std::string svg;
    for (std::size_t row = 0; row < result_.block.control_points.size(); ++row) {
      const auto place = place_of_control(result_, row);
      if (!place || !plane_.shows(plane_.at(*place))) continue;
      const Eigen::Vector2d p = plane_.at(*place);
      const ControlPoint& point = result_.block.control_points[row];
      svg += fmt::format("<path class={} d=\"M{:.1f} {:.1f}l7 12h-14z\"><title>{} {}</title></path>",
                         point.role == PointRole::kCheck ? "check" : "control", p.x(), p.y() - 8,
                         point.role == PointRole::kCheck ? "check point" : "control point", escape(point.name));
    }
    return svg;
  }

  const BlockResult& result_;
  const char* unit_;
  bool placed_;
  const std::function<void()>& after_reading_;
  std::optional<Plane> drawn_;
  Plane plane_;
  IndexedVector<FrameIndex, std::optional<Eigen::Vector2d>> places_;
};

}  // namespace

std::string draw_map(const BlockResult& result, const FrameSelection& selected, const char* unit, bool placed,
                     const std::function<void()>& after_reading) {
  return MapDrawing(result, selected, unit, placed, after_reading).svg();
}

std::string map_legend(const BlockResult& result, const Figures& figures) {
  std::string text = "<span class=key><i class=tilekey></i>frames, one colour per tile</span>";
  if (figures.boundary_frames) text += "<span class=key><i class=ringkey></i>separator frame</span>";
  if (!figures.not_oriented.empty()) text += "<span class=key><b class=lostkey>×</b>not oriented</span>";
  bool control = false, check = false;
  for (const ControlPoint& point : result.block.control_points)
    (point.role == PointRole::kCheck ? check : control) = true;
  if (control) text += "<span class=key><b class=controlkey>▲</b>control point</span>";
  if (check) text += "<span class=key><b class=controlkey>△</b>check point</span>";
  if (!result.points.empty()) text += "<span class=key><i class=pointkey></i>tie points</span>";
  return "<p class=legend>" + text + "</p>";
}

}  // namespace megablock::report
