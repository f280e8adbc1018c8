#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "io/report/drawing.h"
#include "io/report/html.h"

namespace megablock::report {

namespace {

constexpr double kWidth = 1000, kMostHeight = 900, kLeastHeight = 320, kMargin = 28;
constexpr double kFoot = 30;                // strip below the map for the scale
constexpr std::size_t kSingleMarks = 3000;  // frames drawn one by one, with their names
constexpr std::size_t kBackgroundPoints = 6000;
constexpr std::size_t kLinks = 20000;
constexpr std::size_t kMostMarks = 200000;
constexpr std::array<const char*, 10> kColours = {"#4e79a7", "#f28e2b", "#59a14f", "#b07aa1", "#76b7b2",
                                                  "#d4a017", "#e15759", "#9c755f", "#ff7f9f", "#7a8b99"};

struct Plane {
  Eigen::Vector2d low = Eigen::Vector2d::Zero(), high = Eigen::Vector2d::Ones();  // metres
  double scale = 1, height = kLeastHeight;                                        // drawing units per metre
  Eigen::Vector2d at(const Eigen::Vector2d& ground) const {
    const Eigen::Vector2d middle = (low + high) / 2;
    return {kWidth / 2 + (ground.x() - middle.x()) * scale, height / 2 - (ground.y() - middle.y()) * scale};
  }
  bool shows(const Eigen::Vector2d& drawn) const {
    return drawn.x() >= 0 && drawn.x() <= kWidth && drawn.y() >= 0 && drawn.y() <= height;
  }
};

Plane plane_over(const std::vector<Eigen::Vector2d>& places) {
  Plane plane;
  if (places.empty()) return plane;
  plane.low = plane.high = places.front();
  for (const Eigen::Vector2d& p : places) {
    plane.low = plane.low.cwiseMin(p);
    plane.high = plane.high.cwiseMax(p);
  }
  const Eigen::Vector2d size = (plane.high - plane.low).cwiseMax(1e-3);
  plane.height = std::clamp(2 * kMargin + (kWidth - 2 * kMargin) * size.y() / size.x(), kLeastHeight, kMostHeight);
  plane.scale = std::min((kWidth - 2 * kMargin) / size.x(), (plane.height - 2 * kMargin) / size.y());
  return plane;
}

// Where a frame is drawn: its pose, else its GNSS position.
std::optional<Eigen::Vector2d> place_of(const BlockResult& result, FrameIndex frame) {
  if (oriented(result, frame)) return result.state.frames[frame].centre.head<2>();
  if (const auto& prior = result.block.frames[frame].position_prior) return prior->position.head<2>();
  return std::nullopt;
}

// Colours such that tiles that share tie points differ, as far as ten colours go.
std::vector<std::size_t> tile_colours(const BlockResult& result) {
  std::vector<std::set<std::int64_t>> beside(static_cast<std::size_t>(result.tiles.tile_count));
  const auto tile_at = [&](std::int64_t o) {
    const FrameIndex frame = result.block.images[result.tracks.image[static_cast<std::size_t>(o)]].frame;
    return result.tiles.tile_of_frame.contains(frame) ? result.tiles.tile_of_frame[frame].value : -1;
  };
  for (std::size_t t = 0; t + 1 < result.tracks.begin.size(); ++t)
    for (std::int64_t o = result.tracks.begin[t] + 1; o < result.tracks.begin[t + 1]; ++o) {
      const std::int64_t a = tile_at(o - 1), b = tile_at(o);
      if (a < 0 || b < 0 || a == b || std::max(a, b) >= result.tiles.tile_count) continue;
      beside[static_cast<std::size_t>(a)].insert(b);
      beside[static_cast<std::size_t>(b)].insert(a);
    }
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
  MapDrawing(const BlockResult& result, const Figures& figures) : result_(result), figures_(figures) {
    std::vector<Eigen::Vector2d> shown;
    const bool any = figures.oriented_frames > 0;
    for (FrameIndex f(0); result.block.frames.contains(f); ++f.value) {
      places_.push_back(place_of(result, f));
      if (places_.back() && (!any || oriented(result, f))) shown.push_back(*places_.back());
    }
    for (const ControlPoint& point : result.block.control_points)
      if (point.position.head<2>().allFinite()) shown.emplace_back(point.position.head<2>());
    empty_ = shown.empty();
    plane_ = plane_over(shown);
  }

  std::string svg() {
    if (empty_) return paragraph("No image has a position.", "muted");
    std::string body = background() + links() + frames() + control_points() + scale_bar();
    if (result_.block.ground.georeferenced) body += north();
    return fmt::format(
        "<svg id=map viewBox=\"0 0 {:.0f} {:.0f}\" role=img aria-label=\"Map of the block\">"
        "<rect width={:.0f} height={:.0f} class=frame />{}</svg>",
        kWidth, plane_.height + kFoot, kWidth, plane_.height + kFoot, body);
  }

 private:
  static std::string dot(const Eigen::Vector2d& p) { return fmt::format("M{:.1f} {:.1f}h0", p.x(), p.y()); }

  std::string background() const {
    std::string path;
    const std::size_t step = 1 + result_.points.size() / kBackgroundPoints;
    for (std::size_t i = 0; i < result_.points.size(); i += step) {
      if (!result_.points[i].allFinite()) continue;
      const Eigen::Vector2d p = plane_.at(result_.points[i].head<2>());
      if (plane_.shows(p)) path += dot(p);
    }
    return "<path class=\"layer points\" d=\"" + path + "\"/>";
  }

  // Frames tied by tracks: within tiles and across.
  std::string links() const {
    if (places_.size() > kSingleMarks) return "";
    std::map<std::pair<std::int64_t, std::int64_t>, std::int64_t> shared;
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
      if (!oriented(result_, a) || !oriented(result_, b) || ++drawn > kLinks) continue;
      const Eigen::Vector2d p = plane_.at(*places_[a]), q = plane_.at(*places_[b]);
      const bool crosses = result_.tiles.tile_of_frame.contains(a) && result_.tiles.tile_of_frame.contains(b) &&
                           result_.tiles.tile_of_frame[a] != result_.tiles.tile_of_frame[b];
      (crosses ? across : within) += fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", p.x(), p.y(), q.x(), q.y());
    }
    return "<g class=\"layer links\" hidden><path class=within d=\"" + within + "\"/><path class=across d=\"" + across +
           "\"/></g>";
  }

