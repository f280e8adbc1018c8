// The Gauss-Helmert adjustment against independent solutions of the same problems: explicit least squares, total least
// squares, and the scatter of many trials.
#include "geometry/estimation/gauss_helmert.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>
#include <random>

#include "geometry/similarity/similarity_adjustment.h"
#include "geometry/transform/rotation.h"

namespace megablock {
namespace {

using Points = std::vector<Eigen::Vector2d>;
using Covariances = std::vector<Eigen::Matrix2d>;

// y = slope x + height, with errors in both coordinates.
struct LineBySlope {
  static constexpr int kUnknowns = 2, kEquations = 1, kMeasurements = 2, kConstraints = 0;
  using State = Eigen::Vector2d;
  void linearise(const State& s, const Eigen::Vector2d& l, std::size_t, GroupEquations<LineBySlope>& out) const {
    out.value(0) = s(0) * l.x() + s(1) - l.y();
    out.by_unknowns << l.x(), 1;
    out.by_measurements << s(0), -1;
  }
  void move(State& s, const Eigen::Vector2d& step) const { s += step; }
};

// n'p = d with the constraint |n| = 1.
struct LineByNormal {
  static constexpr int kUnknowns = 3, kEquations = 1, kMeasurements = 2, kConstraints = 1;
  using State = Eigen::Vector3d;
  void linearise(const State& s, const Eigen::Vector2d& l, std::size_t, GroupEquations<LineByNormal>& out) const {
    out.value(0) = s.head<2>().dot(l) - s(2);
    out.by_unknowns << l.x(), l.y(), -1;
    out.by_measurements << s(0), s(1);
  }
  void move(State& s, const Eigen::Vector3d& step) const { s += step; }
  void constrain(const State& s, ConstraintEquations<LineByNormal>& out) const {
    out.value(0) = 0.5 * (s.head<2>().squaredNorm() - 1);
    out.by_unknowns << s(0), s(1), 0;
  }
};

template <typename Model>
auto fit_line(const typename Model::State& start, const Points& points, const Covariances& covariances,
              const GaussHelmertOptions& options = {}) {
  return fit_gauss_helmert(Model(), start, std::span<const Eigen::Vector2d>(points),
                           std::span<const Eigen::Matrix2d>(covariances), options);
}

struct SlopedLine {
  Points points;
  Covariances covariances;
};

SlopedLine sloped_line(std::uint64_t seed, int count = 25) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0, 1);
  SlopedLine line;
  for (int i = 0; i < count; ++i) {
    const double x = 4.0 * i / count;
    Eigen::Matrix2d root;
    root << 0.02 + 0.03 * (i % 3), 0.01, -0.02, 0.05 - 0.02 * (i % 2);
    line.covariances.push_back(root * root.transpose());
    line.points.push_back(Eigen::Vector2d(x, 0.8 * x - 1.5) + root * Eigen::Vector2d(normal(random), normal(random)));
  }
  return line;
}

// The same problem without conditions: with the true abscissae as further unknowns it is ordinary least squares.
struct Explicit {
  Eigen::Vector2d state;
  Eigen::Matrix2d covariance;
  double squares;
};
Explicit explicit_line(const SlopedLine& line) {
  const auto count = static_cast<Eigen::Index>(line.points.size());
  Eigen::VectorXd x(count + 2);
  x.head<2>() << 0.7, -1.4;
  for (Eigen::Index i = 0; i < count; ++i) x(i + 2) = line.points[static_cast<std::size_t>(i)].x();
  Eigen::MatrixXd normal;
  double squares = 0;
  for (int iteration = 0; iteration < 30; ++iteration) {
    normal = Eigen::MatrixXd::Zero(count + 2, count + 2);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(count + 2);
    squares = 0;
    for (Eigen::Index i = 0; i < count; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const Eigen::Matrix2d weight = line.covariances[at].inverse();
      const Eigen::Vector2d residual = Eigen::Vector2d(x(i + 2), x(0) * x(i + 2) + x(1)) - line.points[at];
      Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(2, count + 2);
      jacobian(1, 0) = x(i + 2);
      jacobian(1, 1) = 1;
      jacobian.col(i + 2) << 1, x(0);
      normal += jacobian.transpose() * weight * jacobian;
      right -= jacobian.transpose() * weight * residual;
      squares += residual.dot(weight * residual);
    }
    x += normal.ldlt().solve(right);
  }
  return {x.head<2>(), normal.inverse().topLeftCorner<2, 2>(), squares};
}

