#include "merge/tile/cluster_scores.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "geometry/numbers/decompositions.h"
#include "merge/plan/unknowns.h"
#include "merge/tile/cell_assembler.h"
#include "merge/tile/reduced_point.h"

namespace megablock {

namespace {

constexpr double kLeverageUnits = 32;
constexpr double kFields = 12;  // along the longer side of an image
// A cluster whose unknowns follow its residuals nearly completely tells little; its score is not multiplied further.
constexpr double kMostShare = 0.8;

std::int64_t first_kept(const TileProblem& problem, std::int64_t point) {
  std::int64_t row = problem.begin[at(point)];
  while (!problem.kept[at(row)]) ++row;
  return row;
}

// The image in which a point begins, and the number of the field there.
std::pair<std::int32_t, std::int32_t> field_of(const TileProblem& problem, const std::vector<double>& extents,
                                               std::int64_t point) {
  const std::int64_t row = first_kept(problem, point);
  const LocalImage image = problem.image[at(row)];
  const double field = extents[at(problem.images[at(image.value)].camera.value)] / kFields;
  const auto along = [&](double pixel) { return static_cast<std::int32_t>(std::floor(pixel / field)) & 0x7fff; };
  return {image.value, along(problem.x[at(row)]) | along(problem.y[at(row)]) << 15};
}

// The share of the errors of a cluster that its unknowns follow.
double followed_share(double concentration, double leverage, double rank) {
  return std::min(kMostShare, concentration * leverage / std::max(1.0, rank));
}

}  // namespace

std::vector<double> observed_extents(const TileProblem& problem) {
  std::vector<double> extents(problem.cameras.size(), 1);
  for (std::size_t row = 0; row < problem.kept.size(); ++row) {
    if (!problem.kept[row]) continue;
    double& extent = extents[at(problem.images[at(problem.image[row].value)].camera.value)];
    extent = std::max({extent, problem.x[row], problem.y[row]});
  }
  return extents;
}

ClusterWeights cluster_weights(const TileProblem& problem, const TileCovariance& covariance) {
  ClusterWeights weights{std::vector<std::uint8_t>(problem.points.size(), 0), observed_extents(problem),
                         covariance.concentration};
  for (std::size_t p = 0; p < problem.points.size(); ++p) {
    double sum = 0;
    bool any = false;
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row) {
      const double x = covariance.redundancy_x[at(row)], y = covariance.redundancy_y[at(row)];
      if (!problem.kept[at(row)] || !std::isfinite(x) || !std::isfinite(y)) continue;
      any = true;
      sum += 2 - x - y;
    }
    // The point itself takes three.
    if (any)
      weights.leverages[p] = static_cast<std::uint8_t>(std::lround(std::clamp((sum - 3) * kLeverageUnits, 0.0, 255.0)));
  }
  return weights;
}

ClusterScores::ClusterScores(const TileProblem& problem, const TilePlan& plan, const ClusterWeights& weights,
                             Front& front)
    : problem_(problem), plan_(plan), weights_(weights), front_(front) {
  for (const Unknown& u : plan.unknowns) rows_.push_back(front.row_of(u.id));
}

ClusterScores::Cluster& ClusterScores::cluster_of(std::int64_t point) {
  Cluster& cluster = clusters_[field_of(problem_, weights_.extents, point)];
  if (cluster.column < 0) {
    cluster.column = std::ssize(scores_);
    scores_.push_back(Eigen::VectorXd::Zero(front_.dimension()));
  }
  return cluster;
}

