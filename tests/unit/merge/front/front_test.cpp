// Fronts, their covariances and costs against dense algebra, and the choice of fronts that are moved to disk.
#include "merge/front/front.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <filesystem>
#include <functional>
#include <random>
#include <sstream>

#include "merge/plan/plan.h"
#include "merge/step/memory.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

UnknownList frames(std::int64_t first, std::int64_t end) {
  UnknownList list;
  for (std::int64_t f = first; f < end; ++f) list.push_back({{UnknownKind::kFrame, 0, f}, 6});
  return list;
}

// Normal equations with some redundancy over frames 0 to 7; odd frames are eliminated, so that rows interleave.
struct Dense {
  Dense() : k(48, 48), b(48) {
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    const Eigen::MatrixXd j = Eigen::MatrixXd::NullaryExpr(90, 48, [&] { return normal(random); });
    k = j.transpose() * j;
    b = j.transpose() * Eigen::VectorXd::NullaryExpr(90, [&] { return normal(random); });
    for (std::int64_t f = 0; f < 8; ++f)
      (f % 2 == 1 ? eliminated : separator).push_back({{UnknownKind::kFrame, 0, f}, 6});
  }
  UpdateMatrix child() const {
    UpdateMatrix update;
    update.unknowns = frames(0, 8);
    for (Eigen::Index c = 0; c < 48; ++c)
      for (Eigen::Index r = c; r < 48; ++r) update.matrix.push_back(k(r, c));
    update.rhs.assign(b.begin(), b.end());
    for (Eigen::Index r = 0; r < 48; ++r) update.diagonal.push_back(k(r, r));
    return update;
  }
  Eigen::MatrixXd block(const UnknownList& rows, const UnknownList& columns, const Eigen::MatrixXd& of) const {
    Eigen::MatrixXd m(6 * rows.size(), 6 * columns.size());
    for (std::size_t r = 0; r < rows.size(); ++r)
      for (std::size_t c = 0; c < columns.size(); ++c)
        m.block<6, 6>(6 * static_cast<Eigen::Index>(r), 6 * static_cast<Eigen::Index>(c)) =
            of.block<6, 6>(6 * rows[r].id.index, 6 * columns[c].id.index);
    return m;
  }
  Eigen::MatrixXd k;
  Eigen::VectorXd b;
  UnknownList eliminated, separator;
};

TEST(FrontTest, UpdateMatrixIsTheSchurComplementWithAndWithoutMemoryOfOthers) {
  const Dense dense;
  const Eigen::MatrixXd pp = dense.block(dense.separator, dense.separator, dense.k),
                        pe = dense.block(dense.separator, dense.eliminated, dense.k),
                        ee = dense.block(dense.eliminated, dense.eliminated, dense.k);
  const Eigen::MatrixXd schur = pp - pe * ee.ldlt().solve(pe.transpose());
  FrontMemory memory;
  memory.give(std::vector<double>(3000, 5.0));  // what an earlier front left must not show
  memory.give(std::vector<double>(10, 5.0));
  for (FrontMemory* shared : {static_cast<FrontMemory*>(nullptr), &memory, &memory}) {
    Front front(dense.eliminated, dense.separator, 1, shared);
    front.add(dense.child());
    const Front::Result result = std::move(front).eliminate(0);
    ASSERT_EQ(result.update.matrix.size(), 24U * 25 / 2);
    std::size_t i = 0;
    for (Eigen::Index c = 0; c < 24; ++c)
      for (Eigen::Index r = c; r < 24; ++r) EXPECT_NEAR(result.update.matrix[i++], schur(r, c), 1e-11 * schur(c, c));
  }
}

TEST(FrontTest, FactorsWithADamagedSizeAreRefused) {
  FrontFactor whole;
  whole.eliminated = frames(0, 2);
  whole.separator = frames(2, 3);
  whole.right_hand_sides = 2;
  whole.factor.assign(18 * 12, 1);
  whole.z.assign(12 * 2, 1);
  whole.held = {0, 11};
  const auto back = [](const FrontFactor& factor) {
    ByteWriter out;
    factor.write(out);
    const Bytes bytes = out.take();
    ByteReader in(bytes);
    return FrontFactor::read(in);
  };
  EXPECT_EQ(back(whole).factor, whole.factor);
  EXPECT_EQ(back(whole).held, whole.held);
  EXPECT_NO_THROW(back({})) << "of a node without a front";
  using Damage = std::function<void(FrontFactor&)>;
  const std::vector<Damage> damages = {[](FrontFactor& f) { f.factor.pop_back(); },
                                       [](FrontFactor& f) { f.z.push_back(0); },
                                       [](FrontFactor& f) { f.held.back() = 12; },
                                       [](FrontFactor& f) { f.held.back() = -1; },
                                       [](FrontFactor& f) { f.right_hand_sides = -2; },
                                       [](FrontFactor& f) { f.eliminated[1].dimension = 7; },
                                       [](FrontFactor& f) { f.separator[0].dimension = std::int64_t{1} << 40; },
                                       [](FrontFactor& f) { f.eliminated.pop_back(); }};
  for (std::size_t d = 0; d < damages.size(); ++d) {
    FrontFactor factor = whole;
    damages[d](factor);
    EXPECT_THROW(back(factor), StoreError) << d;
  }
}