TEST(GaussHelmert, FindsTheMinimumAndCovarianceOfExplicitLeastSquares) {
  const SlopedLine line = sloped_line(3);
  const auto fit = fit_line<LineBySlope>({0.5, -1}, line.points, line.covariances, {100, 1e-9});
  ASSERT_TRUE(fit);
  const Explicit other = explicit_line(line);
  EXPECT_LT((fit->state - other.state).norm(), 1e-9);
  EXPECT_LT((fit->covariance - other.covariance).norm(), 1e-7 * other.covariance.norm());
  EXPECT_NEAR(fit->weighted_squares, other.squares, 1e-8 * other.squares);
  EXPECT_EQ(fit->redundancy, 23);
}

TEST(GaussHelmert, CorrectedMeasurementsMeetTheEquations) {
  const SlopedLine line = sloped_line(4);
  const auto fit = fit_line<LineBySlope>({0.8, -1.5}, line.points, line.covariances, {100, 1e-9});
  ASSERT_TRUE(fit);
  double squares = 0;
  for (std::size_t i = 0; i < line.points.size(); ++i) {
    const Eigen::Vector2d corrected = line.points[i] + fit->corrections[i];
    EXPECT_NEAR(fit->state(0) * corrected.x() + fit->state(1), corrected.y(), 1e-12);
    squares += fit->corrections[i].dot(line.covariances[i].inverse() * fit->corrections[i]);
  }
  EXPECT_NEAR(squares, fit->weighted_squares, 1e-9 * squares);
}

TEST(GaussHelmert, BorderedConstraintGivesTotalLeastSquares) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0, 0.1);
  for (const double azimuth : {0.0, 0.9, 1.5707, 2.8}) {
    Points points;
    for (int i = 0; i < 40; ++i)
      points.emplace_back(100 + std::cos(azimuth) * i + normal(random), -50 + std::sin(azimuth) * i + normal(random));
    const Eigen::Vector3d start(-std::sin(azimuth + 0.2), std::cos(azimuth + 0.2), 0);
    const auto fit = fit_line<LineByNormal>(start, points, {Eigen::Matrix2d::Identity() * 0.01}, {100, 1e-9});
    ASSERT_TRUE(fit);

    Eigen::Vector2d centre = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& p : points) centre += p / 40;
    Eigen::MatrixXd rows(40, 2);
    for (Eigen::Index i = 0; i < 40; ++i) rows.row(i) = points[static_cast<std::size_t>(i)] - centre;
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(rows, Eigen::ComputeThinV);
    Eigen::Vector2d across = svd.matrixV().col(1);
    if (across.dot(fit->state.head<2>()) < 0) across = -across;
    EXPECT_LT((fit->state.head<2>() - across).norm(), 1e-9);
    EXPECT_NEAR(fit->state(2), across.dot(centre), 1e-7);
    EXPECT_NEAR(fit->weighted_squares, std::pow(svd.singularValues()(1), 2) / 0.01, 1e-6);
    EXPECT_LT(std::abs(fit->covariance.row(0).head<2>() * fit->state.head<2>()), 1e-12) << "|n| has no error";
  }
}

