#include "merge/tile/cluster_scores.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "geometry/numbers/decompositions.h"
#include "merge/plan/unknowns.h"
#include "merge/tile/cell_assembler.h"
#include "merge/tile/reduced_point.h"

namespace megablock {

namespace {

// Squares of the ratio one that rho starts with.
constexpr double kSquaresBefore = 2;

// The middle one of the images that keep a point.
std::int32_t middle_image(const TileProblem& problem, std::int64_t point) {
  const std::int64_t first = problem.begin[at(point)], last = problem.begin[at(point) + 1];
  std::int64_t before = std::accumulate(problem.kept.begin() + first, problem.kept.begin() + last, std::int64_t{0}) / 2;
  std::int64_t row = first;
  while (!problem.kept[at(row)] || before-- > 0) ++row;
  return problem.image[at(row)].value;
}

}  // namespace

ClusterWeights cluster_weights(const ImageSpread& spread) {
  const double g = spread.unshrunk(), f = 1 + 2 * (1 - kMeanShare) * (1 - kMeanShare) * (1 - 1 / g);
  return {f * g, f * spread.ratio()};
}

ClusterScores::ClusterScores(const TileProblem& problem, const TilePlan& plan, const ClusterWeights& weights,
                             Front& front)
    : problem_(problem), plan_(plan), weights_(weights), front_(front) {
  for (const Unknown& u : plan.unknowns) rows_.push_back(front.row_of(u.id));
}

Eigen::VectorXd& ClusterScores::score_of(std::int64_t point) {
  const auto [place, is_new] = clusters_.try_emplace(middle_image(problem_, point));
  if (is_new) place->second.setZero(front_.dimension());
  return place->second;
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
    Eigen::VectorXd& score = score_of(point.point);
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
  if (clusters_.empty()) return;
  const std::int64_t n = front_.dimension();
  Eigen::MatrixXd scores(n, std::ssize(clusters_));
  Eigen::Index column = 0;
  for (const auto& [image, score] : clusters_)
    scores.col(column++) = score * std::sqrt((1 - kMeanShare) * kScoreWeight * weights_.unshrunk);
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(n, n);
  squares.selfadjointView<Eigen::Lower>().rankUpdate(scores);
  for (std::int64_t j = 0; j < n; ++j)
    for (std::int64_t i = j; i < n; ++i) *front_.place(i, j).values += squares(i, j);
}

void ImageSpread::Sum::add(const Sum& other) {
  squares += other.squares;
  expected += other.expected;
}

void ImageSpread::add(const ImageSpread& other) {
  images.add(other.images);
  trace += other.trace;
  for (const auto& [camera, sum] : other.cameras) cameras[camera].add(sum);
}

double ImageSpread::ratio() const { return (images.squares + kSquaresBefore) / (images.expected + kSquaresBefore); }

double ImageSpread::unshrunk() const { return images.expected > 0 ? trace / images.expected : 1; }

double ImageSpread::camera_inflation(std::int64_t camera, double reached) const {
  const auto found = cameras.find(camera);
  return found == cameras.end() || !(reached > 0) ? 1 : std::max(1.0, found->second.ratio() / reached);
}

Bytes ImageSpread::to_bytes() const {
  ByteWriter out;
  out.value(images);
  out.value(trace);
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
  spread.trace = in.value<double>();
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

ImageClusters::ImageClusters(const TileProblem& problem, const TilePlan& plan, double share)
    : problem_(problem), plan_(plan) {
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

void ImageClusters::add_point(const PointEquations& equations, std::size_t i) {
  const PointEquations::Point& point = equations.points()[i];
  if (problem_.points[at(point.point)].role != PointRole::kTie) return;
  const std::int32_t image = middle_image(problem_, point.point);
  if (!in_sample_[at(image)]) return;
  Cluster& cluster = clusters_[image];
  ReducedPoint reduced(equations, i);
  reduced.visit_normal([&](std::int64_t a, std::int64_t b, const Eigen::Ref<const Eigen::MatrixXd>& block) {
    const Eigen::Index row = cluster.row_of(a, block.rows()), column = cluster.row_of(b, block.cols());
    cluster.normal.block(row, column, block.rows(), block.cols()) += block;
  });
  reduced.visit_score([&](std::int64_t unknown, const Eigen::Ref<const Eigen::VectorXd>& part) {
    const Eigen::Index row = cluster.row_of(unknown, part.size());
    cluster.score.segment(row, part.size()) += part;
  });
}

void ImageClusters::finish(const CovarianceOf& covariance_of, ImageSpread& spread) {
  for (auto& [image, cluster] : clusters_) {
    const Eigen::Index n = cluster.score.size();
    Eigen::MatrixXd covariance(n, n);
    for (const auto& [a, of_a] : cluster.rows)
      for (const auto& [b, of_b] : cluster.rows)
        covariance.block(of_a.first, of_b.first, of_a.count, of_b.count) = covariance_of(a, of_a.count, b, of_b.count);
    // P = C S; E s's = S - S C S.
    const Eigen::MatrixXd p = covariance * cluster.normal;
    const double expected = p.trace() - p.cwiseProduct(p.transpose()).sum();
    spread.images.add({cluster.score.dot(covariance * cluster.score), expected});
    spread.trace += p.trace();
    for (const auto& [unknown, rows] : cluster.rows) {
      const UnknownId& id = plan_.unknowns[at(unknown)].id;
      if (id.kind != UnknownKind::kCamera) continue;
      const Eigen::MatrixXd own = covariance.block(rows.first, rows.first, rows.count, rows.count),
                            with_all = covariance.middleRows(rows.first, rows.count);
      const Eigen::VectorXd change = with_all * cluster.score;
      const Eigen::MatrixXd mean = p.middleRows(rows.first, rows.count) * with_all.transpose();
      const Eigen::MatrixXd followed = p.middleRows(rows.first, rows.count) * p * with_all.transpose();
      spread.cameras[id.index].add(
          {change.dot(Eigen::VectorXd(solve_symmetric(own, change))), solve_symmetric(own, mean - followed).trace()});
    }
  }
  clusters_.clear();
}

}  // namespace megablock