TEST(FrontTest, CovariancesByPartsAreThoseOfTheInverse) {
  const Dense dense;
  Eigen::MatrixXd inverse = dense.k.inverse();
  inverse = 0.5 * (inverse + inverse.transpose().eval());  // to the bit
  Front front(dense.eliminated, dense.separator);
  front.add(dense.child());
  const FrontFactor factor = std::move(front).eliminate(0).factor;
  const Eigen::MatrixXd outer = dense.block(dense.separator, dense.separator, inverse);
  const FrontCovariance covariance =
      covariance_down(factor, {dense.separator, std::vector<double>(outer.data(), outer.data() + outer.size())});
  const CovarianceMatrix whole = covariance.whole();
  ASSERT_EQ(whole.unknowns, frames(0, 8));
  EXPECT_LT((Eigen::Map<const Eigen::MatrixXd>(whole.matrix.data(), 48, 48) - inverse).cwiseAbs().maxCoeff(), 1e-12);
  const UnknownList some = {dense.eliminated[2], dense.separator[3]};
  const CovarianceMatrix part = covariance.restricted_to(some);
  EXPECT_LT((Eigen::Map<const Eigen::MatrixXd>(part.matrix.data(), 12, 12) - dense.block(some, some, inverse))
                .cwiseAbs()
                .maxCoeff(),
            1e-12);
  EXPECT_EQ(CovarianceMatrix::from_bytes(part.to_bytes()).matrix, part.matrix);
  EXPECT_EQ(covariance.bytes_of(some), part.to_bytes());
  EXPECT_THROW(covariance.bytes_of(frames(8, 9)), ComputeError);
  EXPECT_THROW(CovarianceMatrix::from_bytes(part.to_bytes() + " "), StoreError);
  EXPECT_THROW(CovarianceMatrix::from_bytes(part.to_bytes().substr(0, 100)), StoreError);
  EXPECT_THROW(covariance.restricted_to(frames(8, 9)), ComputeError);
  EXPECT_THROW(covariance_down(factor, {dense.eliminated, whole.matrix}), ComputeError);
}

TEST(FrontTest, CostsCountInnerNodesAlone) {
  EliminationPlan plan;
  plan.nodes.resize(3);
  plan.nodes[0].leaf = 0;
  plan.nodes[0].eliminated = frames(0, 1000);
  plan.nodes[1].eliminated = frames(0, 2);  // 12 eliminated, 18 passed
  plan.nodes[1].separator = frames(2, 5);
  plan.nodes[2].eliminated = frames(2, 5);
  const FrontCosts costs = front_costs(plan);
  EXPECT_EQ(costs.widest, 30);
  EXPECT_EQ(costs.root, 18);
  EXPECT_DOUBLE_EQ(costs.operations, 12. * 12 * 12 / 3 + 18. * 12 * 12 + 18. * 18 * 12 + 18. * 18 * 18 / 3);
}

class ScratchTest : public testing::Test {
 protected:
  ScratchDirectory scratch_;
};

TEST_F(ScratchTest, BytesOfAFileAreThoseOfMemory) {
  const std::vector<double> values = {1, 2, 3};
  std::stringstream file;
  ByteWriter to_file(file), to_memory;
  for (ByteWriter* writer : {&to_file, &to_memory}) {
    writer->value<std::int32_t>(5);
    writer->values(values);
    writer->bytes("text");
  }
  const Bytes bytes = to_memory.take();
  ASSERT_EQ(file.str(), bytes);
  ByteReader from_file(file, bytes.size());
  EXPECT_EQ(from_file.value<std::int32_t>(), 5);
  EXPECT_EQ(from_file.values<double>(), values);
  EXPECT_EQ(from_file.bytes(), "text");
  EXPECT_TRUE(from_file.at_end());
  file.clear();
  file.seekg(0);
  ByteReader truncated(file, bytes.size() - 1);
  truncated.value<std::int32_t>();
  truncated.values<double>();
  EXPECT_THROW(truncated.bytes(), StoreError);
}

}  // namespace
}  // namespace megablock