TEST(GaussHelmert, CovarianceIsThatOfManyTrials) {
  constexpr int kTrials = 4000;
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero(), predicted = Eigen::Matrix2d::Zero();
  double normalised = 0, factor = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const SlopedLine line = sloped_line(static_cast<std::uint64_t>(trial) + 100);
    const auto fit = fit_line<LineBySlope>({0.7, -1.4}, line.points, line.covariances);
    ASSERT_TRUE(fit);
    const Eigen::Vector2d error = fit->state - Eigen::Vector2d(0.8, -1.5);
    scatter += error * error.transpose() / kTrials;
    predicted += fit->covariance / kTrials;
    normalised += error.dot(fit->covariance.inverse() * error) / 2 / kTrials;
    factor += fit->weighted_squares / static_cast<double>(fit->redundancy) / kTrials;
  }
  RecordProperty("normalised", std::to_string(normalised));
  RecordProperty("factor", std::to_string(factor));
  // The variances of 4000 trials scatter by 2.2 %, the mean of a chi-square of two degrees of freedom over two by 1.6
  // %.
  EXPECT_NEAR(scatter(0, 0) / predicted(0, 0), 1, 0.08);
  EXPECT_NEAR(scatter(1, 1) / predicted(1, 1), 1, 0.08);
  EXPECT_NEAR(scatter(0, 1) / predicted(0, 1), 1, 0.10);
  EXPECT_NEAR(normalised, 1, 0.05);
  EXPECT_NEAR(factor, 1, 0.02);
}

TEST(GaussHelmert, ExactMeasurementsEndToo) {
  Points points;
  for (int i = 0; i < 10; ++i) points.emplace_back(1e3 * i, 800.0 * i - 1.5);
  const auto fit = fit_line<LineBySlope>({0.1, 40}, points, {Eigen::Matrix2d::Identity() * 1e-24});
  ASSERT_TRUE(fit) << "the last steps are rounding, larger than these sigmas";
  EXPECT_NEAR(fit->state(0), 0.8, 1e-14);
  EXPECT_NEAR(fit->state(1), -1.5, 1e-10);
}

TEST(GaussHelmert, RefusesWhatDoesNotDetermineTheUnknowns) {
  const Covariances unit{Eigen::Matrix2d::Identity()};
  EXPECT_FALSE(fit_line<LineBySlope>({1, 0}, {}, unit));
  EXPECT_FALSE(fit_line<LineBySlope>({1, 0}, {{1, 1}}, unit));
  EXPECT_FALSE(fit_line<LineBySlope>({0, 0}, {{3, 1}, {3, 1}, {3, 1}}, unit)) << "one place, three times";
  EXPECT_TRUE(fit_line<LineBySlope>({1, 0}, {{1, 1}, {2, 4}}, unit)) << "just enough";
  EXPECT_FALSE(fit_line<LineBySlope>({1, 0}, {{1, 1}, {2, 4}, {3, 5}}, {Eigen::Matrix2d::Zero()})) << "no errors";
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinite = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(fit_line<LineBySlope>({1, 0}, {{1, 1}, {2, nan}, {3, 5}}, unit));
  EXPECT_FALSE(fit_line<LineBySlope>({1, 0}, {{1, 1}, {2, infinite}, {3, 5}}, unit));
  EXPECT_FALSE(fit_line<LineBySlope>({nan, 0}, {{1, 1}, {2, 3}, {3, 5}}, unit));
  EXPECT_FALSE(fit_line<LineBySlope>({1, 0}, {{1, 1}, {2, 4}, {3, 5}}, {nan * Eigen::Matrix2d::Identity()}));
  EXPECT_FALSE(fit_line<LineBySlope>({1, 0}, {{1, 1}, {2, 4}, {3, 5}}, {unit[0], unit[0]})) << "one covariance lacks";
}

struct TwoModels {
  Similarity truth{1.5, Eigen::Quaterniond(0.4, -0.3, 0.6, 0.5).normalized(), {2000, 1000, 500}};
  std::vector<PointPair> pairs;
  TwoModels(std::uint64_t seed, const Eigen::Vector3d& place, int count = 12) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(0, 1);
    const auto vector = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
    const Eigen::Matrix3d a = Eigen::Vector3d(0.2, 0.2, 0.6).asDiagonal();
    Eigen::Matrix3d b;
    b << 0.3, 0.1, 0, 0, 0.2, -0.1, 0.1, 0, 0.5;
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3d x = place + 100 * vector();
      pairs.push_back({x + a * vector(), truth(x) + b * vector(), a * a.transpose(), b * b.transpose()});
    }
  }
  std::vector<Eigen::Vector3d> side(Eigen::Vector3d PointPair::*member) const {
    std::vector<Eigen::Vector3d> points;
    for (const PointPair& pair : pairs) points.push_back(pair.*member);
    return points;
  }
  Similarity start() const { return *fit_similarity(side(&PointPair::from), side(&PointPair::to)); }
};