  // One path per colour: rings of the boundary frames below, dots above.
  std::string frames() const {
    const std::vector<std::size_t> colour = tile_colours(result_);
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
      if (result_.boundary.contains(f) && result_.boundary[f]) words += ", boundary frame";
    }
    return fmt::format("<circle cx={:.1f} cy={:.1f} r={:.1f} fill=transparent><title>{}</title></circle>", p.x(), p.y(),
                       size, words);
  }

  std::string control_points() const {
    std::string svg;
    for (const ControlPoint& point : result_.block.control_points) {
      if (!point.position.head<2>().allFinite()) continue;
      const Eigen::Vector2d p = plane_.at(point.position.head<2>());
      svg += fmt::format("<path class={} d=\"M{:.1f} {:.1f}l7 12h-14z\"><title>{} {}</title></path>",
                         point.role == PointRole::kCheck ? "check" : "control", p.x(), p.y() - 8,
                         point.role == PointRole::kCheck ? "check point" : "control point", escape(point.name));
    }
    return svg;
  }

  std::string scale_bar() const {
    const double length = round_step((plane_.high - plane_.low).maxCoeff() / 5, 1);
    const double drawn = length * plane_.scale, y = plane_.height + kFoot - 14;
    const std::string label = length >= 1000 ? significant(length / 1000, 2) + " km" : significant(length, 2) + " m";
    return fmt::format(
        "<g class=scale><rect x=8 y={:.1f} width={:.1f} height=26 rx=4 />"
        "<path d=\"M16 {:.1f}v-6m0 3h{:.1f}m0 3v-6\"/><text x={:.1f} y={:.1f}>{}</text></g>",
        y - 16, drawn + 90, y, drawn, drawn + 24, y + 2, label);
  }

  std::string north() const {
    return fmt::format(
        "<g class=scale transform=\"translate({:.0f} 34)\"><path class=needle d=\"M0 -22l7 24l-7 -5l-7 5z\"/>"
        "<text y=18 text-anchor=middle>N</text></g>",
        kWidth - 24);
  }

  const BlockResult& result_;
  const Figures& figures_;
  IndexedVector<FrameIndex, std::optional<Eigen::Vector2d>> places_;
  Plane plane_;
  bool empty_ = true;
};

}  // namespace

std::string draw_map(const BlockResult& result, const Figures& figures) { return MapDrawing(result, figures).svg(); }

std::string map_legend(const BlockResult& result, const Figures& figures) {
  std::string text = "<span class=key><i class=tilekey></i>frames, one colour per tile</span>";
  if (figures.boundary_frames) text += "<span class=key><i class=ringkey></i>boundary frame</span>";
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