void ClusterScores::add_points(const PointEquations& equations) {
  for (std::size_t i = 0; i < equations.points().size(); ++i) {
    const PointEquations::Point& point = equations.points()[i];
    ReducedPoint reduced(equations, i);
    const bool tie = problem_.points[at(point.point)].role == PointRole::kTie;
    const double weight = kScoreWeight * (tie ? kMeanShare * weights_.ratio : 1);
    reduced.visit_normal([&](std::int64_t a, std::int64_t b, const Eigen::Ref<const Eigen::MatrixXd>& block) {
      if (rows_[at(a)] >= rows_[at(b)]) add_block(front_, rows_[at(a)], rows_[at(b)], weight * block);
    });
    if (!tie) continue;
    Cluster& cluster = cluster_of(point.point);
    Eigen::VectorXd& score = scores_[at(cluster.column)];
    cluster.leverage += weights_.leverages[at(point.point)] / kLeverageUnits;
    cluster.rank += 2 * point.observation_count() - 3;
    ++cluster.points;
    reduced.visit_score([&](std::int64_t unknown, const Eigen::Ref<const Eigen::VectorXd>& part) {
      score.segment(rows_[at(unknown)], part.size()) += part;
    });
  }
}

TermResidual ClusterScores::with_formal(TermResidual term) {
  for (int b = 0; b < term.block_count; ++b) term.blocks[at(b)].jacobian *= std::sqrt(1 + kScoreWeight);
  return term;
}

void ClusterScores::finish() {
  const std::int64_t n = front_.dimension(), count = std::ssize(scores_);
  if (count == 0) return;
  Eigen::MatrixXd scores(n, count);
  for (auto& [key, cluster] : clusters_) {
    const double rank = static_cast<double>(cluster.rank) / static_cast<double>(cluster.points);
    const double share = followed_share(weights_.concentration, cluster.leverage, rank);
    scores.col(cluster.column) =
        scores_[at(cluster.column)] * std::sqrt((1 - kMeanShare) * kScoreWeight * weights_.inflation / (1 - share));
  }
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(n, n);
  squares.selfadjointView<Eigen::Lower>().rankUpdate(scores);
  for (std::int64_t column = 0; column < n; ++column)
    for (std::int64_t row = column; row < n; ++row) *front_.place(row, column).values += squares(row, column);
}

void ImageSpread::Sum::add(const Sum& other) {
  squares += other.squares;
  expected += other.expected;
}

void ImageSpread::add(const ImageSpread& other) {
  images.add(other.images);
  fields.add(other.fields);
  for (const auto& [camera, sum] : other.cameras) cameras[camera].add(sum);
}

double ImageSpread::inflation() const { return std::max(1.0, images.ratio() / fields.ratio()); }

double ImageSpread::ratio() const { return fields.ratio() * inflation(); }

double ImageSpread::camera_inflation(std::int64_t camera, double reached) const {
  const auto found = cameras.find(camera);
  return found == cameras.end() || !(reached > 0) ? 1 : std::max(1.0, found->second.ratio() / reached);
}

Bytes ImageSpread::to_bytes() const {
  ByteWriter out;
  out.value(images);
  out.value(fields);
  for (const auto& [camera, sum] : cameras) {
    out.value(camera);
    out.value(sum);
  }
  return out.take();
}

ImageSpread ImageSpread::from_bytes(const Bytes& bytes) {
  ByteReader in(bytes);
  ImageSpread spread;
  spread.images = in.value<Sum>();
  spread.fields = in.value<Sum>();
  while (!in.at_end()) {
    const auto camera = in.value<std::int64_t>();
    spread.cameras[camera] = in.value<Sum>();
  }
  return spread;
}

double spread_share(std::int64_t images, std::int64_t cameras) {
  constexpr std::int64_t kImages = 400, kImagesPerCamera = 50;
  const std::int64_t enough = std::max(kImages, kImagesPerCamera * cameras);
  return images <= enough ? 1 : static_cast<double>(enough) / static_cast<double>(images);
}

ImageClusters::ImageClusters(const TileProblem& problem, const TilePlan& plan, const std::vector<double>& extents,
                             double share)
    : problem_(problem), plan_(plan), extents_(extents) {
  // The multiples of the golden ratio, modulo 1, are spread evenly over [0, 1), also those of every n-th image.
  for (const TileImage& image : problem.images) {
    const double multiple = static_cast<double>(image.image.value) * std::numbers::phi;
    in_sample_.push_back(multiple - std::floor(multiple) < share);
  }
}