TEST(SimilarityAdjustment, NormalisedErrorsAreThoseOfTheCovariance) {
  constexpr int kTrials = 1500;
  double normalised = 0, factor = 0, plain = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const TwoModels models(static_cast<std::uint64_t>(trial) + 1, Eigen::Vector3d(300, -200, 50));
    const Similarity start = models.start();
    const auto fit = adjust_similarity(start, models.pairs);
    ASSERT_TRUE(fit);
    const auto squared = [&](const Similarity& s) {
      Eigen::Matrix<double, 7, 1> error;
      error << rotation_log<double>(models.truth.rotation.conjugate() * s.rotation),
          std::log(s.scale / models.truth.scale), s.translation - models.truth.translation;
      return error.dot(fit->covariance.ldlt().solve(error)) / 7;
    };
    normalised += squared(fit->similarity) / kTrials;
    plain += squared(start) / kTrials;
    factor += fit->weighted_squares / static_cast<double>(fit->redundancy) / kTrials;
  }
  RecordProperty("normalised", std::to_string(normalised));
  RecordProperty("plain", std::to_string(plain));
  EXPECT_NEAR(normalised, 1, 0.06);  // three times its scatter of sqrt(2 / 7 / 1500)
  EXPECT_NEAR(factor, 1, 0.02);
  EXPECT_GT(plain, 1.2 * normalised) << "equal weights lose what the covariances tell";
}

TEST(SimilarityAdjustment, FarFromTheOriginIsTheSame) {
  const Eigen::Vector3d place(3e5, -5e6, 2e3);
  const TwoModels near(9, Eigen::Vector3d::Zero()), far(9, place);
  const auto a = adjust_similarity(near.start(), near.pairs), b = adjust_similarity(far.start(), far.pairs);
  ASSERT_TRUE(a && b);
  EXPECT_NEAR(a->similarity.scale, b->similarity.scale, 1e-9);
  const Eigen::Matrix4d of_a = a->covariance.topLeftCorner<4, 4>(), of_b = b->covariance.topLeftCorner<4, 4>();
  EXPECT_LT((of_a - of_b).norm(), 1e-5 * of_a.norm());
  // The covariance of a transformed point near the set can be compared; that of the distant origin cannot.
  const auto at = [](const AdjustedSimilarity& fit, const Eigen::Vector3d& x) {
    Eigen::Matrix<double, 3, 7> j;
    const Eigen::Matrix3d turn = fit.similarity.scale * fit.similarity.rotation.toRotationMatrix();
    j << -turn * skew(x), turn * x, Eigen::Matrix3d::Identity();
    return propagated(j, fit.covariance);
  };
  const Eigen::Matrix3d here = at(*a, {10, 20, 30}), there = at(*b, place + Eigen::Vector3d(10, 20, 30));
  EXPECT_LT((here - there).norm(), 1e-4 * here.norm());
}

TEST(SimilarityAdjustment, RefusesBadInput) {
  TwoModels models(2, Eigen::Vector3d::Zero());
  const Similarity start = models.start();
  EXPECT_FALSE(adjust_similarity(start, {}));
  EXPECT_FALSE(adjust_similarity(start, std::span(models.pairs).first(2)));
  EXPECT_TRUE(adjust_similarity(start, std::span(models.pairs).first(3)));
  std::vector<PointPair> same(5, models.pairs.front());
  EXPECT_FALSE(adjust_similarity(start, same));
  std::vector<PointPair> line;
  for (int i = 0; i < 6; ++i) {
    line.push_back(models.pairs.front());
    line.back().from = i * Eigen::Vector3d(10, 20, -5);
    line.back().to = models.truth(line.back().from);
  }
  EXPECT_FALSE(adjust_similarity(models.truth, line)) << "the turn about the line";
  models.pairs[4].to.y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(adjust_similarity(start, models.pairs));
}

}  // namespace
}  // namespace megablock