Eigen::Index ImageClusters::Cluster::row_of(std::int64_t unknown, Eigen::Index dimension) {
  const auto [place, is_new] = rows.try_emplace(unknown, Rows{score.size(), dimension});
  if (is_new) {
    const Eigen::Index n = score.size() + dimension;
    score.conservativeResizeLike(Eigen::VectorXd::Zero(n));
    normal.conservativeResizeLike(Eigen::MatrixXd::Zero(n, n));
  }
  return place->second.first;
}

void ImageClusters::add_point(const PointEquations& equations, std::size_t i, double leverage) {
  const PointEquations::Point& point = equations.points()[i];
  if (problem_.points[at(point.point)].role != PointRole::kTie) return;
  const auto [image, number] = field_of(problem_, extents_, point.point);
  if (!in_sample_[at(image)]) return;
  Cluster& cluster = clusters_[image];
  Field& field = cluster.fields[number];
  field.leverage += leverage;
  field.rank += static_cast<double>(2 * point.observation_count() - 3);
  ++field.points;
  ReducedPoint reduced(equations, i);
  reduced.visit_normal([&](std::int64_t a, std::int64_t b, const Eigen::Ref<const Eigen::MatrixXd>& block) {
    const Eigen::Index row = cluster.row_of(a, block.rows()), column = cluster.row_of(b, block.cols());
    cluster.normal.block(row, column, block.rows(), block.cols()) += block;
  });
  reduced.visit_score([&](std::int64_t unknown, const Eigen::Ref<const Eigen::VectorXd>& part) {
    const Eigen::Index row = cluster.row_of(unknown, part.size());
    if (field.score.size() < cluster.score.size())
      field.score.conservativeResizeLike(Eigen::VectorXd::Zero(cluster.score.size()));
    cluster.score.segment(row, part.size()) += part;
    field.score.segment(row, part.size()) += part;
  });
}

void ImageClusters::finish(const CovarianceOf& covariance_of, CellSpread& spread) {
  for (auto& [image, cluster] : clusters_) {
    const Eigen::Index n = cluster.score.size();
    Eigen::MatrixXd covariance(n, n);
    for (const auto& [a, of_a] : cluster.rows)
      for (const auto& [b, of_b] : cluster.rows)
        covariance.block(of_a.first, of_b.first, of_a.count, of_b.count) = covariance_of(a, of_a.count, b, of_b.count);
    // P = C S; E s's = S - S C S.
    const Eigen::MatrixXd p = covariance * cluster.normal;
    const double expected = p.trace() - p.cwiseProduct(p.transpose()).sum();
    spread.images.images.add({cluster.score.dot(covariance * cluster.score), expected});
    for (auto& [number, field] : cluster.fields) {
      field.score.conservativeResizeLike(Eigen::VectorXd::Zero(n));
      spread.fields.push_back(
          {field.score.dot(covariance * field.score), field.leverage, field.rank / static_cast<double>(field.points)});
    }
    for (const auto& [unknown, rows] : cluster.rows) {
      const UnknownId& id = plan_.unknowns[at(unknown)].id;
      if (id.kind != UnknownKind::kCamera) continue;
      const Eigen::MatrixXd own = covariance.block(rows.first, rows.first, rows.count, rows.count),
                            with_all = covariance.middleRows(rows.first, rows.count);
      const Eigen::VectorXd change = with_all * cluster.score;
      const Eigen::MatrixXd mean = p.middleRows(rows.first, rows.count) * with_all.transpose();
      const Eigen::MatrixXd followed = p.middleRows(rows.first, rows.count) * p * with_all.transpose();
      spread.images.cameras[id.index].add(
          {change.dot(Eigen::VectorXd(solve_symmetric(own, change))), solve_symmetric(own, mean - followed).trace()});
    }
  }
  clusters_.clear();
}

ImageSpread CellSpread::sums(double concentration) const {
  ImageSpread sums = images;
  for (const Field& field : fields)
    sums.fields.add({field.squares, field.leverage * (1 - followed_share(concentration, field.leverage, field.rank))});
  return sums;
}

}  // namespace megablock
